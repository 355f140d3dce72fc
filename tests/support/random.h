// Numbers for test inputs. Each in a statement of its own, or compilers throw them in different orders.
#pragma once
#include "base/geometry.h"

#include <math.h>
#include <stdint.h>

// A small generator for test inputs, the same on every machine. Seed it, print the seed.
struct dice {
    uint64_t state;
};

static inline double dice_uniform(struct dice *dice) // [0, 1)
{
    // splitmix64 (Steele, Lea and Flood 2014)
    uint64_t z = (dice->state += 0x9e3779b97f4a7c15u);
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
    return (double)((z ^ (z >> 31)) >> 11) * 0x1p-53;
}

static inline double dice_between(struct dice *dice, double low, double high)
{
    return low + (high - low) * dice_uniform(dice);
}

static inline double dice_normal(struct dice *dice) // mean 0, standard deviation 1
{
    double u = 1 - dice_uniform(dice), v = dice_uniform(dice);
    return sqrt(-2 * log(u)) * cos(6.283185307179586 * v);
}

static inline struct vec3 dice_normal3(struct dice *dice, double sigma) // each coordinate
{
    double x = dice_normal(dice), y = dice_normal(dice), z = dice_normal(dice);
    return v3_scale(v3(x, y, z), sigma);
}

static inline struct vec3 dice_within(struct dice *dice, struct vec3 most) // each coordinate within as much of 0
{
    double x = dice_between(dice, -most.x, most.x), y = dice_between(dice, -most.y, most.y),
           z = dice_between(dice, -most.z, most.z);
    return v3(x, y, z);
}
