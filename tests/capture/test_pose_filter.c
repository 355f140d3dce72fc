// The pose filter: jitter of a still body is removed, and a sudden start is not delayed.
#include "tests/support/test.h"

#include "capture/body/pose_filter.h"
#include "tests/support/random.h"

#define FRAME_S (1.0 / 30)

static struct body_pose standing(void) { return body_standing_pose(v3(0, 0, 2.5), v3(0, -1, 0), 0); }

// Each segment rotated and the root moved a little, as fits of one pose differ.
static struct body_pose jittered(const struct body_pose *pose, struct rng *rng, double sigma_m)
{
    struct body_pose out = *pose;
    out.root = v3_add(out.root, rng_normal3(rng, sigma_m));
    for (int s = 0; s < SEG_COUNT; s++)
        out.rotation[s] =
            quat_unit(quat_multiply(quat_from_rotation_vector(rng_normal3(rng, sigma_m)), out.rotation[s]));
    return out;
}

static void test_still_body_has_no_jitter(void **state)
{
    (void)state;
    const struct body_shape shape = {.log = {0}};
    struct body_pose pose = standing();
    struct rng rng = {7};
    struct pose_filter s;
    struct body_build before, now, fit_before, fit;
    double filtered = 0, fitted = 0;
    pose_filter_start(&s, &shape, &pose);
    for (int k = 0; k < 150; k++) {
        struct body_pose next = jittered(&pose, &rng, 0.005);
        pose_filter_update(&s, &shape, &next, FRAME_S);
        body_forward_kinematics(&shape, &s.pose, &now);
        body_forward_kinematics(&shape, &next, &fit);
        for (int j = 0; k >= 60 && j < JOINT_COUNT; j++) {
            filtered += v3_distance(now.joint[j], before.joint[j]) / (90 * JOINT_COUNT);
            fitted += v3_distance(fit.joint[j], fit_before.joint[j]) / (90 * JOINT_COUNT);
        }
        before = now;
        fit_before = fit;
    }
    print_message("a still body: %.2f mm from frame to frame, its fits %.2f\n", 1000 * filtered, 1000 * fitted);
    EXPECT_AT_MOST(filtered, 0.02 * fitted); // 0.014
}

// An arm that is raised suddenly, and a body that starts to move: the lag of the hand behind its fit, frame by frame.
static void test_sudden_start_has_no_lag(void **state)
{
    (void)state;
    const struct body_shape shape = {.log = {0}};
    struct rng rng = {8};
    for (int whole = 0; whole < 2; whole++) {
        struct body_pose pose = standing();
        struct pose_filter s;
        double behind[4], speed = 0;
        pose_filter_start(&s, &shape, &pose);
        for (int k = 0; k < 64; k++) {
            struct body_build filtered, fit, last;
            body_forward_kinematics(&shape, &pose, &last);
            if (k >= 60 && whole)
                pose.root.x += 1.0 * FRAME_S; // a metre a second
            else if (k >= 60)
                pose.rotation[SEG_LEFT_UPPER_ARM] =
                    quat_multiply(quat_from_rotation_vector(v3(0, 0, 4 * FRAME_S)), pose.rotation[SEG_LEFT_UPPER_ARM]);
            struct body_pose next = jittered(&pose, &rng, 0.003);
            pose_filter_update(&s, &shape, &next, FRAME_S);
            body_forward_kinematics(&shape, &s.pose, &filtered);
            body_forward_kinematics(&shape, &next, &fit);
            if (k < 60)
                continue;
            behind[k - 60] = v3_distance(filtered.joint[JOINT_LEFT_HAND], fit.joint[JOINT_LEFT_HAND]);
            body_forward_kinematics(&shape, &pose, &fit);
            speed = v3_distance(fit.joint[JOINT_LEFT_HAND], last.joint[JOINT_LEFT_HAND]) / FRAME_S;
        }
        print_message("%s at %.1f m/s: the hand lags %.0f, %.0f, %.0f, %.0f mm behind its fit\n",
                      whole ? "the body" : "an arm", speed, 1000 * behind[0], 1000 * behind[1], 1000 * behind[2],
                      1000 * behind[3]);
        EXPECT_AT_MOST(behind[2], 0.1 * speed * FRAME_S); // at most 0.07
        EXPECT_AT_MOST(behind[3], 0.1 * speed * FRAME_S);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_still_body_has_no_jitter),
        cmocka_unit_test(test_sudden_start_has_no_lag),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
