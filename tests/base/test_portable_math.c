// Functions whose bits depend neither on the C library nor on the processor: accurate next to the C library's in long
// double, and the same bits as on the machine that the sums below were made on.
#include "tests/support/test.h"

#include "base/portable_math.h"
#include "tests/support/random.h"

#include <float.h>
#include <math.h>
#include <string.h>

enum { SEED = 77, ARGUMENTS = 200000 };

// Units in the last place of the double nearest to `exact`.
static double ulps(double value, long double exact)
{
    const double nearest = (double)exact;
    if (value == nearest || (isnan(value) && isnan(nearest)))
        return 0;
    if (!isfinite(value) || !isfinite(nearest))
        return HUGE_VAL;
    const double next = nextafter(fabs(nearest), HUGE_VAL) - fabs(nearest);
    return (double)(fabsl((long double)value - exact) / (long double)fmax(next, DBL_MIN * DBL_EPSILON));
}

struct function {
    const char *name;
    double (*ours)(double);
    long double (*exact)(long double);
    double from, to;
    double most_ulps; // measured and rounded up
};

static double atan_of(double x) { return portable_atan2(x, 1); }

static const struct function functions[] = {
    {"exp", portable_exp, expl, -700, 700, 1.1},       {"exp near 0", portable_exp, expl, -0.4, 0.4, 1.1},
    {"log", portable_log, logl, 1e-300, 1e300, 1.1},   {"log near 1", portable_log, logl, 0.5, 2, 1.1},
    {"sin", portable_sin, sinl, -100000, 100000, 1.1}, {"sin near 0", portable_sin, sinl, -1, 1, 1.1},
    {"cos", portable_cos, cosl, -100000, 100000, 1.1}, {"cos near 0", portable_cos, cosl, -1, 1, 1.1},
    {"tan", portable_tan, tanl, -1.5, 1.5, 2},         {"atan", atan_of, atanl, -3, 3, 2.8},
    {"atan far", atan_of, atanl, -1e6, 1e6, 1.1},      {"asin", portable_asin, asinl, -1, 1, 3.5},
    {"acos", portable_acos, acosl, -1, 1, 3.5},
};

static void test_errors_are_small(void **state)
{
    (void)state;
    struct rng rng = {SEED};
    for (size_t f = 0; f < COUNT_OF(functions); f++) {
        double worst = 0, at = 0;
        for (int i = 0; i < ARGUMENTS; i++) {
            const double x = functions[f].from + (functions[f].to - functions[f].from) * rng_uniform(&rng);
            const double error = ulps(functions[f].ours(x), functions[f].exact(x));
            if (error > worst) {
                worst = error;
                at = x;
            }
        }
        print_message("%s: at most %.2f units in the last place, at %.17g\n", functions[f].name, worst, at);
        EXPECT_AT_MOST(worst, functions[f].most_ulps);
    }
}

static void test_two_arguments(void **state)
{
    (void)state;
    struct rng rng = {SEED + 1};
    double worst_atan2 = 0, worst_hypot = 0, worst_pow = 0;
    for (int i = 0; i < ARGUMENTS; i++) {
        const double x = 2 * rng_uniform(&rng) - 1, y = (2 * rng_uniform(&rng) - 1) * (i % 3 ? 1 : 1e-3);
        worst_atan2 = fmax(worst_atan2, ulps(portable_atan2(y, x), atan2l(y, x)));
        worst_hypot = fmax(worst_hypot, ulps(portable_hypot(x, y), hypotl(x, y)));
        const double power = 10 * y, exact = (double)powl(fabs(x), power);
        worst_pow = fmax(worst_pow, fabs(portable_pow(fabs(x), power) / exact - 1) / (1 + fabs(power * log(fabs(x)))));
    }
    print_message("atan2 %.2f, hypot %.2f units in the last place; pow %.2g\n", worst_atan2, worst_hypot, worst_pow);
    EXPECT_AT_MOST(worst_atan2, 3);
    EXPECT_AT_MOST(worst_hypot, 1.5);
    EXPECT_AT_MOST(worst_pow, 4e-16);
}

static void expect_same(double value, double wanted)
{
    if (memcmp(&value, &wanted, sizeof value) && !(isnan(value) && isnan(wanted))) {
        print_error("%.17g, wanted %.17g\n", value, wanted);
        fail_test();
    }
}

// C's Annex F, bit for bit, signs of zero, too.
static void test_special_values(void **state)
{
    (void)state;
    const double special[] = {0.0, -0.0, 1, -1, HUGE_VAL, -HUGE_VAL, NAN, 0.5, -0.5, 1e-310};
    for (size_t i = 0; i < COUNT_OF(special); i++) {
        const double x = special[i];
        EXPECT_AT_MOST(ulps(portable_exp(x), expl(x)), 1);
        EXPECT_AT_MOST(ulps(portable_log(x), logl(x)), 1);
        EXPECT_AT_MOST(ulps(portable_acos(x), acosl(x)), 1);
        expect_same(portable_asin(x), asin(x));
        if (fabs(x) < 1e9 || isnan(x) || isinf(x)) {
            EXPECT_AT_MOST(ulps(portable_sin(x), sinl(x)), 1);
            EXPECT_AT_MOST(ulps(portable_cos(x), cosl(x)), 1);
        }
        for (size_t k = 0; k < COUNT_OF(special); k++) {
            const double y = special[k], both = portable_atan2(y, x);
            EXPECT_AT_MOST(ulps(both, atan2l(y, x)), 1);
            EXPECT_INT(!!signbit(both) && !isnan(both), !!signbit(atan2(y, x)) && !isnan(both));
            EXPECT_AT_MOST(ulps(portable_hypot(x, y), hypotl(x, y)), 1);
        }
    }
    expect_same(portable_exp(709.8), HUGE_VAL);
    expect_same(portable_exp(-750), 0);
    expect_same(portable_sin(-0.0), -0.0);
    expect_same(portable_hypot(3e300, 4e300), 5e300);
    expect_same(portable_hypot(3e-320, 4e-320), hypot(3e-320, 4e-320));
    expect_same(portable_sin(1e300), NAN);
    expect_same(portable_pow(0, 0), 1);
    expect_same(portable_pow(0, 2), 0);
}

// The same bits on every machine, compiler and C library.
static void test_bits_are_the_same_everywhere(void **state)
{
    (void)state;
    struct rng rng = {SEED + 2};
    uint64_t sum = UINT64_C(0xcbf29ce484222325); // FNV-1a
    for (int i = 0; i < 20000; i++) {
        const double x = 40 * rng_uniform(&rng) - 20, y = 2 * rng_uniform(&rng) - 1;
        const double values[] = {portable_exp(x), portable_log(fabs(x)), portable_sin(x),         portable_cos(x),
                                 portable_tan(x), portable_atan2(y, x),  portable_asin(y),        portable_acos(y),
                                 atan_of(x),      portable_hypot(x, y),  portable_pow(fabs(y), x)};
        for (size_t k = 0; k < COUNT_OF(values); k++) {
            uint64_t bits;
            memcpy(&bits, &values[k], sizeof bits);
            sum = (sum ^ bits) * UINT64_C(0x100000001b3);
        }
    }
    print_message("the sum is 0x%016llx\n", (unsigned long long)sum);
    EXPECT_TRUE(sum == UINT64_C(0x4e22cf06298502e8));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_errors_are_small),
        cmocka_unit_test(test_two_arguments),
        cmocka_unit_test(test_special_values),
        cmocka_unit_test(test_bits_are_the_same_everywhere),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
