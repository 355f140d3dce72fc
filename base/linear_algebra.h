// Small dense symmetric systems, as normal equations need them: Cholesky decomposition and Gaussian elimination.
// Matrices are row-major, n x n doubles. Pure functions: no memory is allocated, any thread may call. The order of the
// floating-point operations is fixed, so the same input gives the same bits.
#pragma once
#include "base/geometry.h"
#include "base/status.h"

enum { LINEAR_MAX = 16 }; // the largest n of the functions that keep a copy: marginal_information, invert_symmetric

// A = L L'. Reads and writes the lower triangle only, which becomes L. False: A is not positive definite (a pivot is no
// more than rounding leaves of it) or not finite; the triangle is then undefined.
bool cholesky_factor(double *a, int n);

// The same for a matrix that is positive semidefinite but for rounding: a pivot below min_pivot is set to it.
void cholesky_factor_clamped(double *a, int n, double min_pivot);

// Solves L L' x = b in place.
void cholesky_solve(const double *l, int n, double *b);

// Entry (i, i) of the inverse of L L': the variance of unknown i where L L' is an information matrix.
// scratch: n doubles.
double cholesky_variance(const double *l, int n, int i, double *scratch);

// Solves A x = b by Gaussian elimination without pivoting, for a positive definite A of which all n x n entries are
// given. Overwrites A; x replaces b.
void gauss_solve(double *a, int n, double *b);

// The information of the first (or second) half of 2 n unknowns with the other half marginalised: the Schur complement.
// a is 2n x 2n, out n x n. False: the other half's block is not positive definite; out is then undefined.
bool marginal_information(const double *a, int n, bool second, double *out);

// The inverse of a positive definite matrix. False: it is not; inverse is then untouched.
bool invert_symmetric(const double *a, int n, double *inverse);

// ---------------------------------------------------------------- covariance

// Covariances of points in space: symmetric 3 x 3 matrices in m^2, in the axes of the point. Pure.
//
// A covariance is stored as its Cholesky factor in six IEEE 754 half floats (12 bytes instead of 24 or 48): whatever is
// stored is a covariance, positive semidefinite by construction, which rounded elements of the matrix itself would not
// be where a point is known much better across than along a ray. A factor from 61 um on has a relative error of at most
// 2^-11 (0.05 %), so an element of the covariance at most 0.1 % of the standard deviations of its row and column;
// below, the error is at most 0.03 um. The largest factor is 65504 m.

struct covariance3 {
    double xx, xy, xz, yy, yz, zz;
};

// Lower triangular L with covariance L L': l11, l21, l31, l22, l32, l33, metres, as bits of half floats. All 0: not
// known.
struct covariance_root {
    uint16_t half[6];
};

static inline double covariance3_trace(const struct covariance3 *covariance3)
{
    return covariance3->xx + covariance3->yy + covariance3->zz;
}
// v' C v: for a unit vector, the variance along it.
double covariance3_along(const struct covariance3 *covariance3, struct vec3 v);
struct covariance3 covariance3_isotropic(double variance);
struct covariance3 covariance3_add(const struct covariance3 *a, const struct covariance3 *b);
struct covariance3 covariance3_scale(const struct covariance3 *covariance3, double s);
struct covariance3 covariance3_outer(struct vec3 v); // v v'
struct covariance3 covariance3_rotate(struct quat a_from_b, const struct covariance3 *in_b);

// An indefinite matrix is cut off: pivots below 0, or below 1e-9 of their diagonal element, count as 0. A number that
// is not finite asserts.
struct covariance_root covariance_pack(const struct covariance3 *covariance3);
struct covariance3 covariance_unpack(struct covariance_root root);
bool covariance_is_known(struct covariance_root root);  // a factor is not 0
bool covariance_is_finite(struct covariance_root root); // else what was read is no covariance

// IEEE 754 half floats, rounded to nearest, ties to even; too large becomes the largest finite one.
uint16_t half_from_double(double value);
double half_to_double(uint16_t half);
