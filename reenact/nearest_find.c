#include "reenact/nearest_index.h"

#include <string.h>

enum { BLOCKS_MOST = 32 }; // that are looked at together: what they lie in comes while others are found

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

static KERNEL void add_points(const struct nearest *n, int64_t block, const struct wanted *w, int16_t *restrict sums)
{
    int16_t most = n->place_most;
    const uint32_t known = n->heads[block].known;
    const struct point_lanes *points = &n->points[block * n->places];
    for (int k = 0; k < w->count; k++) {
        if (!(known >> w->place[k] & 1))
            continue;
        const struct point_lanes *p = &points[w->place[k]];
        const int16_t *at = w->at[k];
        for (int i = 0; i < BLOCK; i++) {
            int16_t d =
                length_at_least(apart(p->at[0][i], at[0]), apart(p->at[1][i], at[1]), apart(p->at[2][i], at[2]));
            sums[i] = (int16_t)(sums[i] + (d < most ? d : most));
        }
    }
}

// Bit i: sums[i] is at most `limit`; count: eight or sixteen. A branch for each would be guessed wrong too often.
static KERNEL uint32_t within(const int16_t *sums, int count, int16_t limit)
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
    int16_t limit;     // bounds above this cannot lead to a better point, nor to a tie
    int64_t promising; // the group or block with the least bound; -1: none
    uint32_t others;   // blocks of the promising group, as bits
    lanes other_sums;  // and their bounds
    int block_count;   // that are yet to be looked at
    uint32_t blocks[BLOCKS_MOST];
    int point_count; // that are yet to be asked
    uint32_t numbers[BLOCKS_MOST * BLOCK];
    int16_t sums[BLOCKS_MOST * BLOCK]; // their bounds
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

// What is going to be looked at is on its way before: takes are more than the near caches hold.
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

// Those points of the waiting blocks whose bounds are low enough wait to be asked.
static KERNEL void look(struct search *s)
{
    const struct nearest *n = s->n;
    for (int b = 0; b < s->block_count; b++) {
        int64_t block = s->blocks[b];
        points_lanes sums;
        memcpy(sums, n->heads[block].own, sizeof sums);
        add_points(n, block, &s->wanted, sums);
        uint32_t bits = lowest(within(sums, BLOCK, s->limit), n->count - block * BLOCK);
        for (; bits; bits &= bits - 1) {
            int i = __builtin_ctz(bits);
            uint32_t number = n->heads[block].numbers[i];
            s->numbers[s->point_count] = number;
            s->sums[s->point_count++] = sums[i];
            fetch(n->costs_from + (size_t)number * n->cost_bytes, n->cost_bytes);
        }
    }
    s->block_count = 0;
}

// That with the least bound comes first: mostly, none of the others need be asked then.
static KERNEL void ask_points(struct search *s)
{
    int least = 0;
    for (int i = 1; i < s->point_count; i++)
        least = s->sums[i] < s->sums[least] ? i : least;
    if (s->point_count > 0)
        ask(s, s->numbers[least]);
    for (int i = 0; i < s->point_count; i++)
        if (i != least && s->sums[i] <= s->limit)
            ask(s, s->numbers[i]);
    s->point_count = 0;
}

// Blocks from `first` on, as bits, wait to be looked at.
static KERNEL void wait_for(struct search *s, int64_t first, uint32_t bits)
{
    for (; bits; bits &= bits - 1) {
        if (s->block_count == BLOCKS_MOST) {
            look(s);
            ask_points(s);
        }
        int64_t block = first + __builtin_ctz(bits);
        s->blocks[s->block_count++] = (uint32_t)block;
        fetch_block(s->n, block);
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

// The bounds of `count` boxes into n->bounds; which is the least, -1: none.
static KERNEL int64_t bound_all(struct search *s, const struct box_lanes *boxes, const int16_t *own, int64_t count)
{
    const struct nearest *n = s->n;
    int64_t promising = -1;
    int16_t least = SUM_MOST;
    lanes leasts, where = {0}; // lane by lane, and in which sixteen modulo 2^15
    for (int i = 0; i < LANES; i++)
        leasts[i] = SUM_MOST;
    for (int64_t g = 0; g < groups_of(count); g++) {
        int16_t *sums = n->bounds[g], here = (int16_t)(g & 0x7fff);
        memcpy(sums, own + g * LANES, sizeof *n->bounds);
        add_boxes(n, &boxes[g * n->places], &s->wanted, sums);
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

// Of the sixteen boxes from `first` on, those whose bounds are low enough, as bits.
static KERNEL uint32_t near_boxes(const struct search *s, int64_t first, int64_t count)
{
    return lowest(within(s->n->bounds[first / LANES], LANES, s->limit), count - first);
}

// Where points are in the order in which they came: the promising block sets the mark for all.
static KERNEL void ask_in_order(struct search *s)
{
    const struct nearest *n = s->n;
    int64_t blocks = blocks_of(n->count), promising = bound_all(s, n->boxes, *n->least_own, blocks);
    if (promising < 0)
        return;
    wait_for(s, promising, 1);
    look(s);
    ask_points(s);
    n->bounds[promising / LANES][promising % LANES] = SUM_MOST; // once is enough
    for (int64_t b = 0; b < blocks; b += LANES)
        wait_for(s, b, near_boxes(s, b, blocks));
    look(s);
    ask_points(s);
}

// ---------------------------------------------------------------- settled

// The blocks of a group whose bounds are low enough, as bits.
static KERNEL uint32_t near_blocks(const struct search *s, int64_t group, lanes sums)
{
    const struct nearest *n = s->n;
    memcpy(sums, n->least_own[group], sizeof *n->least_own);
    add_boxes(n, &n->boxes[group * n->places], &s->wanted, sums);
    return lowest(within(sums, LANES, s->limit), blocks_of(n->count) - group * LANES);
}

static KERNEL void find_group(struct search *s)
{
    const struct nearest *n = s->n;
    s->promising = bound_all(s, n->wide_boxes, *n->wide_own, groups_of(blocks_of(n->count)));
    if (s->promising >= 0)
        fetch_group(n, s->promising);
}

// Of its blocks the one with the least bound sets the mark for the others.
static KERNEL void find_block(struct search *s)
{
    s->others = s->promising < 0 ? 0 : near_blocks(s, s->promising, s->other_sums);
    if (!s->others)
        return;
    uint32_t block = 1u << least_of(s->other_sums, s->others);
    s->others &= ~block;
    wait_for(s, s->promising * LANES, block);
}

static KERNEL void find_others(struct search *s)
{
    ask_points(s);
    if (s->others)
        wait_for(s, s->promising * LANES, s->others & within(s->other_sums, LANES, s->limit));
}

// And these for the other groups.
static KERNEL void fetch_near_groups(struct search *s)
{
    const struct nearest *n = s->n;
    const int64_t groups = groups_of(blocks_of(n->count));
    ask_points(s);
    for (int64_t g = 0; g < groups; g += LANES)
        for (uint32_t bits = near_boxes(s, g, groups); bits; bits &= bits - 1)
            if (g + __builtin_ctz(bits) != s->promising)
                fetch_group(n, g + __builtin_ctz(bits));
}

static KERNEL void find_near_blocks(struct search *s)
{
    const struct nearest *n = s->n;
    const int64_t groups = groups_of(blocks_of(n->count));
    for (int64_t g = 0; g < groups; g += LANES)
        for (uint32_t bits = near_boxes(s, g, groups); bits; bits &= bits - 1) {
            int64_t group = g + __builtin_ctz(bits);
            lanes sums;
            if (group != s->promising)
                wait_for(s, group * LANES, near_blocks(s, group, sums));
        }
}

// All of them step by step, so that what one has to wait for comes while others work.
static KERNEL void ask_settled(struct search *all, int count)
{
    for (int i = 0; i < count; i++)
        find_group(&all[i]);
    for (int i = 0; i < count; i++)
        find_block(&all[i]);
    for (int i = 0; i < count; i++)
        look(&all[i]);
    for (int i = 0; i < count; i++)
        find_others(&all[i]);
    for (int i = 0; i < count; i++)
        look(&all[i]);
    for (int i = 0; i < count; i++)
        fetch_near_groups(&all[i]);
    for (int i = 0; i < count; i++)
        find_near_blocks(&all[i]);
    for (int i = 0; i < count; i++)
        look(&all[i]);
    for (int i = 0; i < count; i++)
        ask_points(&all[i]);
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

// What waits is not cleared: it means nothing yet, and is more than all the rest.
static void begin(struct search *s, const struct nearest_query *q, nearest_cost *cost)
{
    s->n = q->index;
    s->wanted = wanted_of(q->index, &q->point);
    s->scale = q->scale;
    s->cost = cost;
    s->context = q->context;
    s->best = -1;
    s->limit = SUM_MOST;
    s->block_count = s->point_count = 0;
}

void nearest_find_all(struct nearest_query *queries, int count, nearest_cost *cost)
{
    struct search all[NEAREST_QUERIES_MOST];
    assert(count > 0 && count <= NEAREST_QUERIES_MOST);
    for (int i = 0; i < count; i++) {
        const struct nearest_query *q = &queries[i];
        assert(q->scale > 0 && !q->index->wide_boxes == !queries[0].index->wide_boxes);
        begin(&all[i], q, cost);
    }
    ask_all(all, count);
    for (int i = 0; i < count; i++) {
        queries[i].number = all[i].best;
        queries[i].cost_m = all[i].best_m;
    }
}
