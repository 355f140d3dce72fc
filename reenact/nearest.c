#include "reenact/nearest_index.h"

#include <stdlib.h>
#include <string.h>

enum {
    FIRST = 6,  // places that are looked at before most blocks are passed over
    STRIDE = 5, // and of the points of a block that is not, before it is passed over after all
    LINE = 64,  // bytes that the caches move at once
};

// What has to become part of each of ask_all's versions.
#define KERNEL inline __attribute__((always_inline))

// Zeros from the first byte of a line on.
static void *cleared(size_t bytes)
{
    bytes = (bytes + LINE - 1) / LINE * LINE;
    void *zeros = aligned_alloc(LINE, bytes);
    return zeros ? memset(zeros, 0, bytes) : NULL;
}

enum status nearest_open(struct nearest **out, int places, double unit_m, int64_t capacity)
{
    assert(places > 0 && places <= NEAREST_PLACES_MOST && unit_m > 0 && capacity >= 0 && capacity < UINT32_MAX);
    *out = NULL;
    struct nearest *n = calloc(1, sizeof *n);
    if (!n)
        return fail(ERR_MEMORY, "out of memory");
    *n = (struct nearest){.places = places, .unit_m = unit_m, .capacity = capacity};
    n->place_most = (int16_t)(SUM_MOST / (places + 1));
    // One more than needed, so that none is empty.
    size_t blocks = (size_t)blocks_of(capacity) + 1, groups = (size_t)groups_of((int64_t)blocks) + 1;
    n->points = cleared(blocks * (size_t)places * sizeof *n->points);
    n->heads = cleared(blocks * sizeof *n->heads);
    n->boxes = cleared(groups * (size_t)places * sizeof *n->boxes);
    n->least_own = cleared(groups * sizeof *n->least_own);
    n->bounds = cleared(groups * sizeof *n->bounds);
    if (!n->points || !n->heads || !n->boxes || !n->least_own || !n->bounds) {
        nearest_close(&n);
        return fail(ERR_MEMORY, "out of memory");
    }
    *out = n;
    return OK;
}

void nearest_close(struct nearest **n)
{
    if (!*n)
        return;
    free((*n)->points);
    free((*n)->heads);
    free((*n)->boxes);
    free((*n)->least_own);
    free((*n)->wide_boxes);
    free((*n)->wide_own);
    free((*n)->bounds);
    free(*n);
    *n = NULL;
}

// ---------------------------------------------------------------- adding

static int16_t units(double m, double unit_m)
{
    double u = m / unit_m;
    u = !(u > -FAR) ? -FAR : u > FAR ? FAR : u; // a NaN, too, is somewhere
    return (int16_t)(u < 0 ? u - 0.5 : u + 0.5);
}

static int16_t own_units(const struct nearest *n, double own_m)
{
    double u = own_m / n->unit_m;
    return u < n->place_most ? (int16_t)u : n->place_most;
}

// Makes a group's box, in the sixteen it belongs to, hold one of its blocks.
static void widen(struct nearest *n, int64_t block)
{
    int64_t group = block / LANES, wide = group / LANES;
    int lane = (int)(group % LANES), of_block = (int)(block % LANES);
    bool first = of_block == 0;
    for (int p = 0; p < n->places; p++) {
        const struct box_lanes *from = &n->boxes[group * n->places + p];
        struct box_lanes *to = &n->wide_boxes[wide * n->places + p];
        for (int axis = 0; axis < 3; axis++) {
            int16_t low = from->low[axis][of_block], high = from->high[axis][of_block];
            if (first || low < to->low[axis][lane])
                to->low[axis][lane] = low;
            if (first || high > to->high[axis][lane])
                to->high[axis][lane] = high;
        }
    }
    if (first || n->least_own[group][of_block] < n->wide_own[wide][lane])
        n->wide_own[wide][lane] = n->least_own[group][of_block];
}

void nearest_put(struct nearest *n, int64_t number, int16_t (*places)[3], uint32_t known, int16_t own)
{
    int64_t block = n->count / BLOCK, group = block / LANES;
    int lane = (int)(n->count % BLOCK), lane_of_block = (int)(block % LANES);
    bool first = lane == 0;
    n->count++;
    n->heads[block].numbers[lane] = (uint32_t)number;
    n->heads[block].known = first ? known : n->heads[block].known & known;
    for (int p = 0; p < n->places; p++) {
        struct point_lanes *at = &n->points[block * n->places + p];
        struct box_lanes *box = &n->boxes[group * n->places + p];
        bool is_known = known >> p & 1;
        for (int axis = 0; axis < 3; axis++) {
            int16_t u = places[p][axis];
            int16_t low = is_known ? u : -ANYWHERE, high = is_known ? u : ANYWHERE;
            int16_t *box_low = &box->low[axis][lane_of_block], *box_high = &box->high[axis][lane_of_block];
            at->at[axis][lane] = u;
            if (first || low < *box_low)
                *box_low = low;
            if (first || high > *box_high)
                *box_high = high;
        }
    }
    int16_t *least = &n->least_own[group][lane_of_block];
    n->heads[block].own[lane] = own;
    if (first || own < *least)
        *least = own;
    if (n->wide_boxes)
        widen(n, block);
}

void nearest_add(struct nearest *n, const struct nearest_point *point)
{
    assert(n->count < n->capacity && point->own_m >= 0);
    int16_t at[NEAREST_PLACES_MOST][3] = {{0}};
    for (int p = 0; p < n->places; p++)
        if (point->known >> p & 1)
            for (int axis = 0; axis < 3; axis++)
                at[p][axis] = units((&point->place[p].x)[axis], n->unit_m);
    nearest_put(n, n->count, at, point->known, own_units(n, point->own_m));
}

// ---------------------------------------------------------------- bounds

// What is looked for, in units, its known places only.
struct wanted {
    int count;
    int place[NEAREST_PLACES_MOST];
    int16_t at[NEAREST_PLACES_MOST][3];
};

// Whole-number lower bound of the length of (x, y, z), all >= 0: their product
// with the unit vector (0.860, 0.360, 0.360), the largest first. On average it
// is 4 % short, at most 14 %.
static inline int16_t length_at_least(int16_t x, int16_t y, int16_t z)
{
    int16_t larger = x > y ? x : y, largest = larger > z ? larger : z;
    uint16_t sum = (uint16_t)(x + y + z);
    return (int16_t)((largest >> 1) + (int16_t)(((uint32_t)sum * 23600) >> 16));
}

static inline int16_t outside(int16_t low, int16_t high, int16_t at)
{
    int16_t below = (int16_t)(low - at), above = (int16_t)(at - high);
    int16_t most = below > above ? below : above;
    return most > 0 ? most : 0;
}

// boxes: of the first place.
static KERNEL void add_boxes(const struct nearest *n, const struct box_lanes *boxes, const struct wanted *w, int from,
                             int to, int16_t *restrict sums)
{
    int16_t most = n->place_most;
    for (int k = from; k < to; k++) {
        const struct box_lanes *b = &boxes[w->place[k]];
        const int16_t *at = w->at[k];
        for (int i = 0; i < LANES; i++) {
            int16_t d = length_at_least(outside(b->low[0][i], b->high[0][i], at[0]),
                                        outside(b->low[1][i], b->high[1][i], at[1]),
                                        outside(b->low[2][i], b->high[2][i], at[2]));
            sums[i] = (int16_t)(sums[i] + (d < most ? d : most));
        }
    }
}

static inline int16_t apart(int16_t a, int16_t b)
{
    int16_t d = (int16_t)(a - b), e = (int16_t)(b - a);
    return d > e ? d : e;
}

static KERNEL void add_points(const struct nearest *n, int64_t block, const struct wanted *w, int from, int to,
                              int16_t *restrict sums)
{
    int16_t most = n->place_most;
    for (int k = from; k < to; k++) {
        if (!(n->heads[block].known >> w->place[k] & 1))
            continue;
        const struct point_lanes *p = &n->points[block * n->places + w->place[k]];
        const int16_t *at = w->at[k];
        for (int i = 0; i < BLOCK; i++) {
            int16_t d =
                length_at_least(apart(p->at[0][i], at[0]), apart(p->at[1][i], at[1]), apart(p->at[2][i], at[2]));
            sums[i] = (int16_t)(sums[i] + (d < most ? d : most));
        }
    }
}

// Bit i: sums[i] is at most `limit`. A branch for each sum would be guessed wrong too often.
static KERNEL uint32_t within(const lanes sums, int16_t limit)
{
    lanes low;
    uint64_t fours[LANES / 4];
    for (int i = 0; i < LANES; i++)
        low[i] = (int16_t)(sums[i] <= limit ? 1 << i : 0);
    memcpy(fours, low, sizeof low);
    uint64_t bits = fours[0] | fours[1] | fours[2] | fours[3];
    bits |= bits >> 32;
    return (bits | bits >> 16) & 0xffff;
}

static KERNEL uint32_t points_within(const points_lanes sums, int16_t limit)
{
    points_lanes low;
    uint64_t fours[BLOCK / 4];
    for (int i = 0; i < BLOCK; i++)
        low[i] = (int16_t)(sums[i] <= limit ? 1 << i : 0);
    memcpy(fours, low, sizeof low);
    uint64_t bits = fours[0] | fours[1];
    bits |= bits >> 32;
    return (bits | bits >> 16) & 0xffff;
}

// Of those whose bits are set, one or more, that with the least sum.
static inline int least_of(const int16_t *sums, uint32_t bits)
{
    int least = __builtin_ctz(bits);
    for (bits &= bits - 1; bits; bits &= bits - 1) {
        int i = __builtin_ctz(bits);
        least = sums[i] < sums[least] ? i : least;
    }
    return least;
}

// Only the lowest `count` bits.
static inline uint32_t lowest(uint32_t bits, int64_t count) { return count < 32 ? bits & ((1u << count) - 1) : bits; }

// ---------------------------------------------------------------- finding

// Points of the group looked at last that are yet to be asked, and their bounds.
struct pending {
    int count;
    int64_t numbers[LANES * BLOCK];
    int16_t bounds[LANES * BLOCK];
};

// Blocks of the group before that are yet to be looked at, and their bounds.
struct waiting {
    int64_t first;
    uint32_t bits;
    lanes sums;
};

struct search {
    const struct nearest *n;
    struct wanted wanted;
    double scale;
    nearest_cost *cost;
    const void *context;
    int64_t best; // -1: none yet
    double best_m;
    int16_t limit; // bounds above this cannot lead to a better point, nor to a tie
    struct pending *pending;
    struct waiting waiting;
};

static void ask(struct search *s, int64_t number)
{
    double cost = s->cost(s->context, number);
    if (!(cost >= 0) || (s->best >= 0 && (cost > s->best_m || (cost == s->best_m && number > s->best))))
        return;
    s->best = number;
    s->best_m = cost;
    // Rounding puts each coordinate's difference off by less than a unit, so a
    // place's bound by less than 0.86 + 0.36 + 0.36 of it.
    double limit = cost / s->scale / s->n->unit_m + 1.6 * s->wanted.count + 1;
    s->limit = limit < SUM_MOST ? (int16_t)limit : SUM_MOST;
}

// The points of a block whose bounds are low enough, as bits.
static KERNEL uint32_t near_points(const struct search *s, int64_t block, points_lanes sums)
{
    const struct nearest *n = s->n;
    memcpy(sums, n->heads[block].own, sizeof(points_lanes));
    uint32_t bits = points_within(sums, s->limit);
    for (int k = 0, to; k < s->wanted.count && bits; k = to) {
        to = k + STRIDE < s->wanted.count ? k + STRIDE : s->wanted.count;
        add_points(n, block, &s->wanted, k, to, sums);
        bits = points_within(sums, s->limit);
    }
    return lowest(bits, n->count - block * BLOCK);
}

// That with the least bound comes first: mostly, none of the others need be asked then.
static KERNEL void ask_block(struct search *s, int64_t block)
{
    points_lanes sums;
    uint32_t bits = near_points(s, block, sums);
    while (bits) {
        int i = least_of(sums, bits);
        ask(s, s->n->heads[block].numbers[i]);
        bits &= ~(1u << i) & points_within(sums, s->limit);
    }
}

// What the cost of a point is worked out from is rarely in the near caches: it is on its way while the next blocks are
// looked at.
static KERNEL void ask_later(struct search *s, int64_t block)
{
    const struct nearest *n = s->n;
    struct pending *pending = s->pending;
    points_lanes sums;
    for (uint32_t bits = near_points(s, block, sums); bits; bits &= bits - 1) {
        int i = __builtin_ctz(bits);
        int64_t number = n->heads[block].numbers[i];
        pending->numbers[pending->count] = number;
        pending->bounds[pending->count++] = sums[i];
        for (size_t at = 0; at < n->cost_bytes; at += LINE)
            __builtin_prefetch(n->costs_from + (size_t)number * n->cost_bytes + at);
    }
}

static void ask_pending(struct search *s)
{
    struct pending *p = s->pending;
    int least = 0;
    for (int i = 1; i < p->count; i++)
        least = p->bounds[i] < p->bounds[least] ? i : least;
    if (p->count > 0)
        ask(s, p->numbers[least]);
    for (int i = 0; i < p->count; i++)
        if (i != least && p->bounds[i] <= s->limit)
            ask(s, p->numbers[i]);
    p->count = 0;
}

static struct wanted wanted_of(const struct nearest *n, const struct nearest_point *point)
{
    struct wanted w = {0};
    for (int p = 0; p < n->places; p++) {
        if (!(point->known >> p & 1))
            continue;
        const double *place = &point->place[p].x;
        for (int axis = 0; axis < 3; axis++)
            w.at[w.count][axis] = units(place[axis], n->unit_m);
        w.place[w.count++] = p;
    }
    return w;
}

// The first places of every block, then the block that looks best by them: it sets the mark for all.
static KERNEL void ask_promising(struct search *s, int first)
{
    const struct nearest *n = s->n;
    int64_t blocks = blocks_of(n->count), groups = groups_of(blocks), promising = -1;
    int16_t least = SUM_MOST;
    lanes leasts, where = {0}; // lane by lane, and in which group modulo 2^15
    for (int i = 0; i < LANES; i++)
        leasts[i] = SUM_MOST;
    for (int64_t g = 0; g < groups; g++) {
        int16_t *sums = n->bounds[g], here = (int16_t)(g & 0x7fff);
        memcpy(sums, n->least_own[g], sizeof *n->bounds);
        add_boxes(n, &n->boxes[g * n->places], &s->wanted, 0, first, sums);
        for (int i = 0; i < LANES; i++) {
            where[i] = sums[i] < leasts[i] ? here : where[i];
            leasts[i] = sums[i] < leasts[i] ? sums[i] : leasts[i];
        }
    }
    for (int i = 0; i < LANES; i++)
        if (leasts[i] < least && where[i] * LANES + i < blocks) {
            least = leasts[i];
            promising = where[i] * LANES + i;
        }
    if (promising >= 0)
        ask_block(s, promising);
}

// Several indexes that are searched in turn are more than the near caches hold: what is going to be looked at is on
// its way before.
static KERNEL void fetch_block(const struct nearest *n, int64_t block)
{
    const char *points = (const char *)&n->points[block * n->places];
    for (size_t i = 0; i < (size_t)n->places * sizeof *n->points; i += LINE)
        __builtin_prefetch(points + i);
    __builtin_prefetch(&n->heads[block]);
}

// Those of the last two groups, whose points and costs are here by now.
static KERNEL void ask_waiting(struct search *s)
{
    struct waiting *w = &s->waiting;
    ask_pending(s);
    for (uint32_t bits = w->bits & within(w->sums, s->limit); bits; bits &= bits - 1)
        ask_later(s, w->first + __builtin_ctz(bits));
    w->bits = 0;
}

// The block whose box is nearest comes first where there is no mark yet: it sets one for the others. They are looked
// at when the next group's are on their way.
static KERNEL void ask_group(struct search *s, int64_t group)
{
    const struct nearest *n = s->n;
    int64_t first = group * LANES;
    lanes sums;
    memcpy(sums, n->least_own[group], sizeof *n->least_own);
    add_boxes(n, &n->boxes[group * n->places], &s->wanted, 0, s->wanted.count, sums);
    uint32_t bits = lowest(within(sums, s->limit), blocks_of(n->count) - first);
    if (!bits)
        return;
    for (uint32_t left = bits; left; left &= left - 1)
        fetch_block(n, first + __builtin_ctz(left));
    ask_waiting(s);
    if (s->best < 0) {
        int best = least_of(sums, bits);
        ask_block(s, first + best);
        bits &= ~(1u << best);
    }
    s->waiting.first = first;
    s->waiting.bits = bits;
    memcpy(s->waiting.sums, sums, sizeof sums);
}

// Where groups are settled: those whose box is near enough. First the block to which the nearest boxes lead.
static KERNEL void ask_settled(struct search *s)
{
    const struct nearest *n = s->n;
    int64_t blocks = blocks_of(n->count), groups = groups_of(blocks), promising = 0;
    int16_t least = SUM_MOST;
    for (int64_t g = 0; g < groups; g += LANES) {
        int16_t *wide = n->bounds[g / LANES];
        memcpy(wide, n->wide_own[g / LANES], sizeof *n->wide_own);
        add_boxes(n, &n->wide_boxes[g / LANES * n->places], &s->wanted, 0, s->wanted.count, wide);
        uint32_t bits = lowest(within(wide, least), groups - g);
        if (bits) {
            int i = least_of(wide, bits);
            least = wide[i];
            promising = g + i;
        }
    }
    if (groups > 0)
        ask_group(s, promising);
    for (int64_t g = 0; g < groups; g += LANES) {
        const int16_t *wide = n->bounds[g / LANES];
        for (uint32_t bits = lowest(within(wide, s->limit), groups - g); bits; bits &= bits - 1) {
            int i = __builtin_ctz(bits);
            if (g + i != promising && wide[i] <= s->limit)
                ask_group(s, g + i);
        }
    }
    ask_waiting(s);
    ask_pending(s);
}

#if defined(__x86_64__) && !defined(__SANITIZE_THREAD__)
// Twice as wide where the processor can; all is in whole numbers, so the answer is the same. The choice is made
// before the thread sanitizer is ready for it.
__attribute__((target_clones("avx2", "default")))
#endif
static void
ask_all(struct search *s)
{
    const struct nearest *n = s->n;
    int64_t blocks = blocks_of(n->count);
    int first = s->wanted.count < FIRST ? s->wanted.count : FIRST;
    if (n->wide_boxes) {
        ask_settled(s);
        return;
    }
    ask_promising(s, first);
    for (int64_t b = 0; b < blocks; b += LANES) {
        int16_t *sums = n->bounds[b / LANES];
        if (!within(sums, s->limit))
            continue;
        if (first < s->wanted.count) {
            add_boxes(n, &n->boxes[b / LANES * n->places], &s->wanted, first, s->wanted.count, sums);
            if (!within(sums, s->limit))
                continue;
        }
        for (uint32_t bits = lowest(within(sums, s->limit), blocks - b); bits; bits &= bits - 1) {
            int i = __builtin_ctz(bits);
            if (sums[i] <= s->limit)
                ask_block(s, b + i);
        }
    }
}

enum status nearest_find(struct nearest *n, const struct nearest_point *wanted, double scale, nearest_cost *cost,
                         const void *context, int64_t *number, double *cost_m)
{
    assert(scale > 0);
    struct pending pending;
    pending.count = 0; // the rest means nothing yet
    struct search s = {n, wanted_of(n, wanted), scale, cost, context, -1, 0, SUM_MOST, &pending, {0}};
    ask_all(&s);
    if (s.best < 0)
        return NOTHING;
    *number = s.best;
    *cost_m = s.best_m;
    return OK;
}
