#include "base/linear_algebra.h"

#include <math.h>
#include <string.h>

static const double PIVOT_ROUNDING = 0x1p-53;

// Entry (i, j) of A less what the columns before j account for.
static double remaining(const double *a, int n, int i, int j)
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
            a[i * n + j] = remaining(a, n, i, j) / a[j * n + j];
        // What is left of the diagonal element, but for the rounding of the subtractions.
        const double pivot = remaining(a, n, i, i);
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
            a[i * n + j] = remaining(a, n, i, j) / a[j * n + j];
        a[i * n + i] = sqrt(fmax(remaining(a, n, i, i), min_pivot));
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
