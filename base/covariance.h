// Covariances of points in space: symmetric 3 x 3 matrices in m^2, in the axes of the point. Pure.
//
// A covariance is stored as its Cholesky factor in six IEEE 754 half floats (12 bytes instead of 24 or 48): whatever is
// stored is a covariance, positive semidefinite by construction, which rounded elements of the matrix itself would not
// be where a point is known much better across than along a ray. A factor from 61 um on has a relative error of at most
// 2^-11 (0.05 %), so an element of the covariance at most 0.1 % of the standard deviations of its row and column;
// below, the error is at most 0.03 um. The largest factor is 65504 m.
#pragma once
#include "base/geometry.h"

struct covariance3 {
    double xx, xy, xz, yy, yz, zz;
};

// Lower triangular L with covariance L L': l11, l21, l31, l22, l32, l33, metres, as bits of half floats. All 0: not
// known.
struct covariance_root {
    uint16_t half[6];
};

static inline double covariance3_trace(const struct covariance3 *c) { return c->xx + c->yy + c->zz; }
// v' C v: for a unit vector, the variance along it.
double covariance3_along(const struct covariance3 *c, struct vec3 v);
struct covariance3 covariance3_isotropic(double variance);
struct covariance3 covariance3_add(const struct covariance3 *a, const struct covariance3 *b);
struct covariance3 covariance3_scale(const struct covariance3 *c, double s);
struct covariance3 covariance3_outer(struct vec3 v); // v v'
struct covariance3 covariance3_rotate(struct quat a_from_b, const struct covariance3 *in_b);

// An indefinite matrix is cut off: pivots below 0, or below 1e-9 of their diagonal element, count as 0. A number that
// is not finite asserts.
struct covariance_root covariance_pack(const struct covariance3 *c);
struct covariance3 covariance_unpack(struct covariance_root root);
bool covariance_is_known(struct covariance_root root);  // a factor is not 0
bool covariance_is_finite(struct covariance_root root); // else what was read is no covariance

// IEEE 754 half floats, rounded to nearest, ties to even; too large becomes the largest finite one.
uint16_t half_from_double(double value);
double half_to_double(uint16_t half);
