// The pose of the recording sensor: a stand that yields by centimetres is detected; a person who moves in front of the
// sensor is not mistaken for that.
#include "tests/support/test.h"

#include "capture/sensor_pose.h"
#include "tests/support/film.h"
#include "tests/world/world.h"

#include <stdio.h>
#include <stdlib.h>

enum { FRAMES = 76, PUSHED_AT = 40, SELDOM = 15, SOON = 5 };

static struct world *world;
static struct place place;
static struct pose world_from_place;

static int enter(void **state)
{
    (void)state;
    place = film_mapped_place(&world, 24, &world_from_place);
    world_close(&world); // the one without a person
    struct world_options options = world_default_options();
    options.threads = 2;
    EXPECT_STATUS(world_open(&world, &options), OK);
    return 0;
}

static int leave(void **state)
{
    (void)state;
    place_free(&place);
    world_close(&world);
    return 0;
}

struct stand_outcome {
    int moves, far_moves;
    double off_m, detected_at; // at the end; the frame at which the move was detected
};

// Films the actor with a sensor that is pushed once.
static struct stand_outcome film(struct vec3 push, double yaw)
{
    struct calibration c = world_calibration(1);
    size_t pixels = (size_t)c.color.width * (size_t)c.color.height;
    uint8_t *color = malloc(pixels * 3);
    uint16_t *depth = malloc(pixels * sizeof *depth);
    struct sensor_pose *s;
    struct pose stand = world_sensor_pose(world), pushed = stand, at;
    struct stand_outcome o = {.detected_at = -1};
    pushed.translation = v3_add(pushed.translation, push);
    pushed.rotation = quat_multiply(pushed.rotation, quat_from_rotation_vector(v3(0, yaw, 0)));
    EXPECT_TRUE(color && depth);
    EXPECT_STATUS(sensor_pose_open(&s, &place, &c), OK);
    for (int i = 0; i < FRAMES; i++) {
        struct world_shot shot = {c.color, i < PUSHED_AT ? stand : pushed, i / 30.0, true};
        // the other frames are not used
        bool used = i < SENSOR_POSE_WARM_UP || i % (i > PUSHED_AT && v3_length(push) > 0 ? SOON : SELDOM) == 0;
        if (used) {
            EXPECT_STATUS(world_render(world, &shot, &(struct world_image){.color = color, .depth = depth}), OK);
            world_color_noise(color, c.color.width, c.color.height, (uint64_t)i);
            EXPECT_STATUS(world_depth_noise(&c.depth, depth, (uint64_t)i, depth), OK);
        }
        EXPECT_STATUS(sensor_pose_update(s, used ? color : NULL, used ? depth : NULL), OK);
        if (sensor_pose_moves(s) && o.detected_at < 0)
            o.detected_at = i;
    }
    EXPECT_TRUE(sensor_pose_get(s, &at));
    o.moves = sensor_pose_moves(s);
    o.far_moves = sensor_pose_far_moves(s);
    o.off_m = v3_distance(pose_apply(world_from_place, at.translation), pushed.translation);
    printf("pushed by %.0f mm: moved %d times, %d far, detected at frame %.0f, in the end %.1f mm off\n",
           v3_length(push) * 1e3, o.moves, o.far_moves, o.detected_at, o.off_m * 1e3);
    sensor_pose_close(&s);
    free(color);
    free(depth);
    return o;
}

static void test_undisturbed_stand(void **state)
{
    (void)state;
    struct stand_outcome o = film(v3(0, 0, 0), 0);
    EXPECT_INT(o.moves, 0);
    EXPECT_AT_MOST(o.off_m, 0.01);
}

static void test_sagging_stand(void **state)
{
    (void)state;
    struct stand_outcome o = film(v3(0.03, 0.015, 0.01), 0.004);
    EXPECT_INT(o.moves, 1);
    EXPECT_INT(o.far_moves, 0);
    EXPECT_AT_MOST(o.detected_at, PUSHED_AT + 25);
    EXPECT_AT_MOST(o.off_m, 0.01);
}

static void test_moved_stand(void **state)
{
    (void)state;
    struct stand_outcome o = film(v3(0.3, 0, 0), 0.05);
    EXPECT_INT(o.moves, 1);
    EXPECT_INT(o.far_moves, 1);
    EXPECT_AT_MOST(o.off_m, 0.01);
}

// A colour camera that starts later than its depth: located with its first image, not half a second after it.
static void test_color_that_starts_late(void **state)
{
    (void)state;
    enum { STARTS = 17, END = 20 };
    const struct calibration c = world_calibration(1);
    uint8_t *color = malloc(3 * lens_pixels(&c.color));
    uint16_t *depth = malloc(lens_pixels(&c.depth) * sizeof *depth);
    struct sensor_pose *s;
    struct pose at;
    int first = -1;
    const struct world_shot shot = {c.color, world_sensor_pose(world), 0, true};
    EXPECT_TRUE(color && depth);
    EXPECT_STATUS(sensor_pose_open(&s, &place, &c), OK);
    EXPECT_STATUS(world_render(world, &shot, &(struct world_image){.color = color, .depth = depth}), OK);
    for (int i = 0; i < END; i++) {
        EXPECT_STATUS(sensor_pose_update(s, i < STARTS ? NULL : color, depth), OK);
        first = first < 0 && sensor_pose_get(s, &at) ? i : first;
    }
    EXPECT_INT(first, STARTS);
    EXPECT_INT(sensor_pose_moves(s), 0);
    sensor_pose_close(&s);
    free(color);
    free(depth);
}

// The place's tags are seen in the mirror alone: that is why the sensor is not located. Not said of a sensor that is,
// nor of one that sees no tag.
static void test_mirrored_pictures_are_noticed(void **state)
{
    (void)state;
    enum { UPDATES = 3 };
    const struct calibration c = world_calibration(1);
    const int width = c.color.width;
    const size_t pixels = lens_pixels(&c.color);
    uint8_t *color = malloc(3 * pixels), *shown = malloc(3 * pixels);
    struct place tags = film_true_place(world, 1);
    const struct world_shot shot = {c.color, world_sensor_pose(world), 0, true};
    EXPECT_TRUE(color && shown);
    EXPECT_STATUS(world_render(world, &shot, &(struct world_image){.color = color}), OK);
    for (int how = 0; how < 3; how++) {
        struct sensor_pose *s;
        struct sensor_sight sight;
        struct pose at;
        for (size_t k = 0; k < pixels; k++)
            for (size_t i = 0; i < 3; i++) {
                const size_t x = k % (size_t)width, from = how == 1 ? k - x + (size_t)width - 1 - x : k;
                shown[3 * k + i] = how == 2 ? 128 : color[3 * from + i];
            }
        EXPECT_STATUS(sensor_pose_open(&s, &tags, &c), OK);
        for (int i = 0; i < UPDATES; i++)
            EXPECT_STATUS(sensor_pose_update(s, shown, NULL), OK);
        sensor_pose_get_sight(s, &sight);
        printf("%s: located %d, mirrored %d\n",
               how == 0   ? "as it is"
               : how == 1 ? "mirrored"
                          : "blank",
               sensor_pose_get(s, &at), sight.mirrored);
        EXPECT_INT(sensor_pose_get(s, &at), how == 0);
        EXPECT_INT(sight.mirrored, how == 1);
        sensor_pose_close(&s);
    }
    place_free(&tags);
    free(color);
    free(shown);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_undisturbed_stand),
        cmocka_unit_test(test_sagging_stand),
        cmocka_unit_test(test_moved_stand),
        cmocka_unit_test(test_color_that_starts_late),
        cmocka_unit_test(test_mirrored_pictures_are_noticed),
    };
    return cmocka_run_group_tests(tests, enter, leave);
}
