// What nearest_settle makes of an index: alike points side by side, in eight bits
// a coordinate. A search touches some points of nearly every group, and to have
// them come from memory takes longer than to compare them, so the smaller they
// are the better. For pose_index_kdtree.c, pose_index_pack.c and pose_index_query_packed.c,
// and pose_index.c, which frees it.
//
// A block is sixteen points, a group sixteen blocks. A coordinate counts steps
// of 1 << shift units from where its record begins, and stands for all units of
// its step: a box reaches from its low to its high step, both in units; a point
// lies somewhere in its step. A record has one shift. Own costs are counted in
// steps of 1 << own_shift units, rounded down.
#pragma once
#include "reenact/retrieval/pose_index_layout.h"

enum { STEPS = 256 };

struct settled_group {
    uint8_t own[LANES];    // the blocks' least
    uint8_t shifts[LANES]; // the blocks'
    uint16_t known;        // places known in every point
    uint16_t shift;        // the boxes'
    int16_t from[];        // [place][axis]; then struct settled_boxes [place]
};
struct settled_boxes {
    uint8_t low[3][LANES], high[3][LANES];
};
struct settled_block {
    uint8_t own[LANES]; // the points'
    int16_t from[];     // [place][axis]; then struct settled_points [place]
};
struct settled_points {
    uint8_t at[3][LANES];
};

struct settled {
    size_t group_bytes, block_bytes; // of a record, whole lines
    unsigned char *groups, *blocks;  // records
    int own_shift;
    // The boxes of whole groups, sixteen side by side, in units.
    struct box_lanes *wide_boxes; // [sixteen groups][place]
    lanes *wide_own;              // [sixteen groups], the groups'
    const char *of_points;        // what nearest_settle was told
    size_t of_point_bytes;
};

static inline int64_t settled_blocks_of(int64_t count) { return (count + LANES - 1) / LANES; }

static inline struct settled_group *settled_group(const struct settled *s, int64_t group)
{
    return (struct settled_group *)(void *)(s->groups + (size_t)group * s->group_bytes);
}

static inline struct settled_block *settled_block(const struct settled *s, int64_t block)
{
    return (struct settled_block *)(void *)(s->blocks + (size_t)block * s->block_bytes);
}

static inline struct settled_boxes *settled_boxes(const struct nearest *n, const struct settled_group *g)
{
    return (struct settled_boxes *)(uintptr_t)(g->from + 3 * n->places);
}

static inline struct settled_points *settled_points(const struct nearest *n, const struct settled_block *b)
{
    return (struct settled_points *)(uintptr_t)(b->from + 3 * n->places);
}

// Of a point that is not yet settled: its coordinate in a dimension (place and axis), units, lower than any other
// where it is unknown; and its own cost.
static inline int16_t nearest_coordinate(const struct nearest *n, int64_t point, int dimension)
{
    int64_t block = point / BLOCK;
    int place = dimension / 3;
    bool known = n->heads[block].known >> place & 1;
    return known ? n->points[block * n->places + place].at[dimension % 3][point % BLOCK] : -ANYWHERE;
}

static inline int16_t nearest_own(const struct nearest *n, int64_t point)
{
    return n->heads[point / BLOCK].own[point % BLOCK];
}

// Puts points that are alike side by side: halves, again and again, until a half is a block, as the leaves of a k-d
// tree, but halves end where groups and blocks do.
void nearest_order(const struct nearest *n, int64_t *points, int64_t count);

void settled_close(struct settled **s);
