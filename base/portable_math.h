// Elementary functions whose bits depend neither on the C library nor on the processor: they only add, multiply,
// divide, take square roots and scale by powers of two, in a fixed order. What decides about a recording or a picture
// uses these, because a C library may compute the same function with fused multiply-add on one processor and without on
// another.
//
// Method: argument reduction with constants split in two or three parts (Cody & Waite 1980) and Taylor or atanh series.
// Error at most 2 units in the last place where not said otherwise; NaN and infinities as in C's Annex F. Pure; any
// thread.
#pragma once

#ifdef __cplusplus
extern "C" {
#endif

double portable_exp(double x);
double portable_log(double x); // natural; below 0 NaN, of 0 -infinity

// Radians, |x| <= 10^5; beyond that the absolute error grows as |x| 10^-21 does, and from 2^31 quarter turns on NaN.
double portable_sin(double x);
double portable_cos(double x);
double portable_tan(double x);

double portable_atan2(double y, double x); // -pi..pi; of (0, 0) 0 or pi, by the signs
double portable_asin(double x);            // NaN outside -1..1
double portable_acos(double x);

double portable_hypot(double x, double y); // no overflow or underflow on the way
double portable_pow(double x, double y);   // x >= 0. Relative error 4e-16 (1 + |y log x|)

#ifdef __cplusplus
}
#endif
