// A search in an index, and what both ways through it have in common: that through
// points in order (pose_index_query.c) and that through settled ones (pose_index_query_packed.c).
#pragma once
#include "reenact/retrieval/pose_index_layout.h"

#include <string.h>

// What has to become part of a function that the compiler makes for several processors.
#define KERNEL inline __attribute__((always_inline))

// Twice as wide where the processor can; all is in whole numbers, so the answer is the same. The choice is made
// before the thread sanitizer is ready for it.
#if defined(__x86_64__) && !defined(__SANITIZE_THREAD__)
#define FOR_EACH_PROCESSOR __attribute__((target_clones("avx2", "default")))
#else
#define FOR_EACH_PROCESSOR
#endif

// What is looked for, in units.
struct quantized_query {
    int count; // of known positions
    int position[POSE_INDEX_MAX_POSITIONS];
    int16_t at[POSE_INDEX_MAX_POSITIONS][3]; // [position]
};

struct index_search {
    const struct pose_index *n;
    struct quantized_query target;
    double scale;
    pose_index_cost *cost;
    const void *context;
    int64_t best; // its slot; -1: none yet
    double best_m;
    int16_t limit; // the mark: bounds above this cannot lead to a better point, nor to a tie
};

// All of them in indexes of settled points.
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
    // Rounding puts each coordinate's difference off by less than a unit, so a
    // position's bound by less than 0.86 + 0.36 + 0.36 of it.
    double limit = cost / s->scale / s->n->unit_m + 1.6 * s->target.count + 1;
    s->limit = limit < MAX_SUM ? (int16_t)limit : MAX_SUM;
}

// What is going to be looked at is on its way before: takes are more than the near caches hold.
static KERNEL void fetch(const void *from, size_t bytes)
{
    for (size_t i = 0; i < bytes; i += CACHE_LINE_BYTES)
        __builtin_prefetch((const char *)from + i);
}

// ---------------------------------------------------------------- bounds

// Whole-number lower bound of the length of (x, y, z), all >= 0: their product
// with the unit vector (0.860, 0.360, 0.360), the largest first. On average it
// is 4 % short, at most 14 %.
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

// How far `at` is from sixteen boxes, at least, but no more than `most`.
static KERNEL void add_boxes(const struct box_lanes *b, const int16_t at[3], int16_t most, int16_t *restrict sums)
{
    for (int i = 0; i < LANES; i++) {
        int16_t d = length_at_least(interval_distance(b->low[0][i], b->high[0][i], at[0]),
                                    interval_distance(b->low[1][i], b->high[1][i], at[1]),
                                    interval_distance(b->low[2][i], b->high[2][i], at[2]));
        sums[i] = (int16_t)(sums[i] + (d < most ? d : most));
    }
}

// Likewise from `count` points, those of one axis in a row.
static KERNEL void add_points(const int16_t *x, const int16_t *y, const int16_t *z, int count, const int16_t at[3],
                              int16_t most, int16_t *restrict sums)
{
    for (int i = 0; i < count; i++) {
        int16_t d =
            length_at_least(abs_difference(x[i], at[0]), abs_difference(y[i], at[1]), abs_difference(z[i], at[2]));
        sums[i] = (int16_t)(sums[i] + (d < most ? d : most));
    }
}

// The bounds of `count` boxes into n->bounds; which is the least, -1: none. boxes: [sixteen boxes][position].
static KERNEL int64_t bound_all(struct index_search *s, const struct box_lanes *boxes, const int16_t *fixed_cost,
                                int64_t count)
{
    const struct pose_index *n = s->n;
    const struct quantized_query *w = &s->target;
    int64_t promising = -1;
    int16_t least = MAX_SUM;
    lanes leasts, where = {0}; // lane by lane, and in which sixteen modulo 2^15
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

// Bit i: sums[i] is at most `limit`; count: eight or sixteen. A branch for each would be guessed wrong too often.
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

// Of the sixteen boxes from `first` on, those whose bounds are low enough, as bits.
static KERNEL uint32_t boxes_within_limit(const struct index_search *s, int64_t first, int64_t count)
{
    return lowest(bits_within(s->n->bounds[first / LANES], LANES, s->limit), count - first);
}
