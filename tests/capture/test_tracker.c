// The tracker's joints against the small world's truth, and with difficult input.
#include "tests/support/test.h"

#include "capture/body/solid_distance.h"
#include "tests/support/tracked_film.h"

#include <stdio.h>
#include <string.h>

static void film(struct tracked_film *s, double time_s, uint64_t seed)
{
    tracked_film_shoot(s, world_sensor_pose(s->world), time_s, seed);
}

// No joint is NaN, far outside any room, or of an undefined confidence or covariance.
static void expect_sane(const struct skeleton *s)
{
    for (int j = 0; j < JOINT_COUNT; j++) {
        EXPECT_TRUE(v3_finite(s->joint[j]));
        EXPECT_AT_MOST(v3_length(s->joint[j]), 30);
        float c = s->confidence[j];
        EXPECT_TRUE(c == 0 || c == 0.5f || c == 1);
        EXPECT_TRUE(covariance_is_finite(s->covariance[j]));
        if (c > 0) {
            EXPECT_AT_LEAST(joint_sigma_m(s, (enum joint)j), 1e-3);
            EXPECT_AT_MOST(joint_sigma_m(s, (enum joint)j), c == 1 ? SEEN_SIGMA_MAX_M : KNOWN_SIGMA_MAX_M);
        }
    }
}

struct score {
    double mean_m, within_10cm, iou, jump_m;
    int frames, nothing, swapped;
};

// Left and right exchanged: the joints fit the exchanged truth far better.
static bool is_swapped(const struct skeleton *s, const struct skeleton *truth)
{
    static const enum joint pair[3][2] = {{JOINT_LEFT_KNEE, JOINT_RIGHT_KNEE},
                                          {JOINT_LEFT_FOOT, JOINT_RIGHT_FOOT},
                                          {JOINT_LEFT_SHOULDER, JOINT_RIGHT_SHOULDER}};
    double keep = 0, cross = 0;
    for (int k = 0; k < 3; k++)
        for (int i = 0; i < 2; i++) {
            keep += v3_distance(s->joint[pair[k][i]], truth->joint[pair[k][i]]);
            cross += v3_distance(s->joint[pair[k][i]], truth->joint[pair[k][1 - i]]);
        }
    return cross < 0.7 * keep;
}

static struct score run(struct tracked_film *s, double fps, double until_s, bool mirrored)
{
    struct score score = {0};
    struct skeleton last = {0};
    double sum = 0, good = 0, iou = 0;
    int k = 0;
    for (double t = 0; t < fmin(until_s, world_seconds(s->world)); t += 1 / fps, k++) {
        film(s, t, 500 + (uint64_t)k);
        struct skeleton got, truth = world_joints_in_camera(s->world, t, world_sensor_pose(s->world));
        score.frames++;
        if (tracker_next(s->tracker, nanoseconds(t), s->depth, &got, s->mask) != OK) {
            score.nothing++;
            continue;
        }
        expect_sane(&got);
        if (mirrored)
            for (int j = 0; j < JOINT_COUNT; j++) {
                const char *name = joint_name((enum joint)j);
                char other[32];
                enum joint mirrored_joint;
                if (strncmp(name, "left_", 5) == 0) {
                    snprintf(other, sizeof other, "right_%s", name + 5);
                    assert_true(joint_from_name(other, &mirrored_joint));
                    struct vec3 p = truth.joint[j];
                    truth.joint[j] = truth.joint[mirrored_joint];
                    truth.joint[mirrored_joint] = p;
                }
            }
        for (int j = 0; j < JOINT_COUNT; j++) {
            double e = v3_distance(got.joint[j], truth.joint[j]);
            sum += e;
            good += e < 0.1 && got.confidence[j] > 0;
            if (k > score.nothing)
                score.jump_m = fmax(score.jump_m, v3_distance(got.joint[j], last.joint[j]));
        }
        last = got;
        score.swapped += is_swapped(&got, &truth);
        int both = 0, either = 0;
        for (size_t i = 0; i < s->pixels; i++) {
            bool is = s->mask[i] != 0, should = s->truth_mask[i] && s->depth[i];
            both += is && should;
            either += is || should;
        }
        iou += (double)both / either;
    }
    int seen = score.frames - score.nothing;
    score.mean_m = sum / (JOINT_COUNT * fmax(seen, 1));
    score.within_10cm = good / (JOINT_COUNT * score.frames);
    score.iou = iou / fmax(seen, 1);
    print_message("mean %.4f m, within 10 cm %.3f, iou %.3f, swapped %d, nothing %d, largest step %.2f m, %d frames\n",
                  score.mean_m, score.within_10cm, score.iou, score.swapped, score.nothing, score.jump_m, score.frames);
    return score;
}

static void test_full_rotation_keeps_left_and_right(void **state)
{
    (void)state;
    struct tracked_film s;
    tracked_film_open(&s, "woman", "pirouette");
    struct score score = run(&s, 20, 100, false);
    EXPECT_INT(score.nothing, 0);
    EXPECT_INT(score.swapped, 0);
    EXPECT_AT_MOST(score.mean_m, 0.03);
    EXPECT_AT_LEAST(score.within_10cm, 0.98);
    EXPECT_AT_LEAST(score.iou, 0.92);
    tracked_film_close(&s);
}

static void test_check_detects_swapped_sides(void **state)
{
    (void)state;
    struct tracked_film s;
    tracked_film_open(&s, "man", "pirouette");
    struct score score = run(&s, 10, 1, true);
    EXPECT_INT(score.swapped, score.frames);
    EXPECT_AT_LEAST(score.mean_m, 0.1);
    tracked_film_close(&s);
}

static void test_other_people_are_tracked(void **state)
{
    (void)state;
    static const char *const who[] = {"heavy", "child", "tall"};
    for (size_t k = 0; k < COUNT_OF(who); k++) {
        struct tracked_film s;
        tracked_film_open(&s, who[k], "kata");
        struct score score = run(&s, 30, 1.2, false);
        EXPECT_INT(score.swapped, 0);
        EXPECT_AT_MOST(score.mean_m, 0.038);
        EXPECT_AT_LEAST(score.within_10cm, 0.98);
        EXPECT_AT_MOST(score.jump_m, 0.13);
        tracked_film_close(&s);
    }
}

static void test_bone_lengths_are_constant(void **state)
{
    (void)state;
    struct tracked_film s;
    tracked_film_open(&s, "man", "walk");
    double low[PART_COUNT], high[PART_COUNT];
    for (int k = 0; k < 40; k++) {
        film(&s, k / 30.0, 60 + (uint64_t)k);
        struct skeleton got;
        EXPECT_STATUS(tracker_next(s.tracker, nanoseconds(k / 30.0), s.depth, &got, NULL), OK);
        for (int p = 0; p < PART_COUNT; p++) {
            double length = v3_distance(got.joint[part_ends[p].from], got.joint[part_ends[p].to]);
            low[p] = k == 0 ? length : fmin(low[p], length);
            high[p] = k == 0 ? length : fmax(high[p], length);
        }
    }
    double most = 0;
    for (int p = 0; p < PART_COUNT; p++)
        most = fmax(most, high[p] / low[p]);
    print_message("bone lengths, longest to shortest: at most %.3f\n", most);
    EXPECT_AT_MOST(most, 1.05); // they are still being learned
    tracked_film_close(&s);
}

static void test_deterministic(void **state)
{
    (void)state;
    struct tracked_film s;
    tracked_film_open(&s, "woman", "kata");
    struct skeleton first[8];
    for (int run_index = 0; run_index < 3; run_index++) {
        if (run_index == 1) { // a new tracker; then the same one after a reset
            tracker_close(&s.tracker);
            EXPECT_STATUS(tracker_open(&s.tracker, &s.calibration, NULL), OK);
        } else if (run_index == 2) {
            tracker_reset(s.tracker);
        }
        for (int k = 0; k < 8; k++) {
            struct skeleton got;
            film(&s, 1 + k / 30.0, 7 + (uint64_t)k);
            EXPECT_STATUS(tracker_next(s.tracker, nanoseconds(1 + k / 30.0), s.depth, &got, NULL), OK);
            if (run_index == 0)
                first[k] = got;
            for (int j = 0; j < JOINT_COUNT; j++)
                EXPECT_NEAR(v3_distance(got.joint[j], first[k].joint[j]), 0, 0);
        }
    }
    tracked_film_close(&s);
}

static double mean_error(const struct skeleton *a, const struct skeleton *b)
{
    double sum = 0;
    for (int j = 0; j < JOINT_COUNT; j++)
        sum += v3_distance(a->joint[j], b->joint[j]) / JOINT_COUNT;
    return sum;
}

static void test_black_repeated_and_backward_frames(void **state)
{
    (void)state;
    struct tracked_film s;
    tracked_film_open(&s, "woman", "pirouette");
    uint16_t *black = calloc(s.pixels, sizeof *black);
    assert_non_null(black);
    struct skeleton got, truth;
    EXPECT_STATUS(tracker_next(s.tracker, 0, black, &got, s.mask), NOTHING); // no person yet
    double worst = 0, worst_again = 0;
    for (int k = 1; k < 30; k++) {
        double t = k / 30.0;
        film(&s, t, (uint64_t)k);
        truth = world_joints_in_camera(s.world, t, world_sensor_pose(s.world));
        if (k == 10) {
            EXPECT_STATUS(tracker_next(s.tracker, nanoseconds(t), black, &got, s.mask), NOTHING);
            for (int j = 0; j < JOINT_COUNT; j++)
                EXPECT_TRUE(got.confidence[j] == 0);
            continue;
        }
        int64_t when = k == 20 ? nanoseconds(0.1) : nanoseconds(t); // the clock jumps back once
        EXPECT_STATUS(tracker_next(s.tracker, when, s.depth, &got, s.mask), OK);
        expect_sane(&got);
        worst = fmax(worst, mean_error(&got, &truth));
        if (k == 15) { // the same frame at the same time again
            struct skeleton again;
            EXPECT_STATUS(tracker_next(s.tracker, when, s.depth, &again, s.mask), OK);
            worst_again = mean_error(&again, &got);
        }
    }
    print_message("worst frame %.4f m off; the same frame again differs by %.4f m\n", worst, worst_again);
    EXPECT_AT_MOST(worst, 0.045);
    EXPECT_AT_MOST(worst_again, 0.025);
    free(black);
    tracked_film_close(&s);
}

static void test_close_far_and_partly_outside_image(void **state)
{
    (void)state;
    struct tracked_film s;
    tracked_film_open(&s, "man", "still");
    struct pose stand = world_sensor_pose(s.world);
    struct skeleton truth = world_joints_in_camera(s.world, 0, stand);
    double z = truth.joint[JOINT_TORSO].z;
    static const struct {
        double distance_m, lateral_m, bound_m;
    } at[] = {{0.9, 0, 0.065}, {4.5, 0, 0.055}, {2.5, 1.5, 0.055}};
    for (size_t k = 0; k < COUNT_OF(at); k++) {
        tracker_reset(s.tracker);
        struct pose from = moved(stand, v3(truth.joint[JOINT_TORSO].x - at[k].lateral_m, 0, z - at[k].distance_m));
        struct skeleton want = world_joints_in_camera(s.world, 0, from), got;
        enum status status = NOTHING;
        for (int frame = 0; frame < 6; frame++) {
            tracked_film_shoot(&s, from, 0, 40 + (uint64_t)frame);
            status = tracker_next(s.tracker, frame * 33333333LL, s.depth, &got, s.mask);
            EXPECT_TRUE(status >= 0);
            expect_sane(&got);
        }
        EXPECT_STATUS(status, OK);
        double error = 0;
        for (enum joint j = JOINT_HEAD; j <= JOINT_TORSO; j++)
            if (j == JOINT_HEAD || j == JOINT_NECK || j == JOINT_TORSO)
                error = fmax(error, v3_distance(got.joint[j], want.joint[j]));
        print_message("at %.1f m, %.2f m to the side: head, neck and torso within %.3f m\n", at[k].distance_m,
                      at[k].lateral_m, error);
        EXPECT_AT_MOST(error, at[k].bound_m);
        if (k == 0) // what the image's lower edge crops was never visible
            for (int side = 0; side < 2; side++)
                EXPECT_TRUE(got.confidence[side ? JOINT_LEFT_FOOT : JOINT_RIGHT_FOOT] == 0);
    }
    tracked_film_close(&s);
}

static void test_one_of_two_people_is_tracked(void **state)
{
    (void)state;
    struct tracked_film s, other;
    tracked_film_open(&s, "woman", "still");
    tracked_film_open(&other, "man", "still");
    double worst = 0;
    for (int k = 0; k < 6; k++) {
        tracked_film_shoot(&other, moved(world_sensor_pose(s.world), v3(1.1, 0, -0.3)), 0, 90 + (uint64_t)k);
        film(&s, 0, 30 + (uint64_t)k);
        for (size_t i = 0; i < s.pixels; i++)
            if (other.truth_mask[i] && other.depth[i] && (!s.depth[i] || other.depth[i] < s.depth[i]))
                s.depth[i] = other.depth[i];
        struct skeleton got,
            one = world_joints_in_camera(s.world, 0, world_sensor_pose(s.world)),
            two = world_joints_in_camera(other.world, 0, moved(world_sensor_pose(s.world), v3(1.1, 0, -0.3)));
        EXPECT_STATUS(tracker_next(s.tracker, k * 33333333LL, s.depth, &got, s.mask), OK);
        expect_sane(&got);
        worst = fmax(worst, fmin(mean_error(&got, &one), mean_error(&got, &two)));
    }
    print_message("two people: worst frame %.4f m off\n", worst);
    EXPECT_AT_MOST(worst, 0.032);
    tracked_film_close(&s);
    tracked_film_close(&other);
}

static void test_tiny_images_and_noise(void **state)
{
    (void)state;
    static const int size[][2] = {{1, 1}, {16, 12}, {40, 30}};
    struct rng rng = {77};
    print_message("seed 77\n");
    for (size_t k = 0; k < COUNT_OF(size); k++) {
        struct calibration c = {.registered = true, .color_from_depth = POSE_IDENTITY};
        c.depth = c.color = (struct lens){.width = size[k][0],
                                          .height = size[k][1],
                                          .fx = size[k][0],
                                          .fy = size[k][0],
                                          .cx = size[k][0] / 2.0,
                                          .cy = size[k][1] / 2.0};
        struct tracker *t;
        EXPECT_STATUS(tracker_open(&t, &c, NULL), OK);
        uint16_t depth[40 * 30] = {0};
        uint8_t mask[40 * 30];
        for (int frame = 0; frame < 6; frame++) {
            for (int y = 0; y < size[k][1]; y++) // a post of noise, as wide as a person
                for (int x = 0; x < size[k][0]; x++)
                    depth[y * size[k][0] + x] = abs(2 * x - size[k][0]) < size[k][0] / 4 && rng_uniform(&rng) < 0.9
                                                    ? (uint16_t)(2000 + 60 * rng_normal(&rng))
                                                    : 0;
            struct skeleton got;
            EXPECT_TRUE(tracker_next(t, frame * 33333333LL, depth, &got, mask) >= 0);
            expect_sane(&got);
        }
        tracker_close(&t);
    }
}

static void test_zero_length_and_straight_limbs(void **state)
{
    (void)state;
    // No length at all: from a to a.
    struct body_solid nothing = {.a = {0, 0, 2}, .b = {0, 0, 2}, .radius_a = 0.05, .radius_b = 0.05};
    struct vec3 normal;
    EXPECT_NEAR(solid_distance(&nothing, v3(0, 0, 1.9), NULL), 0.05, 1e-9);
    EXPECT_TRUE(isfinite(solid_distance(&nothing, v3(0, 0, 2), &normal)) && v3_finite(normal));
    // A body shrunk to a millimetre and one with arms as straight as can be still build.
    struct body_shape shape = {.log = {-7}};
    struct body_pose pose = body_standing_pose(v3(0, 0, 2), v3(0, -1, 0), 0);
    struct body_build build;
    body_forward_kinematics(&shape, &pose, &build);
    for (int j = 0; j < JOINT_COUNT; j++)
        EXPECT_TRUE(v3_finite(build.joint[j]));
    shape.log[0] = 0;
    body_forward_kinematics(&shape, &pose, &build);
    struct vec3 upper = v3_sub(build.joint[JOINT_LEFT_ELBOW], build.joint[JOINT_LEFT_SHOULDER]),
                lower = v3_sub(build.joint[JOINT_LEFT_HAND], build.joint[JOINT_LEFT_ELBOW]);
    EXPECT_NEAR(v3_length(v3_cross(v3_unit(upper), v3_unit(lower))), 0, 1e-12);
    // Facing the camera, the person's left is on the image's right.
    EXPECT_AT_LEAST(build.joint[JOINT_LEFT_HAND].x, 0.1);
    EXPECT_AT_MOST(build.joint[JOINT_RIGHT_HAND].x, -0.1);
    EXPECT_AT_LEAST(build.joint[JOINT_LEFT_FOOT].y, build.joint[JOINT_LEFT_HIP].y + 0.7);
}

static void test_bad_options_are_refused(void **state)
{
    (void)state;
    struct calibration c = world_calibration(0.5);
    struct tracker *t = (struct tracker *)&c;
    struct tracker_options options = tracker_default_options();
    options.points = 0;
    EXPECT_STATUS(tracker_open(&t, &c, &options), ERR_INPUT);
    assert_null(t);
    options = tracker_default_options();
    options.learn_s = -1;
    EXPECT_STATUS(tracker_open(&t, &c, &options), ERR_INPUT);
    c.depth.width = 0;
    EXPECT_STATUS(tracker_open(&t, &c, NULL), ERR_INPUT);
    tracker_close(&t);
    assert_null(t);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_full_rotation_keeps_left_and_right),
        cmocka_unit_test(test_check_detects_swapped_sides),
        cmocka_unit_test(test_other_people_are_tracked),
        cmocka_unit_test(test_bone_lengths_are_constant),
        cmocka_unit_test(test_deterministic),
        cmocka_unit_test(test_black_repeated_and_backward_frames),
        cmocka_unit_test(test_close_far_and_partly_outside_image),
        cmocka_unit_test(test_one_of_two_people_is_tracked),
        cmocka_unit_test(test_tiny_images_and_noise),
        cmocka_unit_test(test_zero_length_and_straight_limbs),
        cmocka_unit_test(test_bad_options_are_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
