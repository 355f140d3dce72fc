// Rotations, rigid motions and lenses, where they are ill-conditioned.
#include "tests/support/test.h"

#include "base/lens.h"

static void expect_near(struct vec3 a, struct vec3 b, double within)
{
    EXPECT_NEAR(a.x, b.x, within);
    EXPECT_NEAR(a.y, b.y, within);
    EXPECT_NEAR(a.z, b.z, within);
}

static void test_rotation_vector_and_back(void **state)
{
    (void)state;
    const double angles[] = {0, 1e-12, 1e-7, 1e-4, 0.1, 1, 3, 3.14159265, 3.1415926535897};
    for (size_t i = 0; i < COUNT_OF(angles); i++) {
        struct vec3 r = v3_scale(v3_unit(v3(0.3, -0.8, 0.5)), angles[i]);
        expect_near(quat_to_rotation_vector(quat_from_rotation_vector(r)), r, 1e-9);
    }
}

static void test_matrix_and_back_for_half_rotations(void **state)
{
    (void)state;
    const struct vec3 axes[] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {0.6, -0.8, 0}, {0.5, 0.5, -0.7071}};
    for (size_t i = 0; i < COUNT_OF(axes); i++) {
        struct quat q = quat_from_rotation_vector(v3_scale(v3_unit(axes[i]), 3.14159265358979));
        double m[3][3];
        quat_to_matrix(q, m);
        struct vec3 p = v3(0.2, -1.3, 2.2);
        expect_near(quat_rotate(quat_from_matrix(m), p), quat_rotate(q, p), 1e-12);
    }
}

static void test_matrices_that_are_no_rotation(void **state)
{
    (void)state;
    double turned[3][3];
    quat_to_matrix(quat_from_rotation_vector(v3(1, -2, 0.5)), turned);
    EXPECT_TRUE(matrix_is_rotation(turned, 1e-12));
    double bad[][3][3] = {{{0, 1, 0}, {1, 0, 0}, {0, 0, 1}},    // a mirror image
                          {{-1, 0, 0}, {0, -1, 0}, {0, 0, -1}}, // the same
                          {{2, 0, 0}, {0, 0.5, 0}, {0, 0, 1}},  // the volume is kept, lengths are not
                          {{1, 1e-2, 0}, {0, 1, 0}, {0, 0, 1}},  {{NAN, 0, 0}, {0, 1, 0}, {0, 0, 1}},
                          {{1e300, 0, 0}, {0, 1, 0}, {0, 0, 1}}, {{0}}};
    for (size_t i = 0; i < COUNT_OF(bad); i++)
        EXPECT_TRUE(!matrix_is_rotation(bad[i], 1e-3));
    EXPECT_TRUE(matrix_is_rotation(bad[3], 2e-2));
}

static void test_quat_between_opposite_and_zero(void **state)
{
    (void)state;
    expect_near(quat_rotate(quat_between(v3(0, 0, 2), v3(0, 0, -3)), v3(0, 0, 1)), v3(0, 0, -1), 1e-12);
    expect_near(quat_rotate(quat_between(v3(1, 2, 3), v3(-2, 0, 1)), v3_unit(v3(1, 2, 3))), v3_unit(v3(-2, 0, 1)),
                1e-12);
    expect_near(quat_rotate(quat_between(v3(0, 0, 0), v3(1, 0, 0)), v3(0, 1, 0)), v3(0, 1, 0), 0);
}

static void test_pose_inverse_far_from_origin(void **state)
{
    (void)state;
    struct pose a = {quat_from_rotation_vector(v3(0.4, -2, 0.3)), v3(1e4, -3e4, 2e4)};
    struct vec3 p = v3(0.3, -0.7, 1.9);
    expect_near(pose_apply(pose_inverse(a), pose_apply(a, p)), p, 1e-10);
    expect_near(pose_apply(pose_multiply(a, pose_inverse(a)), p), p, 1e-10);
}

static void test_lens_undistorts(void **state)
{
    (void)state;
    struct lens lens = {640, 480, 545, 545.5, 322.5, 238, -0.05, 0.015, 0.0005, -0.0004, 0.001, 0, 0};
    for (int y = 0; y < 480; y += 37)
        for (int x = 0; x < 640; x += 41) {
            struct pixel back = lens_project(&lens, v3_scale(lens_ray(&lens, (struct pixel){x, y}), 3.7));
            EXPECT_NEAR(back.x, x, 1e-7);
            EXPECT_NEAR(back.y, y, 1e-7);
        }
}

static void test_lens_check_refuses_invalid(void **state)
{
    (void)state;
    struct lens good = {640, 480, 525, 525, 319.5, 239.5, 0, 0, 0, 0, 0, 0, 0};
    EXPECT_STATUS(lens_check(&good, "color"), OK);
    struct lens bad = good;
    bad.fx = 0;
    EXPECT_STATUS(lens_check(&bad, "color"), ERR_INPUT);
    bad = good;
    bad.cy = NAN;
    EXPECT_STATUS(lens_check(&bad, "color"), ERR_INPUT);
    bad = good;
    bad.height = 0;
    EXPECT_STATUS(lens_check(&bad, "color"), ERR_INPUT);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_rotation_vector_and_back),      cmocka_unit_test(test_matrix_and_back_for_half_rotations),
        cmocka_unit_test(test_matrices_that_are_no_rotation), cmocka_unit_test(test_quat_between_opposite_and_zero),
        cmocka_unit_test(test_pose_inverse_far_from_origin),  cmocka_unit_test(test_lens_undistorts),
        cmocka_unit_test(test_lens_check_refuses_invalid),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
