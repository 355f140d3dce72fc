// Finding the person's pixels, against a rendered mask, and what must not be
// taken for a person.
#include "tests/support/test.h"
#include "tests/world/world.h"

#include "capture/segmentation/segment.h"

#include <string.h>

enum { WIDTH = 320, HEIGHT = 240 };

struct scene {
    struct world *world;
    struct lens lens;
    struct segmenter *segmenter;
    uint16_t depth[WIDTH * HEIGHT];
    uint8_t truth[WIDTH * HEIGHT], mask[WIDTH * HEIGHT];
};

static int open_scene(void **state)
{
    struct scene *s = calloc(1, sizeof *s);
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
    struct scene *s = *state;
    segmenter_close(&s->segmenter);
    world_close(&s->world);
    free(s);
    return 0;
}

static void film(struct scene *s, double time_s, bool actor, uint64_t seed)
{
    struct world_shot shot = {s->lens, world_sensor_pose(s->world), time_s, actor};
    struct world_picture picture = {.depth = s->depth, .mask = s->truth};
    EXPECT_STATUS(world_render(s->world, &shot, &picture), OK);
    EXPECT_STATUS(world_depth_noise(&s->lens, s->depth, seed, s->depth), OK);
}

// Pixels without a reading can belong to nobody.
static double overlap(const struct scene *s)
{
    int both = 0, either = 0;
    for (int i = 0; i < WIDTH * HEIGHT; i++) {
        bool is = s->mask[i] != 0, should = s->truth[i] && s->depth[i];
        both += is && should;
        either += is || should;
    }
    return either ? (double)both / either : 1;
}

static void the_mask_is_the_persons(void **state)
{
    struct scene *s = *state;
    double sum = 0;
    int frames = 0;
    for (double t = 0; t < world_seconds(s->world); t += 0.5, frames++) {
        film(s, t, true, 100 + (uint64_t)frames);
        EXPECT_STATUS(segmenter_next(s->segmenter, s->depth, NULL, 0, s->mask), OK);
        segmenter_learn(s->segmenter);
        sum += overlap(s);
        EXPECT_AT_LEAST(overlap(s), 0.80);
    }
    EXPECT_AT_LEAST(sum / frames, 0.89);
}

static void the_check_sees_a_wrong_mask(void **state)
{
    struct scene *s = *state;
    film(s, 0, true, 1);
    EXPECT_STATUS(segmenter_next(s->segmenter, s->depth, NULL, 0, s->mask), OK);
    for (int y = 0; y < HEIGHT; y++) // 12 pixels to the side
        memmove(s->mask + y * WIDTH, s->mask + y * WIDTH + 12, WIDTH - 12);
    EXPECT_AT_MOST(overlap(s), 0.7);
}

static void an_empty_room_holds_nobody(void **state)
{
    struct scene *s = *state;
    for (uint64_t seed = 0; seed < 3; seed++) {
        film(s, 0, false, seed);
        EXPECT_STATUS(segmenter_next(s->segmenter, s->depth, NULL, 0, s->mask), NOTHING);
        for (int i = 0; i < WIDTH * HEIGHT; i++)
            EXPECT_INT(s->mask[i], 0);
    }
}

static void the_floor_is_found_where_it_is(void **state)
{
    struct scene *s = *state;
    film(s, 0, true, 4);
    EXPECT_STATUS(segmenter_next(s->segmenter, s->depth, NULL, 0, s->mask), OK);
    struct vec3 up;
    double height_m;
    EXPECT_TRUE(segmenter_floor(s->segmenter, &up, &height_m));
    struct pose world_from_camera = world_sensor_pose(s->world);
    struct vec3 want = quat_rotate(quat_conjugate(world_from_camera.rotation), v3(0, 0, 1));
    EXPECT_NEAR(acos(fmin(1, v3_dot(up, want))), 0, 0.01);
    EXPECT_NEAR(height_m, world_from_camera.translation.z, 0.02);
}

static void a_known_room_helps(void **state)
{
    struct scene *s = *state;
    film(s, 0, false, 9);
    segmenter_set_background(s->segmenter, s->depth);
    film(s, 1, true, 10);
    EXPECT_STATUS(segmenter_next(s->segmenter, s->depth, NULL, 0, s->mask), OK);
    EXPECT_AT_LEAST(overlap(s), 0.88);
    // The room itself in front of its own background: nobody.
    segmenter_forget_person(s->segmenter);
    film(s, 1, false, 11);
    EXPECT_STATUS(segmenter_next(s->segmenter, s->depth, NULL, 0, s->mask), NOTHING);
}

static void a_black_picture_is_nothing_and_the_next_one_is_fine(void **state)
{
    struct scene *s = *state;
    static const uint16_t black[WIDTH * HEIGHT];
    EXPECT_STATUS(segmenter_next(s->segmenter, black, NULL, 0, s->mask), NOTHING);
    film(s, 0, true, 2);
    EXPECT_STATUS(segmenter_next(s->segmenter, s->depth, NULL, 0, s->mask), OK);
    EXPECT_STATUS(segmenter_next(s->segmenter, black, NULL, 0, s->mask), NOTHING);
    EXPECT_STATUS(segmenter_next(s->segmenter, s->depth, NULL, 0, s->mask), OK);
    EXPECT_AT_LEAST(overlap(s), 0.85);
}

static void a_flat_wall_is_nobody(void **state)
{
    struct scene *s = *state;
    for (int distance = 500; distance <= 65535; distance = distance * 3 / 2) {
        segmenter_reset(s->segmenter);
        for (int i = 0; i < WIDTH * HEIGHT; i++)
            s->depth[i] = (uint16_t)distance;
        EXPECT_STATUS(segmenter_next(s->segmenter, s->depth, NULL, 0, s->mask), NOTHING);
    }
}

static void pictures_of_any_size_do_no_harm(void **state)
{
    (void)state;
    static const int size[][2] = {{1, 1}, {2, 1}, {1, 3}, {7, 5}, {33, 2}, {641, 3}};
    struct dice dice = {20};
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
                depth[i] = dice_uniform(&dice) < 0.2 ? 0 : (uint16_t)(65535 * dice_uniform(&dice));
            EXPECT_TRUE(segmenter_next(s, depth, NULL, 0, mask) >= 0);
            segmenter_learn(s);
        }
        free(depth);
        free(mask);
        segmenter_close(&s);
    }
}

// Through a slit: what stands at its lower end is watched like anybody.
static void a_picture_much_higher_than_wide_does_no_harm(void **state)
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
        segmenter_learn(s);
    }
    EXPECT_AT_LEAST(segmenter_motionless(s), 12);
    free(depth);
    free(mask);
    segmenter_close(&s);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(the_mask_is_the_persons, open_scene, close_scene),
        cmocka_unit_test_setup_teardown(the_check_sees_a_wrong_mask, open_scene, close_scene),
        cmocka_unit_test_setup_teardown(an_empty_room_holds_nobody, open_scene, close_scene),
        cmocka_unit_test_setup_teardown(the_floor_is_found_where_it_is, open_scene, close_scene),
        cmocka_unit_test_setup_teardown(a_known_room_helps, open_scene, close_scene),
        cmocka_unit_test_setup_teardown(a_black_picture_is_nothing_and_the_next_one_is_fine, open_scene, close_scene),
        cmocka_unit_test_setup_teardown(a_flat_wall_is_nobody, open_scene, close_scene),
        cmocka_unit_test(pictures_of_any_size_do_no_harm),
        cmocka_unit_test(a_picture_much_higher_than_wide_does_no_harm),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
