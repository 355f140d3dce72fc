// Skirts and coats: a hem is detected where there is one, and the legs that it hides are in the right place.
#include "tests/support/test.h"

#include "capture/body/hem_detector.h"
#include "tests/support/tracked_film.h"

#include <string.h>

// The hem estimate from ten frames of a motion, filmed from `nearer_m` in front of the sensor's place.
static struct hem_estimate learn_hem(const char *figure, const char *motion, double height_m, double nearer_m,
                                     double *waist_m, double *knee_m)
{
    struct tracked_film f;
    struct depth_evidence *e;
    struct hem_estimate estimate = {0};
    tracked_film_open(&f, figure, motion);
    struct pose from = moved(world_sensor_pose(f.world), v3(0, 0, nearer_m));
    struct vec3 up = quat_rotate(quat_conjugate(from.rotation), v3(0, 0, 1));
    struct fit_task task = {.have_floor = true, .up = up, .floor_m = from.translation.z};
    assert_int_equal(evidence_open(&e, &f.calibration.depth), OK);
    task.evidence = e;
    for (int k = 0; k < 10; k++) {
        struct hem hem;
        double t = 0.1 * k;
        tracked_film_shoot(&f, from, t, (uint64_t)k);
        for (size_t i = 0; i < f.pixels; i++)
            f.mask[i] = f.truth_mask[i] ? 255 : 0;
        assert_true(evidence_read(e, f.depth, f.mask, 600));
        struct skeleton truth = world_joints(f.world, t);
        *waist_m = truth.joint[JOINT_WAIST].z;
        *knee_m = truth.joint[JOINT_LEFT_KNEE].z;
        if (hem_detect(&task, height_m, &hem))
            hem_update(&estimate, &hem, *waist_m);
    }
    evidence_close(&e);
    tracked_film_close(&f);
    return estimate;
}

static void test_hem_is_detected(void **state)
{
    (void)state;
    static const struct {
        const char *figure, *motion;
        double height_m, nearer_m; // 1.3 m nearer, no feet are visible
        bool hem;
    } who[] = {
        {"skirt", "pirouette", 1.65, 0, true},  {"coat", "kata", 1.78, 0, true},
        {"woman", "pirouette", 1.70, 0, false}, {"heavy", "kata", 1.75, 0, false},
        {"tall", "bend", 1.95, 0, false},       {"child", "walk", 1.25, 0, false},
        {"skirt", "still", 1.65, 1.3, true},    {"man", "still", 1.82, 1.3, false},
        {"heavy", "kata", 1.75, 1.3, false},
    };
    for (size_t i = 0; i < COUNT_OF(who); i++) {
        double waist_m, knee_m;
        struct hem_estimate b =
            learn_hem(who[i].figure, who[i].motion, who[i].height_m, who[i].nearer_m, &waist_m, &knee_m);
        print_message("%s, %s, %g m nearer: %d frames, %.2f m below the waist (the knee %.2f), %.2f m wide, narrower "
                      "by %.2f\n",
                      who[i].figure, who[i].motion, who[i].nearer_m, b.count, b.below_m, waist_m - knee_m, b.wide_m,
                      b.narrow);
        EXPECT_INT(hem_is_worn(b.narrow, b.wide_m, who[i].height_m, false), who[i].hem);
        if (!who[i].hem)
            continue;
        EXPECT_AT_MOST(b.below_m, waist_m - knee_m + 0.02); // both hems end above the knee
        EXPECT_AT_LEAST(b.below_m, waist_m - knee_m - 0.14);
    }
}

static void test_legs_under_skirt(void **state)
{
    (void)state;
    static const enum joint low[] = {JOINT_LEFT_HIP,  JOINT_LEFT_KNEE,  JOINT_LEFT_FOOT,
                                     JOINT_RIGHT_HIP, JOINT_RIGHT_KNEE, JOINT_RIGHT_FOOT};
    static const char *const who[] = {"skirt", "coat"};
    for (size_t w = 0; w < COUNT_OF(who); w++) {
        struct tracked_film f;
        double sum = 0;
        int count = 0, crossed = 0;
        tracked_film_open(&f, who[w], "pirouette");
        struct pose from = world_sensor_pose(f.world);
        for (int k = 0; k < 50; k++) {
            double t = k / 20.0;
            struct skeleton got, truth = world_joints_in_camera(f.world, t, from);
            tracked_film_shoot(&f, from, t, 900 + (uint64_t)k);
            EXPECT_INT(tracker_next(f.tracker, nanoseconds(t), f.depth, &got, NULL), OK);
            for (size_t i = 0; i < COUNT_OF(low); i++, count++)
                sum += v3_distance(got.joint[low[i]], truth.joint[low[i]]);
            crossed += got.joint[JOINT_LEFT_FOOT].x < got.joint[JOINT_RIGHT_FOOT].x;
        }
        print_message("%s: hips, knees and feet %.4f m off, feet crossed in %d frames\n", who[w], sum / count, crossed);
        EXPECT_AT_MOST(sum / count, 0.032);
        EXPECT_INT(crossed, 0);
        tracked_film_close(&f);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_hem_is_detected),
        cmocka_unit_test(test_legs_under_skirt),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
