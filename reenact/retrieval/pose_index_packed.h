// Memory layout of a packed pose index: k-d tree leaves, eight bits a coordinate. A search
// touches some points of nearly every group and is limited by memory latency, so smaller
// records are faster. For pose_index*.c only.
//
// A block is sixteen points, a group sixteen blocks. A coordinate is a number of steps of
// 1 << shift units from the record's origin and stands for all units of its step: a box
// reaches from its low to its high step; a point lies anywhere in its step. A record has
// one shift. Fixed costs are in steps of 1 << fixed_cost_shift units, rounded down.
#pragma once
#include "reenact/retrieval/pose_index_layout.h"

enum { STEPS = 256 };

struct packed_group {
    uint8_t fixed_cost[LANES]; // least of each block
    uint8_t shifts[LANES];     // of the blocks' points
    uint16_t known;            // bit i: position i is known in every point
    uint16_t shift;            // of the boxes
    int16_t from[];            // origin [position][axis]; then struct packed_boxes [position]
};
struct packed_boxes {
    uint8_t low[3][LANES], high[3][LANES];
};
struct packed_block {
    uint8_t fixed_cost[LANES]; // of the points
    int16_t from[];            // origin [position][axis]; then struct packed_points [position]
};
struct packed_points {
    uint8_t at[3][LANES];
};

struct packed_index {
    size_t group_bytes, block_bytes; // of a record, whole cache lines
    unsigned char *groups, *blocks;  // records
    int fixed_cost_shift;
    struct box_lanes *wide_boxes; // [sixteen groups][position]: boxes of whole groups, units
    lanes *wide_fixed_cost;       // [sixteen groups]: least of each group
    const char *payload;          // as given to pose_index_pack
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

// Of a point before packing: its coordinate in a dimension (3 * position + axis), units, lower than any other where the
// position is unknown in its block; and its fixed cost.
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

// Reorders points into the leaves of a k-d tree: recursive halving down to blocks, with halves rounded to whole groups
// and blocks.
void pose_index_order_kdtree(const struct pose_index *n, int64_t *points, int64_t count);

void packed_index_close(struct packed_index **s);
