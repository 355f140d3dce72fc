// A camera tracked from image to image past printed tags, the true poses known.
#include "tests/support/test.h"

#include "locate/camera_tracker.h"
#include "locate/pose_fusion.h"
#include "tests/support/tag_picture.h"

#include <stdio.h>
#include <string.h>

enum { WIDTH = 640, HEIGHT = 480 };
static const double HZ = 30;

static uint8_t rgb[WIDTH * HEIGHT * 3];

static struct place_tag wall[4] = {
    {.id = 0, .side_m = 0.2, .world_from_tag = {{0, 0, 0, 1}, {-0.8, 0.3, 0}}},
    {.id = 1, .side_m = 0.2, .world_from_tag = {{0, 0, 0, 1}, {0.7, 0.4, 0}}},
    {.id = 2, .side_m = 0.2, .world_from_tag = {{0, 0, 0, 1}, {0.1, -0.6, 0}}},
    {.id = 3, .side_m = 0.2, .world_from_tag = {{0, 0.7071, 0, 0.7071}, {-1.2, 0, 0.8}}},
};
static const struct place room = {.tags = wall, .tag_count = 4};

// A walk sideways past the wall, facing it, the hand swinging.
static struct pose walk(double t)
{
    return tag_picture_view(2.5 + 0.1 * sin(2 * t), 0.35 * sin(0.9 * t), 0.05 * sin(5 * t), 0.03 * sin(4 * t));
}

static void draw(const struct place_tag *tags, int count, struct pose world_from_camera, uint64_t seed)
{
    struct tag_picture p = {.lens = tag_picture_lens(WIDTH, HEIGHT, 525),
                            .tags = tags,
                            .tag_count = count,
                            .noise = 2,
                            .seed = seed,
                            .rgb = rgb,
                            .world_from_camera = world_from_camera};
    EXPECT_TRUE(tag_picture_draw(&p));
}

static struct camera_tracker *open_tracker(const struct place *place, double most_sigma_m)
{
    struct lens lens = tag_picture_lens(WIDTH, HEIGHT, 525);
    struct locator_options options = locator_default_options();
    struct camera_tracker *t;
    options.max_position_sigma_m = most_sigma_m;
    EXPECT_STATUS(camera_tracker_open(&t, place, &lens, &options), OK);
    return t;
}

// At constant velocity.
static struct pose motion_after(const struct camera_motion *motion, double s)
{
    const struct pose by = {quat_from_rotation_vector(v3_scale(motion->angular_velocity, s)),
                            v3_scale(motion->linear_velocity, s)};
    return pose_multiply(motion->world_from_camera, by);
}

static void test_walk_is_tracked(void **state)
{
    (void)state;
    struct camera_tracker *tracker = open_tracker(&room, 0.05);
    struct vec3 before = {0, 0, 0};
    double worst_m = 0, jump_m = 0, predicted_m = 0, predicted_rad = 0;
    for (int i = 0; i < 20; i++) {
        double t = i / HZ;
        struct pose truth = walk(t);
        struct location at;
        struct camera_motion motion;
        draw(wall, 4, truth, 100 + (uint64_t)i);
        EXPECT_STATUS(camera_tracker_process(tracker, rgb, NULL, (int64_t)(t * 1e9), &at, &motion), OK);
        struct vec3 error = v3_sub(at.world_from_camera.translation, truth.translation);
        worst_m = fmax(worst_m, v3_length(error));
        jump_m = fmax(jump_m, i ? v3_distance(error, before) : 0);
        before = error;
        if (i > 5) { // predicted to when it is shown, an image later
            struct pose then = walk(t + 1 / HZ), predicted = motion_after(&motion, 1 / HZ);
            predicted_m = fmax(predicted_m, v3_distance(predicted.translation, then.translation));
            predicted_rad = fmax(predicted_rad, pose_angle(predicted, then));
        }
    }
    printf("a walk: worst %.2f mm, jumps up to %.2f mm; predicted by an image %.2f mm, %.3f degrees\n", worst_m * 1e3,
           jump_m * 1e3, predicted_m * 1e3, predicted_rad * 57.2958);
    EXPECT_AT_MOST(worst_m, 0.003);
    EXPECT_AT_MOST(jump_m, 0.003);
    EXPECT_AT_MOST(predicted_m, 0.007);
    EXPECT_AT_MOST(predicted_rad * 57.2958, 0.2);
    camera_tracker_close(&tracker);
    EXPECT_TRUE(tracker == NULL);
}

static void test_lost_and_relocalized(void **state)
{
    (void)state;
    struct camera_tracker *tracker = open_tracker(&room, 0.05);
    struct location at = {.rms_px = -1};
    struct camera_motion motion;
    memset(rgb, 90, sizeof rgb);
    EXPECT_STATUS(camera_tracker_process(tracker, rgb, NULL, 0, &at, &motion), NOTHING);
    EXPECT_NEAR(at.rms_px, -1, 0); // untouched
    draw(wall, 4, walk(0), 7);
    EXPECT_STATUS(camera_tracker_process(tracker, rgb, NULL, 33000000, &at, &motion), OK);
    EXPECT_STATUS(camera_tracker_process(tracker, rgb, NULL, 33000000, &at, &motion), ERR_ORDER);
    memset(rgb, 90, sizeof rgb);
    EXPECT_STATUS(camera_tracker_process(tracker, rgb, NULL, 66000000, &at, &motion), NOTHING);
    // Moved while nothing could be seen: the earlier poses must not pull it back.
    struct pose moved_pose = tag_picture_view(1.6, -0.3, 0.1, 0.3);
    draw(wall, 4, moved_pose, 8);
    EXPECT_STATUS(camera_tracker_process(tracker, rgb, NULL, 99000000, &at, &motion), OK);
    double off = v3_distance(at.world_from_camera.translation, moved_pose.translation);
    printf("moved while lost: localised within %.2f mm\n", off * 1e3);
    EXPECT_AT_MOST(off, 0.0005);
    camera_tracker_close(&tracker);
}

// A small tag seen nearly head-on looks the same mirrored. Five images must decide.
static void test_mirrored_poses_are_distinguished(void **state)
{
    (void)state;
    struct place_tag tag = {.id = 7, .side_m = 0.16, .world_from_tag = POSE_IDENTITY};
    const struct place place = {.tags = &tag, .tag_count = 1};
    int ambiguous = 0, wrong_first = 0, wrong = 0;
    for (int sequence = 0; sequence < 8; sequence++) {
        struct camera_tracker *tracker = open_tracker(&place, 2);
        for (int i = 0; i < 5; i++) {
            double t = i / HZ, yaw = 0.12 + 0.03 * sequence + 0.8 * t;
            struct pose truth = tag_picture_view(4 - 0.5 * t, yaw, -0.1 + 0.4 * t, 0);
            struct location at;
            struct camera_motion motion;
            draw(&tag, 1, truth, 900 + 10 * (uint64_t)sequence + (uint64_t)i);
            enum status status = camera_tracker_process(tracker, rgb, NULL, (int64_t)(t * 1e9), &at, &motion);
            EXPECT_TRUE(status == OK || status == AMBIGUOUS);
            bool flipped = pose_angle(at.world_from_camera, truth) > 15 / 57.3;
            ambiguous += i == 0 && status == AMBIGUOUS;
            wrong_first += i == 0 && flipped;
            wrong += i == 4 && flipped;
        }
        camera_tracker_close(&tracker);
    }
    printf("8 walks past one tag: at first %d ambiguous and %d mirrored, after five images %d mirrored\n", ambiguous,
           wrong_first, wrong);
    EXPECT_INT(wrong, 0);
}

// The filter's covariance must match its errors, and a step of the velocity must not leave a lag.
static void test_filtered_covariance_is_consistent(void **state)
{
    (void)state;
    struct rng rng = {3};
    const double rotation_sigma = 0.002, shift_sigma = 0.004;
    double covariance[36] = {0}, sum = 0, lag = 0, rough = 0, fine = 0;
    for (int i = 0; i < 6; i++)
        covariance[i * 7] = i < 3 ? rotation_sigma * rotation_sigma : shift_sigma * shift_sigma;
    struct pose_kalman k;
    int count = 0;
    for (int i = 0; i < 300; i++) {
        // at rest for five seconds, then at a metre a second
        struct pose truth = {{0, 0, 0, 1}, {i < 150 ? 0 : (i - 150) / HZ, 0, 0}};
        struct vec3 rotation = rng_normal3(&rng, rotation_sigma);
        struct pose noise = {quat_from_rotation_vector(rotation), rng_normal3(&rng, shift_sigma)};
        struct pose seen = pose_multiply(truth, noise);
        if (i)
            pose_kalman_predict(&k, 1 / HZ);
        if (i)
            EXPECT_TRUE(pose_kalman_update(&k, seen, covariance, 1e9) >= 0);
        else
            pose_kalman_start(&k, seen, covariance);
        double error[3] = {k.world_from_camera.translation.x - truth.translation.x, k.world_from_camera.translation.y,
                           k.world_from_camera.translation.z};
        if (i >= 20 && i < 150) {
            for (int a = 0; a < 3; a++)
                sum += error[a] * error[a] / k.covariance[3 + a][3 + a];
            fine += error[1] * error[1];
            rough += seen.translation.y * seen.translation.y;
            count += 3;
        }
        if (i >= 180)
            lag += error[0] / 120;
    }
    printf("at rest: errors %.2f sigma, jitter %.2f of the measured; at 1 m/s: a lag of %.2f mm\n", sqrt(sum / count),
           sqrt(fine / rough), -lag * 1e3);
    EXPECT_AT_MOST(sqrt(sum / count), 1.2);
    EXPECT_AT_MOST(sqrt(fine / rough), 0.9);
    EXPECT_NEAR(lag, 0, 0.0005);
    struct pose_kalman before = k;
    EXPECT_TRUE(pose_kalman_update(&k, (struct pose){{0, 0, 0, 1}, {50, 0, 0}}, covariance, 43) > 43);
    EXPECT_INT(memcmp(&before, &k, sizeof k), 0); // far off changes nothing
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_walk_is_tracked),
        cmocka_unit_test(test_lost_and_relocalized),
        cmocka_unit_test(test_mirrored_poses_are_distinguished),
        cmocka_unit_test(test_filtered_covariance_is_consistent),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
