#include "reenact/nearest_index.h"

#include <string.h>

enum { STRIDE = 5 }; // places of a block's points that are looked at before it is passed over after all

// What has to become part of each of ask_all's versions.
#define KERNEL inline __attribute__((always_inline))

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
static KERNEL void add_boxes(const struct nearest *n, const struct box_lanes *boxes, const struct wanted *w,
                             int16_t *restrict sums)
{
    int16_t most = n->place_most;
    for (int k = 0; k < w->count; k++) {
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

// Bit i: sums[i] is at most `limit`; count: four, eight ... of them. A branch for each would be guessed wrong too
// often.
static KERNEL uint32_t within(const int16_t *sums, int count, int16_t limit)
{
    int16_t low[LANES];
    uint64_t bits = 0;
    for (int i = 0; i < count; i++)
        low[i] = (int16_t)(sums[i] <= limit ? 1 << i : 0);
    for (int i = 0; i < count; i += 4) {
        uint64_t four;
        memcpy(&four, low + i, sizeof four);
        bits |= four;
    }
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
    int64_t promising; // group, where groups are settled
    int block;         // in it; -1: none
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
    uint32_t bits = within(sums, BLOCK, s->limit);
    for (int k = 0, to; k < s->wanted.count && bits; k = to) {
        to = k + STRIDE < s->wanted.count ? k + STRIDE : s->wanted.count;
        add_points(n, block, &s->wanted, k, to, sums);
        bits = within(sums, BLOCK, s->limit);
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
        bits &= ~(1u << i) & within(sums, BLOCK, s->limit);
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

// Every block's bound, then the block with the least: it sets the mark for all.
static KERNEL void ask_promising(struct search *s)
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
        add_boxes(n, &n->boxes[g * n->places], &s->wanted, sums);
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
static KERNEL void fetch(const void *from, size_t bytes)
{
    for (size_t i = 0; i < bytes; i += LINE)
        __builtin_prefetch((const char *)from + i);
}

static KERNEL void fetch_block(const struct nearest *n, int64_t block)
{
    fetch(&n->points[block * n->places], (size_t)n->places * sizeof *n->points);
    fetch(&n->heads[block], sizeof *n->heads);
}

static KERNEL void fetch_group(const struct nearest *n, int64_t group)
{
    fetch(&n->boxes[group * n->places], (size_t)n->places * sizeof *n->boxes);
    fetch(&n->least_own[group], sizeof *n->least_own);
}

// Those of the last two groups, whose points and costs are here by now.
static KERNEL void ask_waiting(struct search *s)
{
    struct waiting *w = &s->waiting;
    ask_pending(s);
    for (uint32_t bits = w->bits & within(w->sums, LANES, s->limit); bits; bits &= bits - 1)
        ask_later(s, w->first + __builtin_ctz(bits));
    w->bits = 0;
}

// The blocks of a group whose bounds are low enough, as bits.
static KERNEL uint32_t near_blocks(const struct search *s, int64_t group, lanes sums)
{
    const struct nearest *n = s->n;
    memcpy(sums, n->least_own[group], sizeof *n->least_own);
    add_boxes(n, &n->boxes[group * n->places], &s->wanted, sums);
    return lowest(within(sums, LANES, s->limit), blocks_of(n->count) - group * LANES);
}

static KERNEL void fetch_waiting(const struct search *s)
{
    for (uint32_t left = s->waiting.bits; left; left &= left - 1)
        fetch_block(s->n, s->waiting.first + __builtin_ctz(left));
}

// Blocks are looked at when the next group's are on their way.
static KERNEL void ask_group(struct search *s, int64_t group)
{
    struct waiting next = {.first = group * LANES};
    next.bits = near_blocks(s, group, next.sums);
    if (!next.bits)
        return;
    struct waiting last = s->waiting;
    s->waiting = next;
    fetch_waiting(s);
    s->waiting = last;
    ask_waiting(s);
    s->waiting = next;
}

// Where groups are settled: the bounds of all, and of the least the boxes of its blocks.
static KERNEL void find_group(struct search *s)
{
    const struct nearest *n = s->n;
    const int64_t groups = groups_of(blocks_of(n->count));
    int16_t least = SUM_MOST;
    s->promising = 0;
    for (int64_t g = 0; g < groups; g += LANES) {
        int16_t *wide = n->bounds[g / LANES];
        memcpy(wide, n->wide_own[g / LANES], sizeof *n->wide_own);
        add_boxes(n, &n->wide_boxes[g / LANES * n->places], &s->wanted, wide);
        uint32_t bits = lowest(within(wide, LANES, least), groups - g);
        if (bits) {
            int i = least_of(wide, bits);
            least = wide[i];
            s->promising = g + i;
        }
    }
    fetch_group(n, s->promising);
}

// Of its blocks the one with the least bound; the others wait.
static KERNEL void find_block(struct search *s)
{
    struct waiting *w = &s->waiting;
    w->first = s->promising * LANES;
    w->bits = s->n->count ? near_blocks(s, s->promising, w->sums) : 0;
    s->block = w->bits ? least_of(w->sums, w->bits) : -1;
    if (s->block < 0)
        return;
    w->bits &= ~(1u << s->block);
    fetch_block(s->n, w->first + s->block);
}

static KERNEL void find_points(struct search *s)
{
    if (s->block >= 0)
        ask_later(s, s->waiting.first + s->block);
}

// Its points set the mark for the group's other blocks.
static KERNEL void find_mark(struct search *s)
{
    ask_pending(s);
    s->waiting.bits &= within(s->waiting.sums, LANES, s->limit);
    fetch_waiting(s);
}

// And these the mark for the other groups.
static KERNEL void fetch_near_groups(struct search *s)
{
    const struct nearest *n = s->n;
    const int64_t groups = groups_of(blocks_of(n->count));
    ask_pending(s);
    for (int64_t g = 0; g < groups; g += LANES)
        for (uint32_t bits = lowest(within(n->bounds[g / LANES], LANES, s->limit), groups - g); bits; bits &= bits - 1)
            if (g + __builtin_ctz(bits) != s->promising)
                fetch_group(n, g + __builtin_ctz(bits));
}

static KERNEL void ask_near_groups(struct search *s)
{
    const struct nearest *n = s->n;
    const int64_t groups = groups_of(blocks_of(n->count));
    for (int64_t g = 0; g < groups; g += LANES) {
        const int16_t *wide = n->bounds[g / LANES];
        for (uint32_t bits = lowest(within(wide, LANES, s->limit), groups - g); bits; bits &= bits - 1) {
            int i = __builtin_ctz(bits);
            if (g + i != s->promising && wide[i] <= s->limit)
                ask_group(s, g + i);
        }
    }
    ask_waiting(s);
    ask_pending(s);
}

// All of them step by step, so that what one has to wait for comes while others work.
static KERNEL void ask_settled(struct search *all, int count)
{
    for (int i = 0; i < count; i++)
        find_group(&all[i]);
    for (int i = 0; i < count; i++)
        find_block(&all[i]);
    for (int i = 0; i < count; i++)
        find_points(&all[i]);
    for (int i = 0; i < count; i++)
        find_mark(&all[i]);
    for (int i = 0; i < count; i++)
        ask_waiting(&all[i]);
    fetch_near_groups(&all[0]);
    for (int i = 0; i < count; i++) {
        if (i + 1 < count)
            fetch_near_groups(&all[i + 1]);
        ask_near_groups(&all[i]);
    }
}

// In the order in which points came.
static KERNEL void ask_in_order(struct search *s)
{
    const struct nearest *n = s->n;
    int64_t blocks = blocks_of(n->count);
    ask_promising(s);
    for (int64_t b = 0; b < blocks; b += LANES) {
        const int16_t *sums = n->bounds[b / LANES];
        for (uint32_t bits = lowest(within(sums, LANES, s->limit), blocks - b); bits; bits &= bits - 1) {
            int i = __builtin_ctz(bits);
            if (sums[i] <= s->limit)
                ask_block(s, b + i);
        }
    }
}

#if defined(__x86_64__) && !defined(__SANITIZE_THREAD__)
// Twice as wide where the processor can; all is in whole numbers, so the answer is the same. The choice is made
// before the thread sanitizer is ready for it.
__attribute__((target_clones("avx2", "default")))
#endif
static void
ask_all(struct search *all, int count)
{
    if (all[0].n->wide_boxes) {
        ask_settled(all, count);
        return;
    }
    for (int i = 0; i < count; i++)
        ask_in_order(&all[i]);
}

void nearest_find_all(struct nearest_query *queries, int count, nearest_cost *cost)
{
    struct search all[NEAREST_QUERIES_MOST];
    struct pending pending[NEAREST_QUERIES_MOST];
    assert(count > 0 && count <= NEAREST_QUERIES_MOST);
    for (int i = 0; i < count; i++) {
        const struct nearest_query *q = &queries[i];
        assert(q->scale > 0 && !q->index->wide_boxes == !queries[0].index->wide_boxes);
        pending[i].count = 0; // the rest means nothing yet
        all[i] = (struct search){.n = q->index,
                                 .wanted = wanted_of(q->index, &q->point),
                                 .scale = q->scale,
                                 .cost = cost,
                                 .context = q->context,
                                 .best = -1,
                                 .limit = SUM_MOST,
                                 .pending = &pending[i]};
    }
    ask_all(all, count);
    for (int i = 0; i < count; i++) {
        queries[i].number = all[i].best;
        queries[i].cost_m = all[i].best_m;
    }
}
