// The textbook formulas in float, double and 113 bits.
#include "base/portable_math.h"
#include "tests/stability/stability.h"

#include <math.h>

#define FN(name) name##_float
#define REAL     float
static float root_float(float x) { return sqrtf(x); }
static float sine_float(float x) { return (float)portable_sin((double)x); }
static float cosine_float(float x) { return (float)portable_cos((double)x); }
static float arc_cosine_float(float x) { return (float)portable_acos((double)x); }
static float arc_sine_float(float x) { return (float)portable_asin((double)x); }
#include "tests/stability/plain.inl"
#undef FN
#undef REAL

#define FN(name) name##_double
#define REAL     double
static double root_double(double x) { return sqrt(x); }
static double sine_double(double x) { return portable_sin(x); }
static double cosine_double(double x) { return portable_cos(x); }
static double arc_cosine_double(double x) { return portable_acos(x); }
static double arc_sine_double(double x) { return portable_asin(x); }
#include "tests/stability/plain.inl"
#undef FN
#undef REAL

#define FN(name) name##_quad
#define REAL     quad
static quad root_quad(quad x) { return quad_sqrt(x); }
static quad sine_quad(quad x) { return quad_sin(x); }
static quad cosine_quad(quad x) { return quad_cos(x); }
static quad arc_cosine_quad(quad x) { return quad_acos(x); }
static quad arc_sine_quad(quad x) { return quad_asin(x); }
#include "tests/stability/plain.inl"
#undef FN
#undef REAL

// What the series and the fixed point approximate.
static void exp_reference(const quad *in, quad *out) { out[0] = quad_exp(in[0]); }
static void sin_reference(const quad *in, quad *out) { out[0] = quad_sin(in[0]); }

static void undistort_reference(const quad *in, quad *out)
{
    const quad xd = (in[0] - in[3]) / in[2], yd = (in[1] - in[3]) / in[2], rd = quad_sqrt(xd * xd + yd * yd);
    quad r = rd;
    for (int i = 0; i < 60; i++) { // Newton on the radius
        const quad r2 = r * r;
        r -= (r * (1 + r2 * (in[4] + r2 * in[5])) - rd) / (1 + r2 * (3 * in[4] + 5 * r2 * in[5]));
    }
    out[0] = xd * r / rd;
    out[1] = yd * r / rd;
}

#define PLAIN_WITH(name, inputs, values, reference)                                                                    \
    const struct plain plain_##name = {inputs, values, name##_float, name##_double, name##_quad, reference}
#define PLAIN(name, inputs, values) PLAIN_WITH(name, inputs, values, name##_quad)

PLAIN(exp_map, 3, 4);
PLAIN(log_map, 4, 3);
PLAIN(slerp, 4, 3);
PLAIN(turn_between, 6, 3);
PLAIN(from_matrix, 4, 3);
PLAIN(angle_between, 6, 1);
PLAIN(unit, 3, 3);
PLAIN(unit_quat, 4, 4);
PLAIN(project, 7, 2);
PLAIN_WITH(undistort, 6, 2, undistort_reference);
PLAIN(there_and_back, 3, 3);
PLAIN(hypot, 2, 1);
PLAIN_WITH(exp, 1, 1, exp_reference);
PLAIN_WITH(sin, 1, 1, sin_reference);
PLAIN(elbow, 3, 1);
PLAIN(asin_half_width, 2, 1);
PLAIN(sum_of_steps, 2, 1);
PLAIN(square_range, 9, 1);
PLAIN(solve2, 2, 1);
PLAIN(variance_along, 2, 1);
PLAIN(row_time, 3, 1);
PLAIN(triangulate, 2, 1);
