#include "base/portable_math.h"

#include <math.h>

static const double LN2_HIGH = 0x1.62e42fefap-1; // 37 bits, so that k times it is exact
static const double LN2_LOW = 0x1.cf79abc9e3b3ap-40;
static const double PI = 0x1.921fb54442d18p+1, PI_LOW = 0x1.1a62633145c07p-53;

// c[0] + x (c[1] + x (c[2] + ...))
static double evaluate_polynomial(const double *c, int count, double x)
{
    double sum = c[count - 1];
    for (int i = count - 2; i >= 0; i--)
        sum = sum * x + c[i];
    return sum;
}

double portable_exp(double x)
{
    // exp(r) = 1 + r + r^2 (1/2 + r/6 + ...), |r| <= ln(2) / 2: the first term left out is below 2^-57
    static const double tail[] = {
        1.0 / 2,     1.0 / 6,      1.0 / 24,      1.0 / 120,      1.0 / 720,       1.0 / 5040,
        1.0 / 40320, 1.0 / 362880, 1.0 / 3628800, 1.0 / 39916800, 1.0 / 479001600, 1.0 / 6227020800,
    };
    if (!(x < 710)) // NaN, too
        return x < HUGE_VAL ? HUGE_VAL : x;
    if (x < -746)
        return 0;
    const double k = floor(x / (LN2_HIGH + LN2_LOW) + 0.5);
    const double high = x - k * LN2_HIGH, low = k * LN2_LOW, r = high - low;
    const double rest = r * r * evaluate_polynomial(tail, sizeof tail / sizeof *tail, r) + ((high - r) - low);
    return ldexp(1 + (r + rest), (int)k);
}

double portable_log(double x)
{
    // log(m) = 2 atanh(s), s = (m - 1) / (m + 1), |s| <= 0.172: the first term left out is below 2^-57
    static const double tail[] = {
        2.0 / 3, 2.0 / 5, 2.0 / 7, 2.0 / 9, 2.0 / 11, 2.0 / 13, 2.0 / 15, 2.0 / 17, 2.0 / 19, 2.0 / 21, 2.0 / 23,
    };
    if (!(x > 0))
        return x == 0 ? -HUGE_VAL : NAN;
    if (x == HUGE_VAL)
        return x;
    int k;
    double m = frexp(x, &k);
    if (m < 0x1.6a09e667f3bcdp-1) { // sqrt(1/2)
        m *= 2;
        k--;
    }
    // log(1 + f) = f - (f^2 / 2 - s (f^2 / 2 + tail)), which keeps f's own bits
    const double f = m - 1, s = f / (2 + f), z = s * s, half = 0.5 * f * f;
    const double rest = s * (half + z * evaluate_polynomial(tail, sizeof tail / sizeof *tail, z));
    return k * LN2_HIGH + (f - (half - (rest + k * LN2_LOW)));
}

// x = quarter pi / 2 + *r + *low, |*r| <= pi / 4. False: not a number that this can reduce.
static int reduce_angle(double x, double *r, double *low, unsigned *quarter)
{
    // pi / 2 in parts of 33 bits: k times the first two is exact for k < 2^20
    static const double first = 0x1.921fb544p+0, second = 0x1.0b4611a6p-34, third = 0x1.3198a2e037073p-69;
    const double k = floor(x / (PI / 2) + 0.5);
    if (!(fabs(k) < 2147483648.0))
        return 0;
    const double a = x - k * first, b = k * second, t = a - b, c = k * third;
    *r = t - c;
    *low = ((a - t) - b) + ((t - *r) - c);
    *quarter = (unsigned)(long long)k & 3;
    return 1;
}

// Of r + low, |r| <= pi / 4.
static double compute_sine(double r, double low)
{
    static const double tail[] = {
        -1.0 / 6,        1.0 / 120,        -1.0 / 5040,          1.0 / 362880,
        -1.0 / 39916800, 1.0 / 6227020800, -1.0 / 1307674368000, 1.0 / 355687428096000,
    };
    const double z = r * r;
    return r + (r * z * evaluate_polynomial(tail, sizeof tail / sizeof *tail, z) + low * (1 - 0.5 * z));
}

static double compute_cosine(double r, double low)
{
    static const double tail[] = {
        1.0 / 24,        -1.0 / 720,         1.0 / 40320,          -1.0 / 3628800,
        1.0 / 479001600, -1.0 / 87178291200, 1.0 / 20922789888000, -1.0 / 6402373705728000,
    };
    const double z = r * r, half = 0.5 * z, w = 1 - half;
    return w + (((1 - w) - half) + (z * z * evaluate_polynomial(tail, sizeof tail / sizeof *tail, z) - r * low));
}

double portable_sin(double x)
{
    double r, low;
    unsigned quarter;
    if (!reduce_angle(x, &r, &low, &quarter))
        return NAN;
    if (x == 0)
        return x; // its sign
    const double value = quarter & 1 ? compute_cosine(r, low) : compute_sine(r, low);
    return quarter & 2 ? -value : value;
}

double portable_cos(double x)
{
    double r, low;
    unsigned quarter;
    if (!reduce_angle(x, &r, &low, &quarter))
        return NAN;
    const double value = quarter & 1 ? compute_sine(r, low) : compute_cosine(r, low);
    return (quarter + 1) & 2 ? -value : value;
}

double portable_tan(double x)
{
    double r, low;
    unsigned quarter;
    if (!reduce_angle(x, &r, &low, &quarter))
        return NAN;
    if (x == 0)
        return x;
    return quarter & 1 ? -compute_cosine(r, low) / compute_sine(r, low) : compute_sine(r, low) / compute_cosine(r, low);
}

// atan(y / x) in parts, 0 <= y <= x, x > 0: *low + the value returned, which has no more than 53 bits.
static double first_octant(double y, double x, double *low)
{
    // tan(i pi / 16): what is left is at most tan(pi / 32), and the first term left out below 2^-57 of it
    static const double tangent[] = {0, 0x1.975f5e0553158p-3, 0x1.a827999fcef32p-2, 0x1.561b82ab7f99p-1, 1};
    static const double tail[] = {-1.0 / 3, 1.0 / 5, -1.0 / 7, 1.0 / 9, -1.0 / 11, 1.0 / 13, -1.0 / 15, 1.0 / 17};
    const double ratio = y / x;
    static const double middle[] = {0.0984914, 0.3033467, 0.5345111, 0.8206788}; // tan((i + 1/2) pi / 16)
    int i = 0;
    while (i < 4 && !(ratio < middle[i]))
        i++;
    const double t = i ? (y - tangent[i] * x) / (x + tangent[i] * y) : ratio, z = t * t;
    *low = t * z * evaluate_polynomial(tail, sizeof tail / sizeof *tail, z);
    if (!i)
        return t;
    *low += t + i * (PI_LOW / 16);
    return i * (PI / 16);
}

double portable_atan2(double y, double x)
{
    if (isnan(x) || isnan(y))
        return NAN;
    double ay = fabs(y), ax = fabs(x), low;
    if (isinf(ax) || isinf(ay)) {
        ay = isinf(ay) ? 1 : 0;
        ax = isinf(ax) ? 1 : 0;
    }
    double angle;
    if (ay == 0 && ax == 0) {
        angle = signbit(x) ? PI : 0;
    } else if (ay <= ax) {
        const double high = first_octant(ay, ax, &low);
        angle = signbit(x) ? PI - (high - (PI_LOW - low)) : high + low;
        if (signbit(x) && ay == 0)
            angle = PI;
    } else {
        const double high = first_octant(ax, ay, &low);
        angle = signbit(x) ? PI / 2 + (high + (low + PI_LOW / 2)) : PI / 2 - (high - (PI_LOW / 2 - low));
    }
    return signbit(y) ? -angle : angle;
}

double portable_asin(double x) { return fabs(x) <= 1 ? portable_atan2(x, sqrt((1 - x) * (1 + x))) : NAN; }

double portable_acos(double x) { return fabs(x) <= 1 ? portable_atan2(sqrt((1 - x) * (1 + x)), x) : NAN; }

double portable_hypot(double x, double y)
{
    const double ax = fabs(x), ay = fabs(y), max = ax > ay ? ax : ay;
    if (isinf(ax) || isinf(ay))
        return HUGE_VAL;
    if (isnan(x) || isnan(y))
        return NAN;
    if (max > 1e-150 && max < 1e150)
        return sqrt(x * x + y * y);
    if (max == 0)
        return 0;
    const double scale = max < 1 ? 0x1p-1000 : 0x1p1000; // a power of two: exact but for what is too small to count
    return scale * sqrt((x / scale) * (x / scale) + (y / scale) * (y / scale));
}

double portable_pow(double x, double y)
{
    if (y == 0 || x == 1)
        return 1;
    if (x == 0)
        return y > 0 ? 0 : HUGE_VAL;
    return portable_exp(y * portable_log(x));
}
