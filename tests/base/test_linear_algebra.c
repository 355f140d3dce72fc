// Dense symmetric solvers on random positive definite systems, and what they refuse.
#include "tests/support/test.h"

#include "base/linear_algebra.h"

enum { N = 12 };

// A = M M' + identity, about as well conditioned as normal equations with priors.
static void random_system(struct rng *rng, int n, double *a, double *x, double *b)
{
    double m[N * N];
    for (int i = 0; i < n * n; i++)
        m[i] = rng_between(rng, -1, 1);
    for (int i = 0; i < n; i++) {
        x[i] = rng_between(rng, -1, 1);
        for (int j = 0; j < n; j++) {
            a[i * n + j] = i == j;
            for (int k = 0; k < n; k++)
                a[i * n + j] += m[i * n + k] * m[j * n + k];
        }
    }
    for (int i = 0; i < n; i++) {
        b[i] = 0;
        for (int j = 0; j < n; j++)
            b[i] += a[i * n + j] * x[j];
    }
}

static void test_solvers_agree_with_the_truth(void **state)
{
    (void)state;
    struct rng rng = {7};
    for (int n = 1; n <= N; n++) {
        double a[N * N], x[N], b[N], l[N * N], clamped[N * N], inverse[N * N], solved[N], scratch[N];
        random_system(&rng, n, a, x, b);
        memcpy(l, a, sizeof l);
        memcpy(clamped, a, sizeof clamped);
        EXPECT_TRUE(cholesky_factor(l, n));
        cholesky_factor_clamped(clamped, n, 1e-12);
        assert_memory_equal(clamped, l, sizeof(double) * (size_t)(n * n));
        EXPECT_TRUE(invert_symmetric(a, n, inverse));
        memcpy(solved, b, sizeof solved);
        cholesky_solve(l, n, solved);
        gauss_solve(a, n, b);
        for (int i = 0; i < n; i++) {
            EXPECT_NEAR(solved[i], x[i], 1e-13);
            EXPECT_NEAR(b[i], x[i], 1e-13);
            EXPECT_NEAR(cholesky_variance(l, n, i, scratch), inverse[i * n + i], 1e-14);
        }
    }
}

// The inverse of the marginal information is the block of the inverse.
static void test_marginal_information(void **state)
{
    (void)state;
    struct rng rng = {8};
    enum { HALF = N / 2 };
    double a[N * N], x[N], b[N], inverse[N * N], marginal[HALF * HALF], block[HALF * HALF];
    random_system(&rng, N, a, x, b);
    EXPECT_TRUE(invert_symmetric(a, N, inverse));
    for (int second = 0; second < 2; second++) {
        EXPECT_TRUE(marginal_information(a, HALF, second, marginal));
        EXPECT_TRUE(invert_symmetric(marginal, HALF, block));
        for (int i = 0; i < HALF; i++)
            for (int j = 0; j < HALF; j++)
                EXPECT_NEAR(block[i * HALF + j], inverse[(i + second * HALF) * N + j + second * HALF], 1e-14);
    }
}

static void test_singular_systems_are_refused(void **state)
{
    (void)state;
    double singular[4] = {1, 1, 1, 1}, not_finite[1] = {NAN}, inverse[4];
    EXPECT_TRUE(!invert_symmetric(singular, 2, inverse));
    EXPECT_TRUE(!cholesky_factor(not_finite, 1));
    cholesky_factor_clamped(singular, 2, 1e-12);
    EXPECT_NEAR(singular[3], 1e-6, 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_solvers_agree_with_the_truth),
        cmocka_unit_test(test_marginal_information),
        cmocka_unit_test(test_singular_systems_are_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
