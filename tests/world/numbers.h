// The smaller and the larger of two, and whole numbers beside one, without libm's handling of NaN and of what does not
// fit into an int, which costs a function call. Internal to tests/world.
#pragma once

static inline float minf(float a, float b) { return a < b ? a : b; }
static inline float maxf(float a, float b) { return a > b ? a : b; }
static inline double least(double a, double b) { return a < b ? a : b; }
static inline double most(double a, double b) { return a > b ? a : b; }

// The largest whole number that is not above x, and the smallest that is not below.
static inline int floor_int(double x) { return (int)x - (x < (int)x); }
static inline int ceil_int(double x) { return (int)x + (x > (int)x); }
