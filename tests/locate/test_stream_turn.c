// Depth that is mirrored or upside down against colour is named, and no film of the right way round is.
//
// The thresholds were chosen on six other films. Of 19 that were left out, which are these six, eight more of the world
// and five real or public ones (dance: two, tum-rpy, turning-person, kitchen), none is blamed as it is, none named
// wrongly, and 17 are named when mirrored. What is not noticed: a person in the middle of a bare room, who looks alike
// from both sides; and kitchen, whose depth does not lie well on its colour. That colour may be what is turned, where
// depth has a camera of its own, was added after the two such films here had been looked at.
#include "tests/support/test.h"

#include "locate/stream_turn.h"
#include "tests/world/world.h"

#include <stdio.h>
#include <string.h>

enum { IMAGES = 4 };

static const struct film {
    const char *figure, *motion;
    struct world_stand stand; // eye all 0: the usual one
    bool bare, apart;         // apart: depth has a camera of its own, 5 cm beside colour's
    bool depth;               // is what is turned; else colour
    uint64_t seed;
} films[] = {
    {"man", "exercise", .seed = 101},
    {"skirt", "kata", {{-1.2, -2.9, 1.4}, {0.1, 0, 0.9}, 0.03}, .seed = 102},
    {"child", "walk", .bare = true, .seed = 103},
    {"heavy", "pirouette", {{0.4, -2.4, 2.2}, {0, 0, 0.8}, 0}, .seed = 104},
    {"tall", "bend", .apart = true, .seed = 105},
    {"coat", "raise-hand", {{1.4, -2.3, 0.7}, {0, 0.1, 1.1}, -0.05}, .apart = true, .depth = true, .seed = 106},
};

struct pair {
    struct calibration calibration;
    bool turns_depth;
    uint8_t *color[IMAGES], *turned_color;
    uint16_t *depth[IMAGES], *turned_depth;
};

static void shoot(const struct film *film, struct pair *p)
{
    struct world_options o = world_default_options();
    struct world *world;
    o.motion = film->motion;
    o.bare = film->bare;
    o.seed = film->seed;
    o.unshadowed = true;
    o.threads = 2;
    if (film->stand.eye.z > 0)
        o.stand = film->stand;
    EXPECT_TRUE(world_figure_named(film->figure, &o.figure));
    EXPECT_STATUS(world_open(&world, &o), OK);
    p->calibration = world_calibration(0.5);
    p->calibration.registered = !film->apart;
    p->calibration.color_from_depth.translation.x = film->apart ? 0.05 : 0;
    const struct lens *lens = &p->calibration.color;
    const size_t pixels = lens_pixels(lens);
    const struct pose color = world_sensor_pose(world), depth = pose_multiply(color, p->calibration.color_from_depth);
    p->turns_depth = film->depth;
    p->turned_color = malloc(pixels * 3);
    p->turned_depth = malloc(pixels * sizeof *p->turned_depth);
    for (int i = 0; i < IMAGES; i++) {
        const double time_s = world_seconds(world) * (i + 0.5) / IMAGES;
        p->color[i] = malloc(pixels * 3);
        p->depth[i] = malloc(pixels * sizeof *p->depth[i]);
        const struct world_shot seen = {*lens, color, time_s, true}, measured = {*lens, depth, time_s, true};
        EXPECT_STATUS(world_render(world, &seen, &(struct world_image){.color = p->color[i], .depth = p->depth[i]}),
                      OK);
        if (film->apart)
            EXPECT_STATUS(world_render(world, &measured, &(struct world_image){.depth = p->depth[i]}), OK);
        world_color_noise(p->color[i], lens->width, lens->height, film->seed + (uint64_t)i);
        EXPECT_STATUS(world_depth_noise(lens, p->depth[i], film->seed + (uint64_t)i, p->depth[i]), OK);
    }
    world_close(&world);
}

static void pair_free(struct pair *p)
{
    for (int i = 0; i < IMAGES; i++) {
        free(p->color[i]);
        free(p->depth[i]);
    }
    free(p->turned_color);
    free(p->turned_depth);
}

static enum depth_turn judge(const struct pair *p, enum depth_turn turn, struct stream_turn *seen)
{
    const int w = p->calibration.color.width, h = p->calibration.color.height;
    memset(seen, 0, sizeof *seen);
    for (int i = 0; i < IMAGES; i++) {
        for (int y = 0; y < h; y++)
            for (int x = 0; x < w; x++) {
                const int u = turn == DEPTH_MIRRORED || turn == DEPTH_TURNED ? w - 1 - x : x,
                          v = turn == DEPTH_FLIPPED || turn == DEPTH_TURNED ? h - 1 - y : y;
                memcpy(p->turned_color + 3 * (y * w + x), p->color[i] + 3 * (v * w + u), 3);
                p->turned_depth[y * w + x] = p->depth[i][v * w + u];
            }
        EXPECT_STATUS(stream_turn_add(seen, &p->calibration, p->turns_depth ? p->color[i] : p->turned_color,
                                      p->turns_depth ? p->turned_depth : p->depth[i]),
                      OK);
    }
    return stream_turn_judge(seen);
}

static void test_turned_streams_are_named(void **state)
{
    (void)state;
    int named = 0, looked = 0;
    for (size_t i = 0; i < COUNT_OF(films); i += SANITIZED ? 3 : 1) {
        struct pair p;
        shoot(&films[i], &p);
        for (enum depth_turn turn = DEPTH_STRAIGHT; turn < DEPTH_TURNS; turn++) {
            struct stream_turn s;
            const enum depth_turn found = judge(&p, turn, &s);
            printf("%-6s %-10s %-24s: %s, rank %.3f, as it is %.3f, %d images\n", films[i].figure, films[i].motion,
                   depth_turn_text(turn), depth_turn_text(found),
                   s.rank[p.turns_depth ? STREAM_DEPTH : STREAM_COLOR][turn] / s.images,
                   s.rank[0][DEPTH_STRAIGHT] / s.images, s.images);
            EXPECT_TRUE(found == turn || found == DEPTH_STRAIGHT);
            named += turn != DEPTH_STRAIGHT && found == turn;
            looked += turn != DEPTH_STRAIGHT;
        }
        pair_free(&p);
    }
    printf("%d of %d named\n", named, looked);
    EXPECT_AT_LEAST(named, looked - 1);
}

// Noise instead of colour, and depth without a step, tell nothing.
static void test_nothing_is_told_of_nothing(void **state)
{
    (void)state;
    struct pair p;
    struct stream_turn s = {.images = 0};
    shoot(&films[0], &p);
    const size_t pixels = lens_pixels(&p.calibration.color);
    for (int i = 0; i < IMAGES; i++) {
        memset(p.color[i], 128, pixels * 3);
        world_color_noise(p.color[i], p.calibration.color.width, p.calibration.color.height, (uint64_t)i);
    }
    for (enum depth_turn turn = DEPTH_STRAIGHT; turn < DEPTH_TURNS; turn++)
        EXPECT_INT(judge(&p, turn, &s), DEPTH_STRAIGHT);
    printf("noise: ranks %.3f %.3f %.3f %.3f\n", s.rank[0][0] / s.images, s.rank[0][1] / s.images,
           s.rank[0][2] / s.images, s.rank[0][3] / s.images);
    EXPECT_NEAR(s.rank[0][DEPTH_MIRRORED] / s.images, 0.5, 0.05);
    for (size_t k = 0; k < pixels; k++)
        p.depth[0][k] = 3000;
    s = (struct stream_turn){.images = 0};
    EXPECT_STATUS(stream_turn_add(&s, &p.calibration, p.color[0], p.depth[0]), OK);
    EXPECT_INT(s.images, 0);
    EXPECT_INT(stream_turn_judge(&s), DEPTH_STRAIGHT);
    pair_free(&p);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_turned_streams_are_named),
        cmocka_unit_test(test_nothing_is_told_of_nothing),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
