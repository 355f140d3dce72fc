// Covariances of points: what is stored is what was meant, semidefinite whatever was given, and turns with its axes.
#include "tests/support/test.h"

#include "base/linear_algebra.h"
#include "tests/support/random.h"

#include <stdio.h>

enum { SEED = 611, TRIALS = 20000 };

static struct vec3 random_direction(struct rng *rng) { return v3_unit(rng_normal3(rng, 1)); }

// Elongated by up to `ratio`, in any direction.
static struct covariance3 random_covariance(struct rng *rng, double sigma, double ratio)
{
    const struct quat turn = quat_from_rotation_vector(rng_normal3(rng, 2));
    const double a = sigma * sigma, b = a * rng_uniform(rng), c = a / (ratio * ratio);
    return covariance3_rotate(turn, &(struct covariance3){.xx = b, .yy = c, .zz = a});
}

static void expect_near(const struct covariance3 *got, const struct covariance3 *wanted, double rate)
{
    const double dx = sqrt(wanted->xx), dy = sqrt(wanted->yy), dz = sqrt(wanted->zz);
    EXPECT_NEAR(got->xx, wanted->xx, rate * dx * dx);
    EXPECT_NEAR(got->xy, wanted->xy, rate * dx * dy);
    EXPECT_NEAR(got->xz, wanted->xz, rate * dx * dz);
    EXPECT_NEAR(got->yy, wanted->yy, rate * dy * dy);
    EXPECT_NEAR(got->yz, wanted->yz, rate * dy * dz);
    EXPECT_NEAR(got->zz, wanted->zz, rate * dz * dz);
}

static void test_half_floats(void **state)
{
    (void)state;
    for (uint32_t bits = 0; bits < 0x10000; bits++)
        if ((bits & 0x7c00) != 0x7c00)
            EXPECT_INT(half_from_double(half_to_double((uint16_t)bits)), bits);
    EXPECT_NEAR(half_to_double(0x3c00), 1, 0);
    EXPECT_NEAR(half_to_double(0xc000), -2, 0);
    EXPECT_NEAR(half_to_double(0x7bff), 65504, 0);
    EXPECT_NEAR(half_to_double(0x0001), 0x1p-24, 0);
    EXPECT_INT(half_from_double(1e30), 0x7bff);
    EXPECT_INT(half_from_double(-65520), 0xfbff);
    EXPECT_INT(half_from_double(1 + 0x1p-11), 0x3c00); // ties to even
    EXPECT_INT(half_from_double(1 + 3 * 0x1p-11), 0x3c02);
    EXPECT_INT(half_from_double(0x1p-25), 0);
    EXPECT_INT(half_from_double(0x1.8p-25), 1);
}

static void test_pack_and_unpack(void **state)
{
    (void)state;
    struct rng rng = {SEED};
    for (int i = 0; i < TRIALS; i++) {
        const double sigma = rng_between(&rng, 0.002, 1), ratio = rng_between(&rng, 1, 25);
        const struct covariance3 c = random_covariance(&rng, sigma, ratio);
        const struct covariance_root root = covariance_pack(&c);
        const struct covariance3 got = covariance_unpack(root);
        EXPECT_TRUE(covariance_is_known(root) && covariance_is_finite(root));
        expect_near(&got, &c, 1.1e-3);
    }
}

static void test_what_is_stored_is_semidefinite(void **state)
{
    (void)state;
    struct rng rng = {SEED};
    for (int i = 0; i < TRIALS; i++) {
        // Of any ratio, and matrices that are no covariance at all.
        struct covariance3 c = random_covariance(&rng, 1, 1 + 1e4 * rng_uniform(&rng));
        if (i % 2)
            c.xy += rng_normal(&rng), c.zz += rng_normal(&rng);
        c = covariance_unpack(covariance_pack(&c));
        for (int k = 0; k < 5; k++)
            EXPECT_AT_LEAST(covariance3_along(&c, random_direction(&rng)), -1e-15 * covariance3_trace(&c));
    }
}

static void test_singular_covariances(void **state)
{
    (void)state;
    const struct covariance3 zero = {0}, line = covariance3_outer(v3(0.3, -0.2, 0.6)),
                             no_x = {.yy = 0.04, .yz = 0.01, .zz = 0.09};
    EXPECT_TRUE(!covariance_is_known(covariance_pack(&zero)));
    struct covariance3 got = covariance_unpack(covariance_pack(&line));
    expect_near(&got, &line, 1e-3);
    got = covariance_unpack(covariance_pack(&no_x));
    expect_near(&got, &no_x, 1e-3);
    EXPECT_TRUE(!covariance_is_finite((struct covariance_root){{0, 0, 0, 0x7e00, 0, 0}}));
}

static void test_turns_with_its_axes(void **state)
{
    (void)state;
    struct rng rng = {SEED};
    for (int i = 0; i < 100; i++) {
        const struct covariance3 c = random_covariance(&rng, 0.2, 10);
        const struct quat turn = quat_from_rotation_vector(rng_normal3(&rng, 2));
        const struct covariance3 turned = covariance3_rotate(turn, &c);
        const struct vec3 v = random_direction(&rng);
        EXPECT_NEAR(covariance3_along(&turned, quat_rotate(turn, v)), covariance3_along(&c, v), 1e-14);
        EXPECT_NEAR(covariance3_trace(&turned), covariance3_trace(&c), 1e-14);
    }
}

int main(void)
{
    printf("seed %d\n", SEED);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_half_floats),
        cmocka_unit_test(test_pack_and_unpack),
        cmocka_unit_test(test_what_is_stored_is_semidefinite),
        cmocka_unit_test(test_singular_covariances),
        cmocka_unit_test(test_turns_with_its_axes),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
