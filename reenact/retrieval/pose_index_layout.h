// The inside of pose_index.h's index while points come, for adding (pose_index.c), finding
// (pose_index_query.c) and settling (pose_index_pack.c) only.
#pragma once
#include "base/memory.h"
#include "reenact/retrieval/pose_index.h"

enum {
    BLOCK = 8,             // points in a block: they share a box, and are bounded side by side
    LANES = 16,            // blocks in a group: their boxes are bounded side by side
    MAX_COORDINATE = 8191, // the farthest coordinate, units
    UNBOUNDED = 8192,      // a box from -UNBOUNDED on, as wide as MAX_COORDINATE goes, holds every position
    MAX_SUM = 32767,
};

typedef int16_t lanes[LANES];
typedef int16_t points_lanes[BLOCK];

// The points of a block, or the boxes of a group of blocks.
struct box_lanes {
    lanes low[3], high[3];
};
struct point_lanes {
    points_lanes at[3];
};

// What else there is to know of a block: a line of the caches.
struct block_head {
    _Alignas(CACHE_LINE_BYTES) points_lanes fixed_cost; // units, the points'
    uint32_t known;                                     // positions known in every point
};

struct pose_index {
    int positions;
    double unit_m;
    int64_t count, capacity;
    int16_t max_distance; // distances count up to this, so that their sum fits
    lanes *bounds;        // [group], pose_index_query_all's working memory
    // Until they are settled:
    struct point_lanes *points; // [block][position]
    struct block_head *heads;   // [block]
    struct box_lanes *boxes;    // [group][position]
    lanes *min_fixed_cost;      // [group], the blocks'
    // From then on:
    struct packed_index *packed;
    uint32_t *numbers; // [slot]
};

static inline int64_t blocks_of(int64_t count) { return (count + BLOCK - 1) / BLOCK; }

static inline int64_t groups_of(int64_t blocks) { return (blocks + LANES - 1) / LANES; }

// Of the point at `slot`.
static inline int64_t pose_index_number(const struct pose_index *n, int64_t slot)
{
    return n->packed ? n->numbers[slot] : slot;
}

// Zeros from the first byte of a line on; NULL: no memory.
void *pose_index_alloc_zeroed(size_t bytes);

// What points are held in before they are settled.
void pose_index_free_points(struct pose_index *n);

static inline int16_t quantize(double m, double unit_m)
{
    double u = m / unit_m;
    u = !(u > -MAX_COORDINATE) ? -MAX_COORDINATE : u > MAX_COORDINATE ? MAX_COORDINATE : u; // a NaN, too, is somewhere
    return (int16_t)(u < 0 ? u - 0.5 : u + 0.5);
}
