// What pose_index_pack makes of an index: alike points side by side, in eight bits
// a coordinate. A search touches some points of nearly every group, and to have
// them come from memory takes longer than to compare them, so the smaller they
// are the better. For pose_index_kdtree.c, pose_index_pack.c and pose_index_query_packed.c,
// and pose_index.c, which frees it.
//
// A block is sixteen points, a group sixteen blocks. A coordinate counts steps
// of 1 << shift units from where its record begins, and stands for all units of
// its step: a box reaches from its low to its high step, both in units; a point
// lies somewhere in its step. A record has one shift. Own costs are counted in
// steps of 1 << fixed_cost_shift units, rounded down.
#pragma once
#include "reenact/retrieval/pose_index_layout.h"

enum { STEPS = 256 };

struct packed_group {
    uint8_t fixed_cost[LANES]; // the blocks' least
    uint8_t shifts[LANES];     // the blocks'
    uint16_t known;            // positions known in every point
    uint16_t shift;            // the boxes'
    int16_t from[];            // [position][axis]; then struct packed_boxes [position]
};
struct packed_boxes {
    uint8_t low[3][LANES], high[3][LANES];
};
struct packed_block {
    uint8_t fixed_cost[LANES]; // the points'
    int16_t from[];            // [position][axis]; then struct packed_points [position]
};
struct packed_points {
    uint8_t at[3][LANES];
};

struct packed_index {
    size_t group_bytes, block_bytes; // of a record, whole lines
    unsigned char *groups, *blocks;  // records
    int fixed_cost_shift;
    // The boxes of whole groups, sixteen side by side, in units.
    struct box_lanes *wide_boxes; // [sixteen groups][position]
    lanes *wide_fixed_cost;       // [sixteen groups], the groups'
    const char *payload;          // what pose_index_pack was told
    size_t payload_bytes;
};

static inline int64_t packed_blocks_of(int64_t count) { return (count + LANES - 1) / LANES; }

static inline struct packed_group *packed_group_at(const struct packed_index *s, int64_t group)
{
    return (struct packed_group *)(void *)(s->groups + (size_t)group * s->group_bytes);
}

static inline struct packed_block *packed_block_at(const struct packed_index *s, int64_t block)
{
    return (struct packed_block *)(void *)(s->blocks + (size_t)block * s->block_bytes);
}

static inline struct packed_boxes *packed_group_boxes(const struct pose_index *n, const struct packed_group *g)
{
    return (struct packed_boxes *)(uintptr_t)(g->from + 3 * n->positions);
}

static inline struct packed_points *packed_block_points(const struct pose_index *n, const struct packed_block *b)
{
    return (struct packed_points *)(uintptr_t)(b->from + 3 * n->positions);
}

// Of a point that is not yet settled: its coordinate in a dimension (position and axis), units, lower than any other
// where it is unknown; and its own cost.
static inline int16_t pose_index_coordinate(const struct pose_index *n, int64_t point, int dimension)
{
    int64_t block = point / BLOCK;
    int position = dimension / 3;
    bool known = n->heads[block].known >> position & 1;
    return known ? n->points[block * n->positions + position].at[dimension % 3][point % BLOCK] : -UNBOUNDED;
}

static inline int16_t pose_index_fixed_cost(const struct pose_index *n, int64_t point)
{
    return n->heads[point / BLOCK].fixed_cost[point % BLOCK];
}

// Puts points that are alike side by side: halves, again and again, until a half is a block, as the leaves of a k-d
// tree, but halves end where groups and blocks do.
void pose_index_order_kdtree(const struct pose_index *n, int64_t *points, int64_t count);

void packed_index_close(struct packed_index **s);
