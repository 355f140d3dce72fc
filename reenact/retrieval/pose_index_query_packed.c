// Search through packed points: groups, their blocks, their points, each level queued and prefetched.
#include "reenact/retrieval/pose_index_bounds.h"
#include "reenact/retrieval/pose_index_packed.h"

enum {
    FIRST_BLOCKS = 3, // of the promising group, which set the first limit: with fewer, more groups are within it
    // Sizes of the queues, chosen by hand:
    GROUP_BATCH = 128,
    BLOCK_BATCH = 64,
    POINT_BATCH = 256,
};

// State of a search. What is queued is prefetched while other searches work.
struct search_state {
    struct index_search *s;
    int64_t promising; // the group with the least bound; -1: none
    uint32_t visited;  // bits of its blocks already queued
    int group_count;
    uint32_t groups[GROUP_BATCH]; // that may hold the nearest point
    lanes block_bounds[GROUP_BATCH];
    uint16_t done[GROUP_BATCH]; // bits of their blocks that are queued, or do not exist
    int block_count;
    uint32_t blocks[BLOCK_BATCH]; // to be bounded
    lanes point_bounds[BLOCK_BATCH];
    int slot_count;
    uint32_t slots[POINT_BATCH]; // of points to be evaluated
};

// ---------------------------------------------------------------- bounds

enum { DIMENSIONS = 3 * POSE_INDEX_MAX_POSITIONS };

// Steps to units. Thirty-two at a time: reads and writes past the last.
static KERNEL void dequantize(const uint8_t *steps, int count, int shift, int16_t *units)
{
    const uint16_t step = (uint16_t)(1 << shift); // multiplication vectorises in 16 bits, shifts only in 32
    for (int k = 0; k < count; k += 2 * LANES)
        for (int i = 0; i < 2 * LANES; i++)
            units[k + i] = (int16_t)(uint16_t)(steps[k + i] * step);
}

// The query relative to a record's origin `from` plus `offset` units. Sixteen at a time, likewise.
static KERNEL void relative_to(const struct index_search *s, const int16_t *from, int16_t offset, int16_t *at)
{
    const int16_t *target = s->target.at[0];
    for (int d = 0; d < 3 * s->n->positions; d += LANES)
        for (int i = 0; i < LANES; i++)
            at[d + i] = (int16_t)(target[d + i] - from[d + i] - offset);
}

static KERNEL void fixed_costs(const struct packed_index *packed, const uint8_t *steps, int16_t *units)
{
    const uint16_t step = (uint16_t)(1 << packed->fixed_cost_shift);
    for (int i = 0; i < LANES; i++)
        units[i] = (int16_t)(uint16_t)(steps[i] * step);
}

// Bounds of a group's blocks.
static KERNEL void bound_blocks(const struct index_search *s, int64_t group, int16_t *bounds)
{
    const struct pose_index *n = s->n;
    const struct quantized_query *w = &s->target;
    const struct packed_group *g = packed_group_at(n->packed, group);
    int16_t at[DIMENSIONS];
    struct box_lanes boxes[POSE_INDEX_MAX_POSITIONS];
    lanes sums;
    fixed_costs(n->packed, g->fixed_cost, sums);
    relative_to(s, g->from, 0, at);
    dequantize(packed_group_boxes(n, g)->low[0], n->positions * (int)sizeof(struct packed_boxes), g->shift,
               boxes->low[0]);
    for (int k = 0; k < w->count; k++)
        if (g->known >> w->position[k] & 1)
            add_boxes(&boxes[w->position[k]], &at[3 * w->position[k]], n->max_distance, sums);
    memcpy(bounds, sums, sizeof sums);
}

// Bounds of a block's points.
static KERNEL void bound_points(const struct index_search *s, int64_t block, int16_t *bounds)
{
    const struct pose_index *n = s->n;
    const struct quantized_query *w = &s->target;
    const struct packed_group *g = packed_group_at(n->packed, block / LANES);
    const struct packed_block *of = packed_block_at(n->packed, block);
    const int shift = g->shifts[block % LANES], middle = 1 << shift >> 1;
    int16_t at[DIMENSIONS];
    lanes points[POSE_INDEX_MAX_POSITIONS + 1][3], sums;
    fixed_costs(n->packed, of->fixed_cost, sums);
    relative_to(s, of->from, (int16_t)middle, at);
    dequantize(packed_block_points(n, of)->at[0], n->positions * (int)sizeof(struct packed_points), shift,
               points[0][0]);
    for (int k = 0; k < w->count; k++) {
        int position = w->position[k];
        if (g->known >> position & 1)
            add_points((struct point_axes){points[position][0], points[position][1], points[position][2]}, LANES,
                       &at[3 * position], n->max_distance, sums);
    }
    // Points lie up to `middle` units from their steps' centres in each axis, so a position's bound may be up to 0.86 +
    // 0.36 + 0.36 of that too high.
    const int16_t slack = (int16_t)(2 * middle * w->count);
    for (int i = 0; i < LANES; i++)
        bounds[i] = (int16_t)(sums[i] - slack);
}

// Of those whose bits are set (at least one), the one with the least bound.
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

static KERNEL void enqueue_point(struct search_state *p, int block, int lane)
{
    const struct packed_index *packed = p->s->n->packed;
    uint32_t slot = p->blocks[block] * LANES + (uint32_t)lane;
    if (slot >= p->s->n->count)
        return;
    p->slots[p->slot_count++] = slot;
    prefetch(packed->payload + slot * packed->payload_bytes, packed->payload_bytes);
}

// Bounds the queued blocks' points and queues the one with the least bound.
static KERNEL void bound_queued(struct search_state *p)
{
    lanes leasts, where = {0}; // minimum of each lane, and its block
    for (int i = 0; i < LANES; i++)
        leasts[i] = MAX_SUM;
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
    enqueue_point(p, where[lane], lane);
    p->point_bounds[where[lane]][lane] = MAX_SUM; // not again
}

static KERNEL void evaluate_points(struct search_state *p)
{
    for (int i = 0; i < p->slot_count; i++)
        evaluate(p->s, p->slots[i]);
    p->slot_count = 0;
}

// Queues all other points of the blocks within the limit: few, once the best has been evaluated.
static KERNEL void enqueue_other_points(struct search_state *p)
{
    for (int first = 0; first < p->block_count; first += 4) {
        uint64_t bits = 0;
        for (int b = first; b < p->block_count && b < first + 4; b++)
            bits |= (uint64_t)bits_within(p->point_bounds[b], LANES, p->s->limit) << LANES * (b - first);
        for (; bits; bits &= bits - 1) {
            int i = __builtin_ctzll(bits);
            if (p->slot_count == POINT_BATCH)
                evaluate_points(p);
            enqueue_point(p, first + i / LANES, i % LANES);
        }
    }
    p->block_count = 0;
}

static KERNEL void bound_and_evaluate(struct search_state *p)
{
    bound_queued(p);
    evaluate_points(p);
    enqueue_other_points(p);
    evaluate_points(p);
}

// ---------------------------------------------------------------- blocks

static KERNEL void enqueue_block(struct search_state *p, int64_t block)
{
    const struct packed_index *packed = p->s->n->packed;
    p->blocks[p->block_count++] = (uint32_t)block;
    prefetch(packed_block_at(packed, block), packed->block_bytes);
}

// Bits of those of a group's sixteen blocks that exist.
static KERNEL uint32_t blocks_in(const struct index_search *s, int64_t group)
{
    return lowest(0xffff, packed_blocks_of(s->n->count) - group * LANES);
}

static KERNEL void enqueue_first_blocks(struct search_state *p)
{
    lanes bounds;
    if (p->promising < 0)
        return;
    bound_blocks(p->s, p->promising, bounds);
    for (int i = 0; i < FIRST_BLOCKS; i++) {
        uint32_t left = blocks_in(p->s, p->promising) & ~p->visited;
        if (!left)
            return;
        int block = least_of(bounds, left);
        p->visited |= 1u << block;
        enqueue_block(p, p->promising * LANES + block);
    }
}

// Queues the blocks of the queued groups with bounds of at most `most`.
static KERNEL void enqueue_blocks_within(struct search_state *p, int16_t most)
{
    for (int first = 0; first < p->group_count; first += 4) {
        uint64_t bits = 0;
        for (int g = first; g < p->group_count && g < first + 4; g++) {
            uint16_t of_group = (uint16_t)(bits_within(p->block_bounds[g], LANES, most) & ~p->done[g]);
            p->done[g] |= of_group;
            bits |= (uint64_t)of_group << LANES * (g - first);
        }
        for (; bits; bits &= bits - 1) {
            int i = __builtin_ctzll(bits);
            if (p->block_count == BLOCK_BATCH)
                bound_and_evaluate(p);
            enqueue_block(p, (int64_t)p->groups[first + i / LANES] * LANES + i % LANES);
        }
    }
}

// Blocks within a quarter of the way from the least bound to the limit are evaluated first: they lower the limit for
// the rest.
static KERNEL void enqueue_best_blocks(struct search_state *p)
{
    lanes leasts;
    for (int i = 0; i < LANES; i++)
        leasts[i] = MAX_SUM;
    for (int g = 0; g < p->group_count; g++)
        for (int i = 0; i < LANES; i++)
            leasts[i] = p->block_bounds[g][i] < leasts[i] ? p->block_bounds[g][i] : leasts[i];
    int least = leasts[least_of(leasts, 0xffff)];
    enqueue_blocks_within(p, (int16_t)(least + (p->s->limit - least) / 4));
}

static KERNEL void enqueue_other_blocks(struct search_state *p) { enqueue_blocks_within(p, p->s->limit); }

// ---------------------------------------------------------------- groups

static KERNEL void find_promising(struct search_state *p)
{
    const struct packed_index *packed = p->s->n->packed;
    int64_t groups = groups_of(packed_blocks_of(p->s->n->count));
    p->promising = bound_all(p->s, packed->wide_boxes, *packed->wide_fixed_cost, groups);
    p->visited = 0;
    if (p->promising >= 0)
        prefetch(packed_group_at(packed, p->promising), packed->group_bytes);
}

static KERNEL void bound_groups(struct search_state *p)
{
    for (int g = 0; g < p->group_count; g++)
        bound_blocks(p->s, p->groups[g], p->block_bounds[g]);
}

static KERNEL void find_groups(struct search_state *p)
{
    const struct packed_index *packed = p->s->n->packed;
    const int64_t groups = groups_of(packed_blocks_of(p->s->n->count));
    for (int64_t first = 0; first < groups; first += 4 * LANES) {
        uint64_t bits = 0;
        for (int i = 0; i < 4 && first + i * LANES < groups; i++)
            bits |= (uint64_t)boxes_within_limit(p->s, first + i * LANES, groups) << LANES * i;
        for (; bits; bits &= bits - 1) {
            if (p->group_count == GROUP_BATCH) {
                bound_groups(p);
                enqueue_other_blocks(p);
                bound_and_evaluate(p);
                p->group_count = 0;
            }
            int64_t group = first + __builtin_ctzll(bits);
            p->done[p->group_count] = (uint16_t)(~blocks_in(p->s, group) | (group == p->promising ? p->visited : 0));
            p->groups[p->group_count++] = (uint32_t)group;
            prefetch(packed_group_at(packed, group), packed->group_bytes);
        }
    }
}

// ---------------------------------------------------------------- search

typedef void search_step(struct search_state *p);

static KERNEL void for_all(struct search_state *all, int count, search_step *run_step)
{
    for (int i = 0; i < count; i++)
        run_step(&all[i]);
}

static KERNEL void all_bound_and_evaluate(struct search_state *all, int count)
{
    for_all(all, count, bound_queued);
    for_all(all, count, evaluate_points);
    for_all(all, count, enqueue_other_points);
    for_all(all, count, evaluate_points);
}

// Each step for all searches before the next, so that the prefetches of one complete while others work.
FOR_EACH_PROCESSOR
static void find_all(struct search_state *all, int count)
{
    for_all(all, count, find_promising);
    for_all(all, count, enqueue_first_blocks);
    all_bound_and_evaluate(all, count);
    for_all(all, count, find_groups);
    for_all(all, count, bound_groups);
    for_all(all, count, enqueue_best_blocks);
    all_bound_and_evaluate(all, count);
    for_all(all, count, enqueue_other_blocks);
    all_bound_and_evaluate(all, count);
}

void pose_index_query_packed(struct index_search *searches, int count)
{
    struct search_state all[POSE_INDEX_MAX_QUERIES];
    for (int i = 0; i < count; i++) { // the rest is written before it is read; clearing it would take long
        all[i].s = &searches[i];
        all[i].group_count = all[i].block_count = all[i].slot_count = 0;
    }
    find_all(all, count);
}
