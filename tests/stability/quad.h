// Arithmetic with 113 significant bits, for references: __float128 on x86, long double where that is as wide (aarch64).
// The functions only add, multiply and divide, so that they need no library and give the same bits everywhere.
// Errors are below 1e-30 of the result, for moderate arguments. Pure.
#pragma once
#include <float.h>

#if LDBL_MANT_DIG == 113
typedef long double quad;
#else
__extension__ typedef __float128 quad;
#endif

quad quad_pi(void);
quad quad_abs(quad x);
quad quad_sqrt(quad x); // below 0: NaN
quad quad_sin(quad x);  // |x| <= 10^6
quad quad_cos(quad x);
quad quad_atan2(quad y, quad x);
quad quad_acos(quad x); // NaN outside -1..1
quad quad_asin(quad x);
quad quad_exp(quad x);
quad quad_log(quad x); // x > 0
