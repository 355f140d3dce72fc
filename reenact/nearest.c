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
    int64_t (*numbers)[BLOCK];  // [block]
    // Once settled: the boxes of whole groups, sixteen side by side.
    struct box_lanes *wide_boxes; // [sixteen groups][place]
    lanes *wide_own;              // [sixteen groups], the groups'
    lanes *bounds;                // [group], nearest_find's working memory
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
    n->numbers = calloc(blocks, sizeof *n->numbers);
    n->bounds = calloc(groups, sizeof *n->bounds);
    if (!n->points || !n->own || !n->known || !n->boxes || !n->least_own || !n->numbers || !n->bounds) {
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
    free((*n)->numbers);
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

// The next point, in units.
static void put(struct nearest *n, int64_t number, int16_t (*places)[3], uint32_t known, int16_t own)
{
    int64_t block = n->count / BLOCK, group = block / LANES;
    int lane = (int)(n->count % BLOCK), lane_of_block = (int)(block % LANES);
    bool first = lane == 0;
    n->count++;
    n->numbers[block][lane] = number;
    n->known[block] = first ? known : n->known[block] & known;
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
    n->own[block][lane] = own;
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
    put(n, n->count, at, point->known, own_units(n, point->own_m));
}

// ---------------------------------------------------------------- settling

// A point's coordinate in one dimension (place and axis); those in blocks where it is unknown come first.
static int16_t key_of(const struct nearest *n, int64_t point, int dimension)
{
    int64_t block = point / BLOCK;
    int place = dimension / 3;
    bool known = n->known[block] >> place & 1;
    return known ? n->points[block * n->places + place].at[dimension % 3][point % BLOCK] : -ANYWHERE;
}

// Where they are spread most: the largest variance.
static int widest_dimension(const struct nearest *n, const int64_t *points, int64_t count)
{
    int widest = 0;
    double most = -1;
    for (int d = 0; d < 3 * n->places; d++) {
        int64_t sum = 0, squares = 0;
        for (int64_t i = 0; i < count; i++) {
            int64_t key = key_of(n, points[i], d);
            sum += key;
            squares += key * key;
        }
        double spread = (double)squares - (double)sum / (double)count * (double)sum;
        if (spread > most) {
            most = spread;
            widest = d;
        }
    }
    return widest;
}

// Whether point a comes before b: no two are alike.
static bool before(const struct nearest *n, int dimension, int64_t a, int64_t b)
{
    int16_t at_a = key_of(n, a, dimension), at_b = key_of(n, b, dimension);
    return at_a < at_b || (at_a == at_b && a < b);
}

// Hoare's selection: no point before `middle` comes after one from there on.
static void divide(const struct nearest *n, int dimension, int64_t *points, int64_t count, int64_t middle)
{
    int64_t low = 0, high = count - 1;
    while (low < high) {
        int64_t pivot = points[low + (high - low) / 2], i = low, j = high;
        while (i <= j) {
            while (before(n, dimension, points[i], pivot))
                i++;
            while (before(n, dimension, pivot, points[j]))
                j--;
            if (i <= j) {
                int64_t swapped = points[i];
                points[i++] = points[j];
                points[j--] = swapped;
            }
        }
        if (middle <= j)
            high = j;
        else if (middle >= i)
            low = i;
        else
            return;
    }
}

// Halves, across the widest dimension, until a half is a block: a k-d tree, but halves end where groups and blocks do.
static void order(const struct nearest *n, int64_t *points, int64_t count)
{
    while (count > BLOCK) {
        int64_t group = LANES * BLOCK, unit = count > LANES * group ? LANES * group : count > group ? group : BLOCK;
        int64_t half = (count / 2 + unit - 1) / unit * unit;
        divide(n, widest_dimension(n, points, count), points, count, half);
        order(n, points, half);
        points += half;
        count -= half;
    }
}

// Point in_order[i] of `old` becomes slot i. Of a place that is unknown somewhere in its block, no more is known.
static void rearrange(struct nearest *n, const struct nearest *old, const int64_t *in_order)
{
    n->count = 0;
    for (int64_t to = 0; to < old->count; to++) {
        int64_t from = in_order[to], block = from / BLOCK;
        int lane = (int)(from % BLOCK);
        int16_t at[NEAREST_PLACES_MOST][3] = {{0}};
        for (int p = 0; p < n->places; p++)
            for (int axis = 0; axis < 3; axis++)
                at[p][axis] = old->points[block * n->places + p].at[axis][lane];
        put(n, old->numbers[block][lane], at, old->known[block], old->own[block][lane]);
    }
}

enum status nearest_settle(struct nearest *n)
{
    struct nearest *settled;
    enum status status = nearest_open(&settled, n->places, n->unit_m, n->capacity);
    if (status != OK)
        return status;
    size_t wide = (size_t)groups_of(groups_of(blocks_of(n->capacity) + 1) + 1);
    int64_t *in_order = malloc((size_t)(n->count + 1) * sizeof *in_order);
    settled->wide_boxes = calloc(wide * (size_t)n->places, sizeof *n->wide_boxes);
    settled->wide_own = calloc(wide, sizeof *n->wide_own);
    if (in_order && settled->wide_boxes && settled->wide_own) {
        for (int64_t i = 0; i < n->count; i++)
            in_order[i] = i;
        order(n, in_order, n->count);
        rearrange(settled, n, in_order);
        struct nearest old = *n;
        *n = *settled;
        *settled = old;
    } else
        status = fail(ERR_MEMORY, "out of memory");
    free(in_order);
    nearest_close(&settled);
    return status;
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
    // That with the least bound comes first: mostly, none of the others need be asked then.
    uint32_t bits = lowest(points_within(sums, s->limit), n->count - block * BLOCK);
    while (bits) {
        int i = least_of(sums, bits);
        ask(s, n->numbers[block][i]);
        bits &= ~(1u << i) & points_within(sums, s->limit);
    }
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
    enum { LINE = 64 };
    const char *points = (const char *)&n->points[block * n->places];
    for (size_t i = 0; i < (size_t)n->places * sizeof *n->points; i += LINE)
        __builtin_prefetch(points + i);
    __builtin_prefetch(&n->known[block]);
    __builtin_prefetch(n->own[block]);
}

// The block whose box is nearest comes first: it sets the mark for the others.
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
    int best = least_of(sums, bits);
    ask_block(s, first + best);
    for (bits &= ~(1u << best) & within(sums, s->limit); bits; bits &= bits - 1) {
        int i = __builtin_ctz(bits);
        if (sums[i] <= s->limit)
            ask_block(s, first + i);
    }
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
    struct search s = {n, wanted_of(n, wanted), scale, cost, context, -1, 0, SUM_MOST};
    ask_all(&s);
    if (s.best < 0)
        return NOTHING;
    *number = s.best;
    *cost_m = s.best_m;
    return OK;
}
