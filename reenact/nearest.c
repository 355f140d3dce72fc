#include "reenact/nearest.h"

#include <stdlib.h>
#include <string.h>

enum {
    BLOCK = 8,        // points in a block: they share a box, and are bounded side by side
    LANES = 16,       // blocks in a group: their boxes are bounded side by side
    FAR = 8191,       // the farthest coordinate, units
    ANYWHERE = 24000, // a box this wide holds every place; its differences still fit 16 bits
    SUM_MOST = 32767,
    FIRST = 6,  // places that are looked at before most blocks are passed over
    STRIDE = 5, // and of the points of a block that is not, before it is passed over after all
};

typedef int16_t lanes[LANES];
typedef int16_t points_lanes[BLOCK];

// What has to become part of each of ask_all's versions.
#define KERNEL inline __attribute__((always_inline))

// The points of a block, or the boxes of a group of blocks.
struct box_lanes {
    lanes low[3], high[3];
};
struct point_lanes {
    points_lanes at[3];
};

struct nearest {
    int places;
    double unit_m;
    int64_t count, capacity;
    int16_t place_most;         // distances count up to this, so that their sum fits
    struct point_lanes *points; // [block][place]
    points_lanes *own;          // [block], units, the points'
    uint32_t *known;            // [block]: places known in every point
    struct box_lanes *boxes;    // [group][place]
    lanes *least_own;           // [group], the blocks'
    lanes *bounds;              // [group], nearest_find's working memory
};

static int64_t blocks_of(int64_t count) { return (count + BLOCK - 1) / BLOCK; }

static int64_t groups_of(int64_t blocks) { return (blocks + LANES - 1) / LANES; }

enum status nearest_open(struct nearest **out, int places, double unit_m, int64_t capacity)
{
    assert(places > 0 && places <= NEAREST_PLACES_MOST && unit_m > 0 && capacity >= 0);
    *out = NULL;
    struct nearest *n = calloc(1, sizeof *n);
    if (!n)
        return fail(ERR_MEMORY, "out of memory");
    *n = (struct nearest){.places = places, .unit_m = unit_m, .capacity = capacity};
    n->place_most = (int16_t)(SUM_MOST / (places + 1));
    // One more than needed, so that none is empty.
    size_t blocks = (size_t)blocks_of(capacity) + 1, groups = (size_t)groups_of((int64_t)blocks) + 1;
    n->points = calloc(blocks * (size_t)places, sizeof *n->points);
    n->own = calloc(blocks, sizeof *n->own);
    n->known = calloc(blocks, sizeof *n->known);
    n->boxes = calloc(groups * (size_t)places, sizeof *n->boxes);
    n->least_own = calloc(groups, sizeof *n->least_own);
    n->bounds = calloc(groups, sizeof *n->bounds);
    if (!n->points || !n->own || !n->known || !n->boxes || !n->least_own || !n->bounds) {
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
    free((*n)->own);
    free((*n)->known);
    free((*n)->boxes);
    free((*n)->least_own);
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

void nearest_add(struct nearest *n, const struct nearest_point *point)
{
    assert(n->count < n->capacity && point->own_m >= 0);
    int64_t block = n->count / BLOCK, group = block / LANES;
    int lane = (int)(n->count % BLOCK), lane_of_block = (int)(block % LANES);
    bool first = lane == 0;
    n->count++;
    n->known[block] = first ? point->known : n->known[block] & point->known;
    for (int p = 0; p < n->places; p++) {
        const double *place = &point->place[p].x;
        struct point_lanes *at = &n->points[block * n->places + p];
        struct box_lanes *box = &n->boxes[group * n->places + p];
        bool known = point->known >> p & 1;
        for (int axis = 0; axis < 3; axis++) {
            int16_t u = known ? units(place[axis], n->unit_m) : 0;
            int16_t low = known ? u : -ANYWHERE, high = known ? u : ANYWHERE;
            int16_t *box_low = &box->low[axis][lane_of_block], *box_high = &box->high[axis][lane_of_block];
            at->at[axis][lane] = u;
            if (first || low < *box_low)
                *box_low = low;
            if (first || high > *box_high)
                *box_high = high;
        }
    }
    int16_t own = own_units(n, point->own_m), *least = &n->least_own[group][lane_of_block];
    n->own[block][lane] = own;
    if (first || own < *least)
        *least = own;
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

static KERNEL void add_boxes(const struct nearest *n, int64_t group, const struct wanted *w, int from, int to,
                             int16_t *restrict sums)
{
    int16_t most = n->place_most;
    for (int k = from; k < to; k++) {
        const struct box_lanes *b = &n->boxes[group * n->places + w->place[k]];
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
        if (!(n->known[block] >> w->place[k] & 1))
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

// Whether any of the sums is at most `limit`.
static KERNEL bool within(const lanes sums, int16_t limit)
{
    lanes low;
    uint64_t fours[LANES / 4];
    for (int i = 0; i < LANES; i++)
        low[i] = sums[i] <= limit ? -1 : 0;
    memcpy(fours, low, sizeof low);
    return fours[0] | fours[1] | fours[2] | fours[3];
}

static KERNEL bool points_within(const points_lanes sums, int16_t limit)
{
    points_lanes low;
    uint64_t fours[BLOCK / 4];
    for (int i = 0; i < BLOCK; i++)
        low[i] = sums[i] <= limit ? -1 : 0;
    memcpy(fours, low, sizeof low);
    return fours[0] | fours[1];
}

// ---------------------------------------------------------------- finding

struct search {
    const struct nearest *n;
    struct wanted wanted;
    double scale;
    nearest_cost *cost;
    const void *context;
    int64_t best; // -1: none yet
    double best_m;
    int16_t limit; // bounds above this cannot lead to a better point, nor to a tie
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

static KERNEL void ask_block(struct search *s, int64_t block)
{
    const struct nearest *n = s->n;
    points_lanes sums;
    memcpy(sums, n->own[block], sizeof sums);
    for (int k = 0, to; k < s->wanted.count; k = to) {
        to = k + STRIDE < s->wanted.count ? k + STRIDE : s->wanted.count;
        add_points(n, block, &s->wanted, k, to, sums);
        if (!points_within(sums, s->limit))
            return;
    }
    int64_t first = block * BLOCK, left = n->count - first;
    for (int i = 0; i < BLOCK && i < left; i++)
        if (sums[i] <= s->limit)
            ask(s, first + i);
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
        add_boxes(n, g, &s->wanted, 0, first, sums);
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
    ask_promising(s, first);
    for (int64_t b = 0; b < blocks; b += LANES) {
        int16_t *sums = n->bounds[b / LANES];
        if (!within(sums, s->limit))
            continue;
        if (first < s->wanted.count) {
            add_boxes(n, b / LANES, &s->wanted, first, s->wanted.count, sums);
            if (!within(sums, s->limit))
                continue;
        }
        for (int i = 0; i < LANES && b + i < blocks; i++)
            if (sums[i] <= s->limit)
                ask_block(s, b + i);
    }
}

enum status nearest_find(struct nearest *n, const struct nearest_point *wanted, double scale, nearest_cost *cost,
                         const void *context, int64_t *number, double *cost_m)
{
    assert(scale > 0);
    struct search s = {n, wanted_of(n, wanted), scale, cost, context, -1, 0, SUM_MOST};
    ask_all(&s);
    if (s.best < 0)
        return NOTHING;
    *number = s.best;
    *cost_m = s.best_m;
    return OK;
}
