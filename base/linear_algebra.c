#include "base/linear_algebra.h"

#include <math.h>
#include <string.h>

bool cholesky(double *a, int n)
{
    assert(n > 0 && n <= LINEAR_MAX);
    for (int i = 0; i < n; i++) {
        for (int j = 0; j <= i; j++) {
            double sum = a[i * n + j];
            for (int k = 0; k < j; k++)
                sum -= a[i * n + k] * a[j * n + k];
            if (i != j)
                a[i * n + j] = sum / a[j * n + j];
            else if (sum > 0 && isfinite(sum))
                a[i * n + i] = sqrt(sum);
            else
                return false;
        }
    }
    return true;
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

bool invert_symmetric(const double *a, int n, double *inverse)
{
    double l[LINEAR_MAX * LINEAR_MAX];
    memcpy(l, a, sizeof(double) * (size_t)(n * n));
    if (!cholesky(l, n))
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
    assert(n <= LINEAR_MAX);
    for (int i = 0; i < n * n; i++)
        factor[i] = a[(other + i / n) * size + other + i % n];
    if (!cholesky(factor, n))
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
