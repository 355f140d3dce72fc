// A value held within a range. Where the range is empty, the lower end wins; not a number stays what it is. Pure.
#pragma once
#include <stdint.h>

static inline int clamp_int(int value, int low, int high)
{
    if (value < low)
        return low;
    return value > high ? high : value;
}

static inline int64_t clamp_int64(int64_t value, int64_t low, int64_t high)
{
    if (value < low)
        return low;
    return value > high ? high : value;
}

static inline float clamp_float(float value, float low, float high)
{
    if (value < low)
        return low;
    return value > high ? high : value;
}

static inline double clamp_double(double value, double low, double high)
{
    if (value < low)
        return low;
    return value > high ? high : value;
}
