#include "reenact/retrieval/pose_index_bounds.h"
#include "reenact/retrieval/pose_index_packed.h"

enum {
    FIRST_BLOCKS = 3, // of the promising group, from which the first mark comes: with fewer, more groups are near
    // That wait at once:
    GROUPS_AT_ONCE = 128,
    BLOCKS_AT_ONCE = 64,
    POINTS_AT_ONCE = 256,
};

// How far a search has come. What waits to be looked at comes from memory while other searches work.
struct progress {
    struct search *s;
    int64_t promising; // the group with the least bound; -1: none
    uint32_t looked;   // at which of its blocks, as bits
    int group_count;   // that may hold the nearest
    uint32_t groups[GROUPS_AT_ONCE];
    lanes block_bounds[GROUPS_AT_ONCE];
    uint16_t done[GROUPS_AT_ONCE]; // which of their blocks need not be looked at any more, as bits
    int block_count;               // that wait to be looked at
    uint32_t blocks[BLOCKS_AT_ONCE];
    lanes point_bounds[BLOCKS_AT_ONCE];
    int slot_count; // of points that wait to be asked
    uint32_t slots[POINTS_AT_ONCE];
};

// ---------------------------------------------------------------- bounds

enum { DIMENSIONS = 3 * NEAREST_PLACES_MOST };

// Thirty-two at a time, whatever lies behind the last.
static KERNEL void to_units(const uint8_t *steps, int count, int shift, int16_t *units)
{
    const uint16_t step = (uint16_t)(1 << shift); // compilers multiply 16 bits side by side, but shift 32
    for (int k = 0; k < count; k += 2 * LANES)
        for (int i = 0; i < 2 * LANES; i++)
            units[k + i] = (int16_t)(uint16_t)(steps[k + i] * step);
}

// Where what is looked for lies from `begin` units after where a record begins. Sixteen at a time, likewise.
static KERNEL void seen_from(const struct search *s, const int16_t *from, int16_t begin, int16_t *at)
{
    const int16_t *wanted = s->wanted.at[0];
    for (int d = 0; d < 3 * s->n->places; d += LANES)
        for (int i = 0; i < LANES; i++)
            at[d + i] = (int16_t)(wanted[d + i] - from[d + i] - begin);
}

static KERNEL void own_costs(const struct settled *settled, const uint8_t *steps, int16_t *units)
{
    const uint16_t step = (uint16_t)(1 << settled->own_shift);
    for (int i = 0; i < LANES; i++)
        units[i] = (int16_t)(uint16_t)(steps[i] * step);
}

// Of a group's blocks.
static KERNEL void bound_blocks(const struct search *s, int64_t group, int16_t *bounds)
{
    const struct nearest *n = s->n;
    const struct wanted *w = &s->wanted;
    const struct settled_group *g = settled_group(n->settled, group);
    int16_t at[DIMENSIONS];
    struct box_lanes boxes[NEAREST_PLACES_MOST];
    lanes sums;
    own_costs(n->settled, g->own, sums);
    seen_from(s, g->from, 0, at);
    to_units(settled_boxes(n, g)->low[0], n->places * (int)sizeof(struct settled_boxes), g->shift, boxes->low[0]);
    for (int k = 0; k < w->count; k++)
        if (g->known >> w->place[k] & 1)
            add_boxes(&boxes[w->place[k]], &at[3 * w->place[k]], n->place_most, sums);
    memcpy(bounds, sums, sizeof sums);
}

// Of a block's points.
static KERNEL void bound_points(const struct search *s, int64_t block, int16_t *bounds)
{
    const struct nearest *n = s->n;
    const struct wanted *w = &s->wanted;
    const struct settled_group *g = settled_group(n->settled, block / LANES);
    const struct settled_block *of = settled_block(n->settled, block);
    const int shift = g->shifts[block % LANES], middle = 1 << shift >> 1;
    int16_t at[DIMENSIONS];
    lanes points[NEAREST_PLACES_MOST + 1][3], sums;
    own_costs(n->settled, of->own, sums);
    seen_from(s, of->from, (int16_t)middle, at);
    to_units(settled_points(n, of)->at[0], n->places * (int)sizeof(struct settled_points), shift, points[0][0]);
    for (int k = 0; k < w->count; k++) {
        int place = w->place[k];
        if (g->known >> place & 1)
            add_points(points[place][0], points[place][1], points[place][2], LANES, &at[3 * place], n->place_most,
                       sums);
    }
    // Points lie up to `middle` from their steps' middles in each axis, so a place's bound is up to 0.86 + 0.36 + 0.36
    // of that too high.
    const int16_t slack = (int16_t)(2 * middle * w->count);
    for (int i = 0; i < LANES; i++)
        bounds[i] = (int16_t)(sums[i] - slack);
}

// Of those whose bits are set, one or more, that with the least bound.
static inline int least_of(const int16_t *bounds, uint32_t bits)
{
    int least = __builtin_ctz(bits);
    for (bits &= bits - 1; bits; bits &= bits - 1) {
        int i = __builtin_ctz(bits);
        least = bounds[i] < bounds[least] ? i : least;
    }
    return least;
}

// ---------------------------------------------------------------- points

static KERNEL void wait_for_point(struct progress *p, int block, int lane)
{
    const struct settled *settled = p->s->n->settled;
    uint32_t slot = p->blocks[block] * LANES + (uint32_t)lane;
    if (slot >= p->s->n->count)
        return;
    p->slots[p->slot_count++] = slot;
    fetch(settled->of_points + slot * settled->of_point_bytes, settled->of_point_bytes);
}

// The waiting blocks' points are bounded; that with the least bound waits to be asked.
static KERNEL void look(struct progress *p)
{
    lanes leasts, where = {0}; // lane by lane, and in which block
    for (int i = 0; i < LANES; i++)
        leasts[i] = SUM_MOST;
    for (int b = 0; b < p->block_count; b++) {
        int16_t *bounds = p->point_bounds[b];
        bound_points(p->s, p->blocks[b], bounds);
        for (int i = 0; i < LANES; i++) {
            where[i] = bounds[i] < leasts[i] ? (int16_t)b : where[i];
            leasts[i] = bounds[i] < leasts[i] ? bounds[i] : leasts[i];
        }
    }
    int lane = least_of(leasts, 0xffff);
    if (p->block_count == 0 || leasts[lane] > p->s->limit)
        return;
    wait_for_point(p, where[lane], lane);
    p->point_bounds[where[lane]][lane] = SUM_MOST; // once is enough
}

static KERNEL void ask_points(struct progress *p)
{
    for (int i = 0; i < p->slot_count; i++)
        ask(p->s, p->slots[i]);
    p->slot_count = 0;
}

// All other points of the blocks whose bounds are low enough: few, once the best has been asked.
static KERNEL void find_others(struct progress *p)
{
    for (int first = 0; first < p->block_count; first += 4) {
        uint64_t bits = 0;
        for (int b = first; b < p->block_count && b < first + 4; b++)
            bits |= (uint64_t)within(p->point_bounds[b], LANES, p->s->limit) << LANES * (b - first);
        for (; bits; bits &= bits - 1) {
            int i = __builtin_ctzll(bits);
            if (p->slot_count == POINTS_AT_ONCE)
                ask_points(p);
            wait_for_point(p, first + i / LANES, i % LANES);
        }
    }
    p->block_count = 0;
}

static KERNEL void look_and_ask(struct progress *p)
{
    look(p);
    ask_points(p);
    find_others(p);
    ask_points(p);
}

// ---------------------------------------------------------------- blocks

static KERNEL void wait_for_block(struct progress *p, int64_t block)
{
    const struct settled *settled = p->s->n->settled;
    p->blocks[p->block_count++] = (uint32_t)block;
    fetch(settled_block(settled, block), settled->block_bytes);
}

// As many of a group's sixteen blocks as there are, as bits.
static KERNEL uint32_t blocks_in(const struct search *s, int64_t group)
{
    return lowest(0xffff, settled_blocks_of(s->n->count) - group * LANES);
}

static KERNEL void find_first_blocks(struct progress *p)
{
    lanes bounds;
    if (p->promising < 0)
        return;
    bound_blocks(p->s, p->promising, bounds);
    for (int i = 0; i < FIRST_BLOCKS; i++) {
        uint32_t left = blocks_in(p->s, p->promising) & ~p->looked;
        if (!left)
            return;
        int block = least_of(bounds, left);
        p->looked |= 1u << block;
        wait_for_block(p, p->promising * LANES + block);
    }
}

// Blocks of near groups whose bounds are at most `most` wait to be looked at.
static KERNEL void take(struct progress *p, int16_t most)
{
    for (int first = 0; first < p->group_count; first += 4) {
        uint64_t bits = 0;
        for (int g = first; g < p->group_count && g < first + 4; g++) {
            uint16_t of_group = (uint16_t)(within(p->block_bounds[g], LANES, most) & ~p->done[g]);
            p->done[g] |= of_group;
            bits |= (uint64_t)of_group << LANES * (g - first);
        }
        for (; bits; bits &= bits - 1) {
            int i = __builtin_ctzll(bits);
            if (p->block_count == BLOCKS_AT_ONCE)
                look_and_ask(p);
            wait_for_block(p, (int64_t)p->groups[first + i / LANES] * LANES + i % LANES);
        }
    }
}

// The best quarter, between the least bound and the mark, sets the mark for the rest.
static KERNEL void take_best(struct progress *p)
{
    lanes leasts;
    for (int i = 0; i < LANES; i++)
        leasts[i] = SUM_MOST;
    for (int g = 0; g < p->group_count; g++)
        for (int i = 0; i < LANES; i++)
            leasts[i] = p->block_bounds[g][i] < leasts[i] ? p->block_bounds[g][i] : leasts[i];
    int least = leasts[least_of(leasts, 0xffff)];
    take(p, (int16_t)(least + (p->s->limit - least) / 4));
}

static KERNEL void take_rest(struct progress *p) { take(p, p->s->limit); }

// ---------------------------------------------------------------- groups

static KERNEL void find_promising(struct progress *p)
{
    const struct settled *settled = p->s->n->settled;
    int64_t groups = groups_of(settled_blocks_of(p->s->n->count));
    p->promising = bound_all(p->s, settled->wide_boxes, *settled->wide_own, groups);
    p->looked = 0;
    if (p->promising >= 0)
        fetch(settled_group(settled, p->promising), settled->group_bytes);
}

static KERNEL void bound_groups(struct progress *p)
{
    for (int g = 0; g < p->group_count; g++)
        bound_blocks(p->s, p->groups[g], p->block_bounds[g]);
}

static KERNEL void find_groups(struct progress *p)
{
    const struct settled *settled = p->s->n->settled;
    const int64_t groups = groups_of(settled_blocks_of(p->s->n->count));
    for (int64_t first = 0; first < groups; first += 4 * LANES) {
        uint64_t bits = 0;
        for (int i = 0; i < 4 && first + i * LANES < groups; i++)
            bits |= (uint64_t)near_boxes(p->s, first + i * LANES, groups) << LANES * i;
        for (; bits; bits &= bits - 1) {
            if (p->group_count == GROUPS_AT_ONCE) {
                bound_groups(p);
                take_rest(p);
                look_and_ask(p);
                p->group_count = 0;
            }
            int64_t group = first + __builtin_ctzll(bits);
            p->done[p->group_count] = (uint16_t)(~blocks_in(p->s, group) | (group == p->promising ? p->looked : 0));
            p->groups[p->group_count++] = (uint32_t)group;
            fetch(settled_group(settled, group), settled->group_bytes);
        }
    }
}

// ---------------------------------------------------------------- finding

typedef void step(struct progress *p);

static KERNEL void for_all(struct progress *all, int count, step *take_step)
{
    for (int i = 0; i < count; i++)
        take_step(&all[i]);
}

static KERNEL void all_look_and_ask(struct progress *all, int count)
{
    for_all(all, count, look);
    for_all(all, count, ask_points);
    for_all(all, count, find_others);
    for_all(all, count, ask_points);
}

// Step by step, each for all searches before the next, so that what one has to wait for comes while others work.
FOR_EACH_PROCESSOR
static void find_all(struct progress *all, int count)
{
    for_all(all, count, find_promising);
    for_all(all, count, find_first_blocks);
    all_look_and_ask(all, count);
    for_all(all, count, find_groups);
    for_all(all, count, bound_groups);
    for_all(all, count, take_best);
    all_look_and_ask(all, count);
    for_all(all, count, take_rest);
    all_look_and_ask(all, count);
}

void nearest_find_settled(struct search *searches, int count)
{
    struct progress all[NEAREST_QUERIES_MOST];
    for (int i = 0; i < count; i++) { // the rest means nothing yet, and to clear it would take long
        all[i].s = &searches[i];
        all[i].group_count = all[i].block_count = all[i].slot_count = 0;
    }
    find_all(all, count);
}
