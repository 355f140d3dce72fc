#include "base/linear_algebra.h"

#include <math.h>
#include <string.h>

static const double PIVOT_ROUNDING = 0x1p-53;

// Entry (i, j) of A less what the columns before j account for.
static double reduced_entry(const double *a, int n, int i, int j)
{
    double sum = a[i * n + j];
    for (int k = 0; k < j; k++)
        sum -= a[i * n + k] * a[j * n + k];
    return sum;
}

bool cholesky_factor(double *a, int n)
{
    for (int i = 0; i < n; i++) {
        for (int j = 0; j < i; j++)
            a[i * n + j] = reduced_entry(a, n, i, j) / a[j * n + j];
        // What is left of the diagonal element, but for the rounding of the subtractions.
        const double pivot = reduced_entry(a, n, i, i);
        if (!(pivot > PIVOT_ROUNDING * n * a[i * n + i] && isfinite(pivot)))
            return false;
        a[i * n + i] = sqrt(pivot);
    }
    return true;
}

void cholesky_factor_clamped(double *a, int n, double min_pivot)
{
    for (int i = 0; i < n; i++) {
        for (int j = 0; j < i; j++)
            a[i * n + j] = reduced_entry(a, n, i, j) / a[j * n + j];
        a[i * n + i] = sqrt(fmax(reduced_entry(a, n, i, i), min_pivot));
    }
}

void cholesky_solve(const double *l, int n, double *b)
{
    for (int i = 0; i < n; i++) {
        for (int k = 0; k < i; k++)
            b[i] -= l[i * n + k] * b[k];
        b[i] /= l[i * n + i];
    }
    for (int i = n - 1; i >= 0; i--) {
        for (int k = i + 1; k < n; k++)
            b[i] -= l[k * n + i] * b[k];
        b[i] /= l[i * n + i];
    }
}

double cholesky_variance(const double *l, int n, int u, double *column)
{
    double sum = 0;
    for (int i = u; i < n; i++) {
        double value = i == u;
        for (int k = u; k < i; k++)
            value -= l[i * n + k] * column[k];
        column[i] = value / l[i * n + i];
        sum += column[i] * column[i];
    }
    return sum;
}

void gauss_solve(double *a, int n, double *b)
{
    for (int i = 0; i < n; i++)
        for (int r = i + 1; r < n; r++) {
            const double f = a[r * n + i] / a[i * n + i];
            for (int c = i; c < n; c++)
                a[r * n + c] -= f * a[i * n + c];
            b[r] -= f * b[i];
        }
    for (int i = n - 1; i >= 0; i--) {
        for (int c = i + 1; c < n; c++)
            b[i] -= a[i * n + c] * b[c];
        b[i] /= a[i * n + i];
    }
}

bool invert_symmetric(const double *a, int n, double *inverse)
{
    double l[LINEAR_MAX * LINEAR_MAX];
    assert(n > 0 && n <= LINEAR_MAX);
    memcpy(l, a, sizeof(double) * (size_t)(n * n));
    if (!cholesky_factor(l, n))
        return false;
    for (int column = 0; column < n; column++) {
        double e[LINEAR_MAX] = {0};
        e[column] = 1;
        cholesky_solve(l, n, e);
        for (int row = 0; row < n; row++)
            inverse[row * n + column] = e[row];
    }
    return true;
}

bool marginal_information(const double *a, int n, bool second, double *out)
{
    int first = second ? n : 0, other = n - first, size = 2 * n;
    double factor[LINEAR_MAX * LINEAR_MAX], column[LINEAR_MAX];
    assert(n > 0 && n <= LINEAR_MAX);
    for (int i = 0; i < n * n; i++)
        factor[i] = a[(other + i / n) * size + other + i % n];
    if (!cholesky_factor(factor, n))
        return false;
    for (int j = 0; j < n; j++) {
        for (int i = 0; i < n; i++)
            column[i] = a[(other + i) * size + first + j];
        cholesky_solve(factor, n, column);
        for (int i = 0; i < n; i++) {
            out[i * n + j] = a[(first + i) * size + first + j];
            for (int k = 0; k < n; k++)
                out[i * n + j] -= a[(first + i) * size + other + k] * column[k];
        }
    }
    return true;
}

// ---------------------------------------------------------------- covariance

double covariance3_along(const struct covariance3 *covariance3, struct vec3 v)
{
    return v.x * (covariance3->xx * v.x + 2 * (covariance3->xy * v.y + covariance3->xz * v.z)) +
           v.y * (covariance3->yy * v.y + 2 * covariance3->yz * v.z) + v.z * covariance3->zz * v.z;
}

struct covariance3 covariance3_isotropic(double variance)
{
    return (struct covariance3){.xx = variance, .yy = variance, .zz = variance};
}

struct covariance3 covariance3_add(const struct covariance3 *a, const struct covariance3 *b)
{
    return (struct covariance3){a->xx + b->xx, a->xy + b->xy, a->xz + b->xz,
                                a->yy + b->yy, a->yz + b->yz, a->zz + b->zz};
}

struct covariance3 covariance3_scale(const struct covariance3 *covariance3, double s)
{
    return (struct covariance3){s * covariance3->xx, s * covariance3->xy, s * covariance3->xz,
                                s * covariance3->yy, s * covariance3->yz, s * covariance3->zz};
}

struct covariance3 covariance3_outer(struct vec3 v)
{
    return (struct covariance3){v.x * v.x, v.x * v.y, v.x * v.z, v.y * v.y, v.y * v.z, v.z * v.z};
}

struct covariance3 covariance3_rotate(struct quat a_from_b, const struct covariance3 *covariance3)
{
    double r[3][3], rc[3][3], out[3][3];
    const double m[3][3] = {{covariance3->xx, covariance3->xy, covariance3->xz},
                            {covariance3->xy, covariance3->yy, covariance3->yz},
                            {covariance3->xz, covariance3->yz, covariance3->zz}};
    quat_to_matrix(a_from_b, r);
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 3; k++)
            rc[i][k] = r[i][0] * m[0][k] + r[i][1] * m[1][k] + r[i][2] * m[2][k];
    for (int i = 0; i < 3; i++)
        for (int k = i; k < 3; k++)
            out[i][k] = rc[i][0] * r[k][0] + rc[i][1] * r[k][1] + rc[i][2] * r[k][2];
    return (struct covariance3){out[0][0], out[0][1], out[0][2], out[1][1], out[1][2], out[2][2]};
}

// ------------------------------------------------------------- half floats

enum { HALF_INFINITY = 0x7c00, HALF_MAX = 0x7bff, HALF_SIGN = 0x8000 };

// value >> shift, rounded to nearest, ties to even. 1 <= shift <= 31.
static uint32_t shift_rounded(uint32_t value, int shift)
{
    const uint32_t lost = value & ((1u << shift) - 1), middle = 1u << (shift - 1);
    value >>= shift;
    return value + (lost > middle || (lost == middle && (value & 1)));
}

uint16_t half_from_double(double value)
{
    const float single = (float)value;
    uint32_t bits;
    memcpy(&bits, &single, sizeof bits);
    const uint32_t sign = bits >> 16 & HALF_SIGN;
    const int exponent = (int)(bits >> 23 & 255) - 127;
    uint32_t half = 0;
    if (exponent > 15)
        half = HALF_MAX;
    else if (exponent >= -14) // a carry out of the mantissa raises the exponent, as it should
        half = shift_rounded((uint32_t)(exponent + 15) << 23 | (bits & 0x7fffff), 13);
    else if (exponent >= -25)
        half = shift_rounded((bits & 0x7fffff) | 0x800000, -exponent - 1);
    return (uint16_t)(sign | (half > HALF_MAX ? HALF_MAX : half));
}

double half_to_double(uint16_t half)
{
    const double sign = half & HALF_SIGN ? -1 : 1;
    const uint32_t exponent = half >> 10 & 31, mantissa = half & 0x3ff;
    if (exponent == 0)
        return sign * mantissa * (1.0 / (1 << 24));
    if (exponent == 31)
        return mantissa ? (double)NAN : sign * (double)INFINITY;
    const uint32_t bits = (exponent + 112) << 23 | mantissa << 13;
    float single;
    memcpy(&single, &bits, sizeof single);
    return sign * (double)single;
}

// ------------------------------------------------------------- Cholesky factors

static const double PIVOT_MIN_RATE = 1e-9; // of the diagonal element: below it is rounding

// The square root of a pivot; 0 where it is none.
static double root_of(double pivot, double diagonal) { return pivot > PIVOT_MIN_RATE * diagonal ? sqrt(pivot) : 0; }

struct covariance_root covariance_pack(const struct covariance3 *covariance3)
{
    assert(isfinite(covariance3->xx + covariance3->xy + covariance3->xz + covariance3->yy + covariance3->yz +
                    covariance3->zz));
    const double l11 = root_of(covariance3->xx, covariance3->xx), l21 = l11 > 0 ? covariance3->xy / l11 : 0,
                 l31 = l11 > 0 ? covariance3->xz / l11 : 0, l22 = root_of(covariance3->yy - l21 * l21, covariance3->yy),
                 l32 = l22 > 0 ? (covariance3->yz - l21 * l31) / l22 : 0,
                 l33 = root_of(covariance3->zz - l31 * l31 - l32 * l32, covariance3->zz);
    return (struct covariance_root){{half_from_double(l11), half_from_double(l21), half_from_double(l31),
                                     half_from_double(l22), half_from_double(l32), half_from_double(l33)}};
}

struct covariance3 covariance_unpack(struct covariance_root root)
{
    double l[6];
    for (int i = 0; i < 6; i++)
        l[i] = half_to_double(root.half[i]);
    return (struct covariance3){.xx = l[0] * l[0],
                                .xy = l[0] * l[1],
                                .xz = l[0] * l[2],
                                .yy = l[1] * l[1] + l[3] * l[3],
                                .yz = l[1] * l[2] + l[3] * l[4],
                                .zz = l[2] * l[2] + l[4] * l[4] + l[5] * l[5]};
}

bool covariance_is_known(struct covariance_root root)
{
    unsigned any = 0;
    for (int i = 0; i < 6; i++)
        any |= root.half[i] & ~(unsigned)HALF_SIGN;
    return any != 0;
}

bool covariance_is_finite(struct covariance_root root)
{
    bool finite = true;
    for (int i = 0; i < 6; i++)
        finite = finite && (root.half[i] & HALF_INFINITY) != HALF_INFINITY;
    return finite;
}
