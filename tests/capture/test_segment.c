// Segmentation of the person against a rendered mask, and what must not be taken for a person.
#include "tests/support/test.h"

#include "capture/segmentation/segment.h"
#include "tests/world/world.h"

#include <string.h>

enum { WIDTH = 320, HEIGHT = 240 };

struct segment_scene {
    struct world *world;
    struct lens lens;
    struct segmenter *segmenter;
    uint16_t depth[WIDTH * HEIGHT];
    uint8_t truth[WIDTH * HEIGHT], mask[WIDTH * HEIGHT];
};

static int open_scene(void **state)
{
    struct segment_scene *s = calloc(1, sizeof *s);
    assert_non_null(s);
    struct world_options options = world_default_options();
    options.plain = true;
    EXPECT_STATUS(world_open(&s->world, &options), OK);
    s->lens = world_calibration(0.5).depth;
    EXPECT_INT(s->lens.width, WIDTH);
    EXPECT_INT(s->lens.height, HEIGHT);
    EXPECT_STATUS(segmenter_open(&s->segmenter, &s->lens), OK);
    *state = s;
    return 0;
}

static int close_scene(void **state)
{
    struct segment_scene *s = *state;
    segmenter_close(&s->segmenter);
    world_close(&s->world);
    free(s);
    return 0;
}

static void film(struct segment_scene *s, double time_s, bool actor, uint64_t seed)
{
    struct world_shot shot = {s->lens, world_sensor_pose(s->world), time_s, actor};
    struct world_image image = {.depth = s->depth, .mask = s->truth};
    EXPECT_STATUS(world_render(s->world, &shot, &image), OK);
    EXPECT_STATUS(world_depth_noise(&s->lens, s->depth, seed, s->depth), OK);
}

// Intersection over union with the truth, over pixels that have depth.
static double overlap(const struct segment_scene *s)
{
    int both = 0, either = 0;
    for (int i = 0; i < WIDTH * HEIGHT; i++) {
        bool is = s->mask[i] != 0, should = s->truth[i] && s->depth[i];
        both += is && should;
        either += is || should;
    }
    return either ? (double)both / either : 1;
}

static void test_mask_matches_person(void **state)
{
    struct segment_scene *s = *state;
    double sum = 0, worst = 1;
    int frames = 0;
    for (double t = 0; t < world_seconds(s->world); t += 0.5, frames++) {
        film(s, t, true, 100 + (uint64_t)frames);
        EXPECT_STATUS(segmenter_next(s->segmenter, s->depth, NULL, 0, s->mask), OK);
        segmenter_update_background(s->segmenter);
        sum += overlap(s);
        worst = fmin(worst, overlap(s));
    }
    print_message("intersection over union: mean %.3f, worst frame %.3f\n", sum / frames, worst);
    EXPECT_AT_LEAST(worst, 0.88);
    EXPECT_AT_LEAST(sum / frames, 0.925);
}

static void test_check_detects_wrong_mask(void **state)
{
    struct segment_scene *s = *state;
    film(s, 0, true, 1);
    EXPECT_STATUS(segmenter_next(s->segmenter, s->depth, NULL, 0, s->mask), OK);
    for (int y = 0; y < HEIGHT; y++) // 12 pixels to the side
        memmove(s->mask + y * WIDTH, s->mask + y * WIDTH + 12, WIDTH - 12);
    EXPECT_AT_MOST(overlap(s), 0.7);
}

// What stands in front of the floor may be a person: one after the other is offered, none twice, and then nothing.
static void test_candidates_end(void **state)
{
    enum { MOST = 40 };
    static uint8_t offered[WIDTH * HEIGHT];
    struct segment_scene *s = *state;
    for (int person = 0; person < 2; person++) {
        int count = 0;
        memset(offered, 0, sizeof offered);
        segmenter_reset(s->segmenter);
        film(s, 0, person, 3);
        enum status status = segmenter_next(s->segmenter, s->depth, NULL, 0, s->mask);
        for (; status == OK && count < MOST; count++) {
            int cells = 0, twice = 0;
            for (int i = 0; i < WIDTH * HEIGHT; i++) {
                cells += s->mask[i] != 0;
                twice += s->mask[i] && offered[i];
                offered[i] |= s->mask[i];
            }
            EXPECT_AT_LEAST(cells, 1);
            EXPECT_AT_MOST(twice, cells / 20); // where one is finer than the grid
            status = segmenter_next_candidate(s->segmenter, s->depth, s->mask);
        }
        EXPECT_STATUS(status, NOTHING);
        for (int i = 0; i < WIDTH * HEIGHT; i++)
            EXPECT_INT(s->mask[i], 0);
        print_message("%d candidates in a room with%s a person\n", count, person ? "" : "out");
        EXPECT_AT_LEAST(count, person);
        EXPECT_AT_MOST(count, MOST - 1);
    }
}

static void test_floor_plane_is_accurate(void **state)
{
    struct segment_scene *s = *state;
    film(s, 0, true, 4);
    EXPECT_STATUS(segmenter_next(s->segmenter, s->depth, NULL, 0, s->mask), OK);
    struct vec3 up;
    double height_m;
    EXPECT_TRUE(segmenter_floor(s->segmenter, &up, &height_m));
    struct pose world_from_camera = world_sensor_pose(s->world);
    struct vec3 want = quat_rotate(quat_conjugate(world_from_camera.rotation), v3(0, 0, 1));
    print_message("floor: %.4f rad and %.4f m off\n", acos(fmin(1, v3_dot(up, want))),
                  height_m - world_from_camera.translation.z);
    EXPECT_NEAR(acos(fmin(1, v3_dot(up, want))), 0, 0.003);
    EXPECT_NEAR(height_m, world_from_camera.translation.z, 0.006);
}

static void test_known_background_is_used(void **state)
{
    struct segment_scene *s = *state;
    film(s, 0, false, 9);
    segmenter_set_background(s->segmenter, s->depth);
    film(s, 1, true, 10);
    EXPECT_STATUS(segmenter_next(s->segmenter, s->depth, NULL, 0, s->mask), OK);
    print_message("with a known background: intersection over union %.3f\n", overlap(s));
    EXPECT_AT_LEAST(overlap(s), 0.915);
    // The room in front of its own background: no person.
    segmenter_drop_person(s->segmenter);
    film(s, 1, false, 11);
    EXPECT_STATUS(segmenter_next(s->segmenter, s->depth, NULL, 0, s->mask), NOTHING);
}

static void test_recovers_after_black_image(void **state)
{
    struct segment_scene *s = *state;
    static const uint16_t black[WIDTH * HEIGHT];
    EXPECT_STATUS(segmenter_next(s->segmenter, black, NULL, 0, s->mask), NOTHING);
    film(s, 0, true, 2);
    EXPECT_STATUS(segmenter_next(s->segmenter, s->depth, NULL, 0, s->mask), OK);
    EXPECT_STATUS(segmenter_next(s->segmenter, black, NULL, 0, s->mask), NOTHING);
    EXPECT_STATUS(segmenter_next(s->segmenter, s->depth, NULL, 0, s->mask), OK);
    EXPECT_AT_LEAST(overlap(s), 0.85);
}

static void test_flat_wall_is_no_person(void **state)
{
    struct segment_scene *s = *state;
    for (int distance = 500; distance <= 65535; distance = distance * 3 / 2) {
        segmenter_reset(s->segmenter);
        for (int i = 0; i < WIDTH * HEIGHT; i++)
            s->depth[i] = (uint16_t)distance;
        EXPECT_STATUS(segmenter_next(s->segmenter, s->depth, NULL, 0, s->mask), NOTHING);
    }
}

static void test_any_image_size(void **state)
{
    (void)state;
    static const int size[][2] = {{1, 1}, {2, 1}, {1, 3}, {7, 5}, {33, 2}, {641, 3}};
    struct rng rng = {20};
    print_message("seed 20\n");
    for (size_t k = 0; k < COUNT_OF(size); k++) {
        struct lens lens = {.width = size[k][0], .height = size[k][1], .fx = 5, .fy = 5, .cx = 1, .cy = 1};
        struct segmenter *s;
        EXPECT_STATUS(segmenter_open(&s, &lens), OK);
        size_t n = (size_t)lens.width * (size_t)lens.height;
        uint16_t *depth = calloc(n, sizeof *depth);
        uint8_t *mask = calloc(n, 1);
        assert_non_null(depth);
        assert_non_null(mask);
        for (int frame = 0; frame < 8; frame++) {
            for (size_t i = 0; i < n; i++)
                depth[i] = rng_uniform(&rng) < 0.2 ? 0 : (uint16_t)(65535 * rng_uniform(&rng));
            EXPECT_TRUE(segmenter_next(s, depth, NULL, 0, mask) >= 0);
            segmenter_update_background(s);
        }
        free(depth);
        free(mask);
        segmenter_close(&s);
    }
}

// Motion detection works at the lower end of a slit-shaped image too.
static void test_very_tall_image(void **state)
{
    (void)state;
    enum { WIDE = 40, HIGH = 6000, TOP = 5600, TALL = 300 };
    struct lens lens = {.width = WIDE, .height = HIGH, .fx = 500, .fy = 500, .cx = 0.5 * WIDE, .cy = TOP + 0.5 * TALL};
    struct segmenter *s;
    EXPECT_STATUS(segmenter_open(&s, &lens), OK);
    uint16_t *depth = calloc((size_t)WIDE * HIGH, sizeof *depth);
    uint8_t *mask = calloc((size_t)WIDE * HIGH, 1);
    assert_non_null(depth);
    assert_non_null(mask);
    for (int y = TOP; y < TOP + TALL; y++)
        for (int x = 5; x < WIDE - 5; x++)
            depth[y * WIDE + x] = 2000; // 0.12 m by 1.2
    for (int frame = 0; frame < 20; frame++) {
        EXPECT_STATUS(segmenter_next(s, depth, NULL, 0, mask), OK);
        segmenter_update_background(s);
    }
    EXPECT_AT_LEAST(segmenter_static_frames(s), 12);
    free(depth);
    free(mask);
    segmenter_close(&s);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(test_mask_matches_person, open_scene, close_scene),
        cmocka_unit_test_setup_teardown(test_check_detects_wrong_mask, open_scene, close_scene),
        cmocka_unit_test_setup_teardown(test_candidates_end, open_scene, close_scene),
        cmocka_unit_test_setup_teardown(test_floor_plane_is_accurate, open_scene, close_scene),
        cmocka_unit_test_setup_teardown(test_known_background_is_used, open_scene, close_scene),
        cmocka_unit_test_setup_teardown(test_recovers_after_black_image, open_scene, close_scene),
        cmocka_unit_test_setup_teardown(test_flat_wall_is_no_person, open_scene, close_scene),
        cmocka_unit_test(test_any_image_size),
        cmocka_unit_test(test_very_tall_image),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
