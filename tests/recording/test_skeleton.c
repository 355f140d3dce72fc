// Skeletons: covariances turn with the joints, and say what is seen, inferred and unknown.
#include "tests/support/test.h"

#include "recording/skeleton.h"

static void test_transform_turns_covariances(void **state)
{
    (void)state;
    // 5 cm along the camera's ray, 1 cm across; a quarter turn about x takes z to -y.
    struct skeleton s = {0};
    joint_set_covariance(&s, JOINT_HEAD, &(struct covariance3){.xx = 1e-4, .yy = 1e-4, .zz = 25e-4});
    s.joint[JOINT_HEAD] = v3(0, 0, 2);
    const struct pose a_from_b = {quat_from_rotation_vector(v3(1.5707963267948966, 0, 0)), v3(0, 0, 1)};
    const struct skeleton turned = skeleton_transform(a_from_b, &s);
    const struct covariance3 c = joint_covariance(&turned, JOINT_HEAD);
    EXPECT_NEAR(turned.joint[JOINT_HEAD].y, -2, 1e-12);
    EXPECT_NEAR(c.xx, 1e-4, 1e-7);
    EXPECT_NEAR(c.yy, 25e-4, 25e-7);
    EXPECT_NEAR(c.zz, 1e-4, 1e-7);
    EXPECT_NEAR(c.yz, 0, 1e-6);
    EXPECT_NEAR(joint_sigma_m(&turned, JOINT_HEAD), 0.03, 3e-5);
    EXPECT_TRUE(isnan(joint_sigma_m(&turned, JOINT_NECK))); // not known stays so
}

static void test_confidence(void **state)
{
    (void)state;
    EXPECT_NEAR((double)confidence_of(0.01, true), 1, 0);
    EXPECT_NEAR((double)confidence_of(0.01, false), 0.5, 0);
    EXPECT_NEAR((double)confidence_of(2 * SEEN_SIGMA_MAX_M, true), 0.5, 0);
    EXPECT_NEAR((double)confidence_of(1.01 * KNOWN_SIGMA_MAX_M, true), 0, 0);
    EXPECT_NEAR((double)confidence_of((double)NAN, true), 1, 0);
    EXPECT_NEAR((double)confidence_of((double)NAN, false), 0.5, 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_transform_turns_covariances),
        cmocka_unit_test(test_confidence),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
