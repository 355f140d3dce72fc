// Small dense symmetric systems, as normal equations need them: Cholesky decomposition and Gaussian elimination.
// Matrices are row-major, n x n doubles. Pure functions: no memory is allocated, any thread may call. The order of the
// floating-point operations is fixed, so the same input gives the same bits.
#pragma once
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
