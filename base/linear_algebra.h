// Small dense symmetric systems, as the fits of this folder need them.
// Row-major, n up to LINEAR_MAX. Pure.
#pragma once
#include "base/status.h"

enum { LINEAR_MAX = 16 };

// a = L L^T, L in a's lower triangle. False: not positive definite (or not finite).
bool cholesky(double *a, int n);
void cholesky_solve(const double *l, int n, double *b); // b becomes the solution
// The information of the first or the second half of 2 n numbers, whatever the others are: a is 2n x 2n,
// out n x n. False: nothing is known of the others.
bool marginal_information(const double *a, int n, bool second, double *out);
bool invert_symmetric(const double *a, int n, double *inverse); // a positive definite
