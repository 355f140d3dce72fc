// What a sweep's pictures show is the same whether one is looked at at a time or as many as there is room for, and
// comes in their order.
#include "tests/support/test.h"

#include "capture/mapping/map_frontend.h"
#include "tests/world/world.h"

#include <stdlib.h>
#include <string.h>

enum { PICTURES = 9 };

struct sweep {
    struct map map;
    struct map_tag tags[64];
    uint8_t *color[PICTURES];
    uint16_t *depth[PICTURES];
};

static void film(struct sweep *s)
{
    struct world *world;
    struct world_options o = world_default_options();
    o.motion = "still";
    EXPECT_STATUS(world_open(&world, &o), OK);
    *s = (struct sweep){.map = {.calibration = world_calibration(0.5), .tags = s->tags}};
    int32_t count;
    const struct place_tag *tags = world_tags(world, &count);
    for (int32_t i = 0; i < count; i++) {
        s->tags[i] = (struct map_tag){.id = tags[i].id, .side_m = tags[i].side_m};
        EXPECT_TRUE(tag_pattern(tags[i].id, &s->tags[i].pattern));
    }
    s->map.tag_count = count - 1; // the last one is not listed
    size_t pixels = (size_t)s->map.calibration.color.width * (size_t)s->map.calibration.color.height;
    for (int i = 0; i < PICTURES; i++) {
        s->color[i] = malloc(pixels * 3);
        s->depth[i] = malloc(pixels * sizeof *s->depth[i]);
        EXPECT_TRUE(s->color[i] && s->depth[i]);
        struct world_shot shot = {s->map.calibration.color, world_sweep_pose(world, WORLD_SWEEP_S * i / PICTURES), 0,
                                  false};
        struct world_picture picture = {.color = s->color[i], .depth = s->depth[i]};
        EXPECT_STATUS(world_render(world, &shot, &picture), OK);
    }
    world_close(&world);
}

static void put(const struct sweep *s, struct map_look *l, int i)
{
    struct frame frame = {.time_ns = i, .color = s->color[i], .depth = s->depth[i]};
    EXPECT_STATUS(map_look_put(l, &frame, 10 * i), OK);
}

static void expect_same(const struct map_looked *a, const struct map_looked *b)
{
    const struct map_frame *f = &a->shown, *g = &b->shown;
    EXPECT_INT(f->time_ns, g->time_ns);
    EXPECT_INT(a->number, b->number);
    EXPECT_INT(a->id_count, b->id_count);
    EXPECT_TRUE(!memcmp(a->ids, b->ids, (size_t)a->id_count * sizeof *a->ids));
    EXPECT_INT(f->seen_count, g->seen_count);
    for (int32_t i = 0; i < f->seen_count; i++) {
        EXPECT_INT(f->which[i], g->which[i]);
        EXPECT_TRUE(!memcmp(f->seen[i].ray, g->seen[i].ray, sizeof f->seen[i].ray));
        EXPECT_TRUE(!memcmp(f->seen[i].information, g->seen[i].information, sizeof f->seen[i].information));
        EXPECT_INT(f->depths[i].count, g->depths[i].count);
    }
    EXPECT_INT(f->feature_count, g->feature_count);
    for (int32_t i = 0; i < f->feature_count; i++) {
        EXPECT_NEAR(f->features[i].feature.at.x, g->features[i].feature.at.x, 0);
        EXPECT_NEAR(f->features[i].feature.at.y, g->features[i].feature.at.y, 0);
        EXPECT_NEAR(f->features[i].depth, g->features[i].depth, 0);
        EXPECT_INT(feature_distance(f->features[i].feature.descriptor, g->features[i].feature.descriptor), 0);
    }
}

static void one_at_a_time_or_many(void **state)
{
    (void)state;
    struct sweep s;
    struct mapper_options options = mapper_default_options();
    struct map_look *single, *many;
    struct map_looked alone[PICTURES], looked;
    film(&s);
    EXPECT_STATUS(map_look_open(&single, &s.map, &options), OK);
    EXPECT_STATUS(map_look_open(&many, &s.map, &options), OK);
    EXPECT_STATUS(map_look_take(many, &looked), NOTHING);
    int tags = 0, features = 0, taken = 0, put_first = 0;
    for (int i = 0; i < PICTURES; i++) {
        put(&s, single, i);
        EXPECT_STATUS(map_look_take(single, &alone[i]), OK);
        EXPECT_INT(alone[i].number, 10 * i);
        tags += alone[i].shown.seen_count;
        features += alone[i].shown.feature_count;
    }
    EXPECT_AT_LEAST(tags, 5);
    EXPECT_AT_LEAST(features, 500);
    for (int i = 0; i < PICTURES; i++) {
        if (map_look_full(many)) {
            put_first = put_first ? put_first : i;
            EXPECT_STATUS(map_look_take(many, &looked), OK);
            expect_same(&looked, &alone[taken++]);
            map_frame_free(&looked.shown);
        }
        put(&s, many, i);
    }
    EXPECT_AT_LEAST(put_first, 2);
    while (map_look_take(many, &looked) == OK) {
        expect_same(&looked, &alone[taken++]);
        map_frame_free(&looked.shown);
    }
    EXPECT_INT(taken, PICTURES);
    put(&s, many, 0); // closed with pictures in it
    put(&s, many, 1);
    map_look_close(&many);
    map_look_close(&single);
    for (int i = 0; i < PICTURES; i++) {
        map_frame_free(&alone[i].shown);
        free(s.color[i]);
        free(s.depth[i]);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(one_at_a_time_or_many)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
