// The smaller and the larger of two, without libm's NaN handling, which costs a function call. Internal to tests/world.
#pragma once

static inline float minf(float a, float b) { return a < b ? a : b; }
static inline float maxf(float a, float b) { return a > b ? a : b; }
static inline double least(double a, double b) { return a < b ? a : b; }
static inline double most(double a, double b) { return a > b ? a : b; }
