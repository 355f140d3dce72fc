// State and lower bounds of a search, shared by the search through points in the order of
// adding (pose_index_query.c) and through packed ones (pose_index_query_packed.c).
#pragma once
#include "reenact/retrieval/pose_index_layout.h"

#include <string.h>

// For functions that must be inlined into one compiled for several processors.
#define KERNEL inline __attribute__((always_inline))

// AVX2 where the processor has it; all is integer arithmetic, so the answer is the same. Not with the thread sanitizer:
// the choice is made before that is initialised.
#if defined(__x86_64__) && !defined(__SANITIZE_THREAD__)
#define FOR_EACH_PROCESSOR __attribute__((target_clones("avx2", "default")))
#else
#define FOR_EACH_PROCESSOR
#endif

// The query's positions in units.
struct quantized_query {
    int count; // of known positions, listed in `position`
    int position[POSE_INDEX_MAX_POSITIONS];
    int16_t at[POSE_INDEX_MAX_POSITIONS][3]; // [position]
};

struct index_search {
    const struct pose_index *n;
    struct quantized_query target;
    double scale;
    pose_index_cost *cost;
    const void *context;
    int64_t best; // slot of the best point so far; -1: none
    double best_m;
    int16_t limit; // upper bound of the search: bounds above this cannot lead to a better point, nor to a tie
};

// Of packed indexes only.
void pose_index_query_packed(struct index_search *searches, int count);

static inline void evaluate(struct index_search *s, int64_t slot)
{
    double cost = s->cost(s->context, slot);
    if (!(cost >= 0))
        return;
    if (s->best >= 0 &&
        (cost > s->best_m || (cost == s->best_m && pose_index_number(s->n, slot) > pose_index_number(s->n, s->best))))
        return;
    s->best = slot;
    s->best_m = cost;
    // Rounding errs by less than one unit in each coordinate's difference, so by less
    // than 0.86 + 0.36 + 0.36 units in a position's bound.
    double limit = cost / s->scale / s->n->unit_m + 1.6 * s->target.count + 1;
    s->limit = limit < MAX_SUM ? (int16_t)limit : MAX_SUM;
}

// Prefetches what will be used soon: takes are larger than the near caches.
static KERNEL void prefetch(const void *from, size_t bytes)
{
    for (size_t i = 0; i < bytes; i += CACHE_LINE_BYTES)
        __builtin_prefetch((const char *)from + i);
}

// ---------------------------------------------------------------- bounds

// Integer lower bound of the length of (x, y, z), all >= 0: the dot product with the
// unit vector (0.860, 0.360, 0.360), the largest component first. 4 % short on average,
// at most 14 %.
static inline int16_t length_at_least(int16_t x, int16_t y, int16_t z)
{
    int16_t larger = x > y ? x : y, largest = larger > z ? larger : z;
    uint16_t sum = (uint16_t)(x + y + z);
    return (int16_t)((largest >> 1) + (int16_t)(((uint32_t)sum * 23600) >> 16));
}

static inline int16_t abs_difference(int16_t a, int16_t b)
{
    int16_t d = (int16_t)(a - b), e = (int16_t)(b - a);
    return d > e ? d : e;
}

static inline int16_t interval_distance(int16_t low, int16_t high, int16_t at)
{
    int16_t below = (int16_t)(low - at), above = (int16_t)(at - high);
    int16_t most = below > above ? below : above;
    return most > 0 ? most : 0;
}

// Adds lower bounds of the distances of `at` from sixteen boxes, clamped to `most`.
static KERNEL void add_boxes(const struct box_lanes *b, const int16_t at[3], int16_t most, int16_t *restrict sums)
{
    for (int i = 0; i < LANES; i++) {
        int16_t d = length_at_least(interval_distance(b->low[0][i], b->high[0][i], at[0]),
                                    interval_distance(b->low[1][i], b->high[1][i], at[1]),
                                    interval_distance(b->low[2][i], b->high[2][i], at[2]));
        sums[i] = (int16_t)(sums[i] + (d < most ? d : most));
    }
}

// Coordinates of points, structure of arrays.
struct point_axes {
    const int16_t *x, *y, *z;
};

// Likewise of the distances of `at` from `count` points.
static KERNEL void add_points(struct point_axes p, int count, const int16_t at[3], int16_t most, int16_t *restrict sums)
{
    for (int i = 0; i < count; i++) {
        int16_t d = length_at_least(abs_difference(p.x[i], at[0]), abs_difference(p.y[i], at[1]),
                                    abs_difference(p.z[i], at[2]));
        sums[i] = (int16_t)(sums[i] + (d < most ? d : most));
    }
}

// Writes the lower bounds of `count` boxes into n->bounds; returns the box with the least, -1: none. boxes: [sixteen
// boxes][position].
static KERNEL int64_t bound_all(struct index_search *s, const struct box_lanes *boxes, const int16_t *fixed_cost,
                                int64_t count)
{
    const struct pose_index *n = s->n;
    const struct quantized_query *w = &s->target;
    int64_t promising = -1;
    int16_t least = MAX_SUM;
    lanes leasts, where = {0}; // minimum of each lane, and the number of its sixteen modulo 2^15
    for (int i = 0; i < LANES; i++)
        leasts[i] = MAX_SUM;
    for (int64_t g = 0; g < groups_of(count); g++) {
        int16_t *sums = n->bounds[g], here = (int16_t)(g & 0x7fff);
        memcpy(sums, fixed_cost + g * LANES, sizeof *n->bounds);
        for (int k = 0; k < w->count; k++)
            add_boxes(&boxes[g * n->positions + w->position[k]], w->at[w->position[k]], n->max_distance, sums);
        for (int i = 0; i < LANES; i++) {
            where[i] = sums[i] < leasts[i] ? here : where[i];
            leasts[i] = sums[i] < leasts[i] ? sums[i] : leasts[i];
        }
    }
    for (int i = 0; i < LANES; i++)
        if ((promising < 0 || leasts[i] < least) && where[i] * LANES + i < count) {
            least = leasts[i];
            promising = where[i] * LANES + i;
        }
    return promising;
}

// ---------------------------------------------------------------- bits

// Bit i: sums[i] <= limit; count: 8 or 16. Without branches, which would be mispredicted too often.
static KERNEL uint32_t bits_within(const int16_t *sums, int count, int16_t limit)
{
    uint8_t is[LANES];
    uint32_t bits = 0;
    for (int i = 0; i < count; i++)
        is[i] = sums[i] <= limit;
    for (int i = 0; i < count; i += 8) {
        // The i-th byte, 0 or 1, times 2^(56 - 7 i) is bit i of the product's highest byte; no two meet below it.
        uint64_t eight;
        memcpy(&eight, is + i, sizeof eight);
        bits |= (uint32_t)(eight * 0x0102040810204080 >> 56) << i;
    }
    return bits;
}

// Only the lowest `count` bits.
static inline uint32_t lowest(uint32_t bits, int64_t count) { return count < 32 ? bits & ((1u << count) - 1) : bits; }

// Bits of those of the sixteen boxes from `first` on whose bounds are within the limit.
static KERNEL uint32_t boxes_within_limit(const struct index_search *s, int64_t first, int64_t count)
{
    return lowest(bits_within(s->n->bounds[first / LANES], LANES, s->limit), count - first);
}
