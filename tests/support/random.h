// Pseudo-random numbers for test inputs. Draw each in a statement of its own: the order in which a call's arguments are
// evaluated differs between compilers.
#pragma once
#include "base/geometry.h"

#include <math.h>
#include <stdint.h>

// A small generator, the same on every machine (splitmix64). Seed it and print the seed.
struct rng {
    uint64_t state;
};

// Of film `index` of a seed: the two are mixed by splitmix64's finaliser, so that neighbouring films share nothing.
static inline struct rng rng_of(uint64_t seed, int index)
{
    uint64_t z = seed * 0xd1342543de82ef95u + (uint64_t)index + 1;
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
    return (struct rng){z ^ (z >> 31)};
}

static inline double rng_uniform(struct rng *rng) // [0, 1)
{
    // splitmix64 (Steele, Lea and Flood 2014)
    uint64_t z = (rng->state += 0x9e3779b97f4a7c15u);
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
    return (double)((z ^ (z >> 31)) >> 11) * 0x1p-53;
}

static inline double rng_between(struct rng *rng, double low, double high)
{
    return low + (high - low) * rng_uniform(rng);
}

static inline int rng_pick(struct rng *rng, int count) // 0 to count - 1
{
    const int i = (int)(rng_uniform(rng) * count);
    return i < count ? i : count - 1;
}

static inline double rng_normal(struct rng *rng) // mean 0, standard deviation 1
{
    double u = 1 - rng_uniform(rng), v = rng_uniform(rng);
    return sqrt(-2 * log(u)) * cos(6.283185307179586 * v);
}

static inline struct vec3 rng_normal3(struct rng *rng, double sigma) // each coordinate
{
    double x = rng_normal(rng), y = rng_normal(rng), z = rng_normal(rng);
    return v3_scale(v3(x, y, z), sigma);
}

static inline struct vec3 rng_within(struct rng *rng, struct vec3 most) // each coordinate uniform within +-most
{
    double x = rng_between(rng, -most.x, most.x), y = rng_between(rng, -most.y, most.y),
           z = rng_between(rng, -most.z, most.z);
    return v3(x, y, z);
}
