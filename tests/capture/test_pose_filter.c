// What is told of a pose: a trembling fit of a still body is calmed, and a sudden start is not delayed.
#include "tests/support/test.h"

#include "capture/body/pose_filter.h"
#include "tests/support/random.h"

#define FRAME_S (1.0 / 30)

static struct body_pose standing(void) { return body_rest_pose(v3(0, 0, 2.5), v3(0, -1, 0), 0); }

// Each segment turned and the root moved a little, as fits of one pose differ.
static struct body_pose trembling(const struct body_pose *pose, struct dice *dice, double sigma_m)
{
    struct body_pose out = *pose;
    out.root = v3_add(out.root, dice_normal3(dice, sigma_m));
    for (int s = 0; s < SEG_COUNT; s++)
        out.turn[s] = quat_unit(quat_multiply(quat_from_rotation_vector(dice_normal3(dice, sigma_m)), out.turn[s]));
    return out;
}

static void a_still_body_is_told_still(void **state)
{
    (void)state;
    const struct body_shape shape = {.log = {0}};
    struct body_pose pose = standing();
    struct dice dice = {7};
    struct body_steady s;
    struct body_build before, now, fit_before, fit;
    double told = 0, fitted = 0;
    body_steady_start(&s, &shape, &pose);
    for (int k = 0; k < 150; k++) {
        struct body_pose next = trembling(&pose, &dice, 0.005);
        body_steady_next(&s, &shape, &next, FRAME_S);
        body_build(&shape, &s.pose, &now);
        body_build(&shape, &next, &fit);
        for (int j = 0; k >= 60 && j < JOINT_COUNT; j++) {
            told += v3_distance(now.joint[j], before.joint[j]) / (90 * JOINT_COUNT);
            fitted += v3_distance(fit.joint[j], fit_before.joint[j]) / (90 * JOINT_COUNT);
        }
        before = now;
        fit_before = fit;
    }
    print_message("a still body: %.2f mm from frame to frame, its fits %.2f\n", 1000 * told, 1000 * fitted);
    EXPECT_AT_MOST(told, 0.05 * fitted);
}

// An arm that is raised at once, and a body that sets off: how far behind the fit the hand is told, frame by frame.
static void a_sudden_start_is_told_at_once(void **state)
{
    (void)state;
    const struct body_shape shape = {.log = {0}};
    struct dice dice = {8};
    for (int whole = 0; whole < 2; whole++) {
        struct body_pose pose = standing();
        struct body_steady s;
        double behind[4], speed = 0;
        body_steady_start(&s, &shape, &pose);
        for (int k = 0; k < 64; k++) {
            struct body_build told, fit, last;
            body_build(&shape, &pose, &last);
            if (k >= 60 && whole)
                pose.root.x += 1.0 * FRAME_S; // a metre a second
            else if (k >= 60)
                pose.turn[SEG_LEFT_UPPER_ARM] =
                    quat_multiply(quat_from_rotation_vector(v3(0, 0, 4 * FRAME_S)), pose.turn[SEG_LEFT_UPPER_ARM]);
            struct body_pose next = trembling(&pose, &dice, 0.003);
            body_steady_next(&s, &shape, &next, FRAME_S);
            body_build(&shape, &s.pose, &told);
            body_build(&shape, &next, &fit);
            if (k < 60)
                continue;
            behind[k - 60] = v3_distance(told.joint[JOINT_LEFT_HAND], fit.joint[JOINT_LEFT_HAND]);
            body_build(&shape, &pose, &fit);
            speed = v3_distance(fit.joint[JOINT_LEFT_HAND], last.joint[JOINT_LEFT_HAND]) / FRAME_S;
        }
        print_message("%s at %.1f m/s: the hand is told %.0f, %.0f, %.0f, %.0f mm behind its fit\n",
                      whole ? "the body" : "an arm", speed, 1000 * behind[0], 1000 * behind[1], 1000 * behind[2],
                      1000 * behind[3]);
        EXPECT_AT_MOST(behind[2], 0.2 * speed * FRAME_S);
        EXPECT_AT_MOST(behind[3], 0.2 * speed * FRAME_S);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_still_body_is_told_still),
        cmocka_unit_test(a_sudden_start_is_told_at_once),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
