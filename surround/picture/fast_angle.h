// Angles to 1e-5 rad from adding, multiplying and dividing only, so that they are the same everywhere; for pixels
// (0.003 pixels of a panorama 2048 wide).
#pragma once
#include <math.h>

// The arc's tangent t in 0..1, s its square, of numbers or of vectors: odd polynomial of least largest error.
#define FAST_ATAN(t, s)                                                                                                \
    (((((((-0.01172120f * (s) + 0.05265332f) * (s)-0.11643287f) * (s) + 0.19354346f) * (s)-0.33262347f) * (s)) +       \
      0.99997726f) *                                                                                                   \
     (t))

// The integer at or below a number within an int's range; libm's floor is a call.
static inline int floor_of(float a)
{
    const int whole = (int)a;
    return whole - ((float)whole > a);
}

// -pi..pi; of (0, 0) 0.
static inline float fast_atan2(float y, float x)
{
    const float ax = fabsf(x), ay = fabsf(y);
    const float max = ax > ay ? ax : ay, min = ax > ay ? ay : ax;
    const float t = min / (max > 0 ? max : 1), s = t * t;
    float a = FAST_ATAN(t, s);
    if (ay > ax)
        a = 1.57079633f - a;
    if (x < 0)
        a = 3.14159265f - a;
    return y < 0 ? -a : a;
}
