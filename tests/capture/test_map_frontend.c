// The front end's results are the same whether it works on one image at a time or on as many as it holds, and come in
// the images' order.
#include "tests/support/test.h"

#include "capture/mapping/map_frontend.h"
#include "tests/world/world.h"

#include <stdlib.h>
#include <string.h>

enum { IMAGES = 9 };

struct frontend_sweep {
    struct map map;
    struct map_tag tags[64];
    uint8_t *color[IMAGES];
    uint16_t *depth[IMAGES];
};

static void film(struct frontend_sweep *s)
{
    struct world *world;
    struct world_options o = world_default_options();
    o.motion = "still";
    EXPECT_STATUS(world_open(&world, &o), OK);
    *s = (struct frontend_sweep){.map = {.calibration = world_calibration(0.5), .tags = s->tags}};
    int32_t count;
    const struct place_tag *tags = world_tags(world, &count);
    for (int32_t i = 0; i < count; i++) {
        s->tags[i] = (struct map_tag){.id = tags[i].id, .side_m = tags[i].side_m};
        EXPECT_TRUE(tag_pattern(tags[i].id, &s->tags[i].pattern));
    }
    s->map.tag_count = count - 1; // the last one is not listed
    size_t pixels = (size_t)s->map.calibration.color.width * (size_t)s->map.calibration.color.height;
    for (int i = 0; i < IMAGES; i++) {
        s->color[i] = malloc(pixels * 3);
        s->depth[i] = malloc(pixels * sizeof *s->depth[i]);
        EXPECT_TRUE(s->color[i] && s->depth[i]);
        struct world_shot shot = {s->map.calibration.color, world_sweep_pose(world, WORLD_SWEEP_S * i / IMAGES), 0,
                                  false};
        struct world_image image = {.color = s->color[i], .depth = s->depth[i]};
        EXPECT_STATUS(world_render(world, &shot, &image), OK);
    }
    world_close(&world);
}

static void put(const struct frontend_sweep *s, struct map_frontend *l, int i)
{
    struct frame frame = {.time_ns = i, .color = s->color[i], .depth = s->depth[i]};
    EXPECT_STATUS(map_frontend_put(l, &frame, 10 * i), OK);
}

static void expect_same(const struct map_frontend_result *a, const struct map_frontend_result *b)
{
    const struct map_frame *f = &a->observed, *g = &b->observed;
    EXPECT_INT(f->time_ns, g->time_ns);
    EXPECT_INT(a->number, b->number);
    EXPECT_INT(a->id_count, b->id_count);
    EXPECT_TRUE(!memcmp(a->ids, b->ids, (size_t)a->id_count * sizeof *a->ids));
    EXPECT_INT(f->seen_count, g->seen_count);
    for (int32_t i = 0; i < f->seen_count; i++) {
        EXPECT_INT(f->tag_index[i], g->tag_index[i]);
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

static void test_results_do_not_depend_on_queue_length(void **state)
{
    (void)state;
    struct frontend_sweep s;
    struct mapper_options options = mapper_default_options();
    struct map_frontend *single, *many;
    struct map_frontend_result alone[IMAGES], result;
    film(&s);
    EXPECT_STATUS(map_frontend_open(&single, &s.map, &options), OK);
    EXPECT_STATUS(map_frontend_open(&many, &s.map, &options), OK);
    EXPECT_STATUS(map_frontend_take(many, &result), NOTHING);
    int tags = 0, features = 0, taken = 0, put_first = 0;
    for (int i = 0; i < IMAGES; i++) {
        put(&s, single, i);
        EXPECT_STATUS(map_frontend_take(single, &alone[i]), OK);
        EXPECT_INT(alone[i].number, 10 * i);
        tags += alone[i].observed.seen_count;
        features += alone[i].observed.feature_count;
    }
    EXPECT_AT_LEAST(tags, 5);
    EXPECT_AT_LEAST(features, 500);
    for (int i = 0; i < IMAGES; i++) {
        if (map_frontend_full(many)) {
            put_first = put_first ? put_first : i;
            EXPECT_STATUS(map_frontend_take(many, &result), OK);
            expect_same(&result, &alone[taken++]);
            map_frame_free(&result.observed);
        }
        put(&s, many, i);
    }
    EXPECT_AT_LEAST(put_first, 2);
    while (map_frontend_take(many, &result) == OK) {
        expect_same(&result, &alone[taken++]);
        map_frame_free(&result.observed);
    }
    EXPECT_INT(taken, IMAGES);
    put(&s, many, 0); // closed with images in it
    put(&s, many, 1);
    map_frontend_close(&many);
    map_frontend_close(&single);
    for (int i = 0; i < IMAGES; i++) {
        map_frame_free(&alone[i].observed);
        free(s.color[i]);
        free(s.depth[i]);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_results_do_not_depend_on_queue_length)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
