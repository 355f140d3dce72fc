// The elementary functions that decide about recordings and pictures (base/portable_math.h), and sums.
#include "base/portable_math.h"
#include "tests/stability/stability.h"

#include <math.h>
#include <string.h>

// NaN from one of these says that it does not know.
static struct answer known_or_not(double value)
{
    return isnan(value) ? answer_of(ANSWER_UNKNOWN) : answer_value(value);
}

static struct answer ask_exp(const double *in) { return known_or_not(portable_exp(in[0])); }
static struct answer ask_log(const double *in) { return known_or_not(portable_log(in[0])); }
static struct answer ask_sin(const double *in) { return known_or_not(portable_sin(in[0])); }
static struct answer ask_atan2(const double *in) { return known_or_not(portable_atan2(in[0], in[1])); }
static struct answer ask_acos(const double *in) { return known_or_not(portable_acos(in[0])); }
static struct answer ask_hypot(const double *in) { return known_or_not(portable_hypot(in[0], in[1])); }
static struct answer ask_pow(const double *in) { return known_or_not(portable_pow(in[0], in[1])); }

// The exponent read from the bits, as if every number had an implied first bit.
static struct answer log_of_bits(const double *in)
{
    uint64_t bits;
    memcpy(&bits, in, sizeof bits);
    const double mantissa = 1 + (double)(bits & 0xfffffffffffff) * 0x1p-52;
    return answer_value(((double)(bits >> 52) - 1023) * 0x1.62e42fefa39efp-1 + portable_log(mantissa));
}

// The mantissa left in 1/2 .. 1, so that log(1 + small) is log 2 minus nearly log 2.
static struct answer log_by_halves(const double *in)
{
    int k;
    const double m = frexp(in[0], &k);
    return answer_value(k * 0x1.62e42fefa39efp-1 + portable_log(m));
}

static struct answer by_quotient(const double *in) { return answer_value(portable_atan2(in[0] / in[1], 1)); }
static struct answer acos_clamped(const double *in) { return answer_value(portable_acos(fmin(1, in[0]))); }
static struct answer by_multiplying(const double *in)
{
    double product = 1;
    for (int i = 0; i < (int)in[1]; i++)
        product *= in[0];
    return answer_value(product);
}

static const struct stability_case cases[] = {
    {"exp of -40", "argument reduction", ANSWER_VALUE, ask_exp, &plain_exp, .in = {-40}, .tolerance = 1e-33},
    {"exp of 30", "argument reduction", ANSWER_VALUE, ask_exp, &plain_exp, .in = {30}, .tolerance = 2e-3},
    {"exp of 710", "overflow is infinity", ANSWER_VALUE, ask_exp, &plain_exp, .in = {710}, .exact = {INFINITY},
     .exact_count = 1},
    {"exp of -745, a denormal", "scaled by powers of two", ANSWER_VALUE, ask_exp, &plain_exp, .in = {-745},
     .tolerance = 5e-324},
    {"log of the smallest denormal", "normalised first", ANSWER_VALUE, ask_log, NULL, log_of_bits, .in = {5e-324},
     .exact = {-744.4400719213812}, .exact_count = 1, .tolerance = 2e-13},
    {"log of 1 + 1e-7", "mantissa about 1, not below", ANSWER_VALUE, ask_log, NULL, log_by_halves, .in = {1 + 1e-7},
     .exact = {9.9999995058387045e-08}, .exact_count = 1, .tolerance = 3e-23},
    {"log of -1", "NaN says unknown", ANSWER_UNKNOWN, ask_log, NULL, log_of_bits, .in = {-1}},
    {"sine of 100000", "pi in three parts", ANSWER_VALUE, ask_sin, &plain_sin, .in = {100000}, .tolerance = 2e-16},
    {"sine of 3000000", "pi in three parts", ANSWER_VALUE, ask_sin, &plain_sin, .in = {3e6}, .tolerance = 1e-14},
    {"sine of 1e300", "no reduction that far: NaN", ANSWER_UNKNOWN, ask_sin, &plain_sin, .in = {1e300}},
    {"atan2 of (0, 0)", "by sign, not by quotient", ANSWER_VALUE, ask_atan2, NULL, by_quotient, .in = {0, 0},
     .exact = {0}, .exact_count = 1},
    {"atan2 of (-0, -1)", "by sign, not by quotient", ANSWER_VALUE, ask_atan2, NULL, by_quotient, .in = {-0.0, -1},
     .exact = {-3.14159265358979323846}, .exact_count = 1},
    {"acos of 1 + 2^-52", "NaN says unknown", ANSWER_UNKNOWN, ask_acos, NULL, acos_clamped,
     .in = {0x1.0000000000001p+0}},
    {"hypot of 3e200, 4e200", "no square overflows", ANSWER_VALUE, ask_hypot, &plain_hypot, .in = {3e200, 4e200},
     .tolerance = 1e185},
    {"hypot of 3e-200, 4e-200", "no square underflows", ANSWER_VALUE, ask_hypot, &plain_hypot, .in = {3e-200, 4e-200},
     .tolerance = 1e-215},
    {"1.0000001 to the power of 10^7", "exp(y log x)", ANSWER_VALUE, ask_pow, NULL, by_multiplying,
     .in = {1.0000001, 1e7}, .exact = {2.7182816941320816}, .exact_count = 1, .tolerance = 2e-15},
};
const struct stability_stage stability_math = {"elementary functions", cases, COUNT_OF(cases)};
