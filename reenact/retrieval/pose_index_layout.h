// The inside of pose_index.h's index while points come, for adding (pose_index.c), finding
// (pose_index_query.c) and settling (pose_index_pack.c) only.
#pragma once
#include "base/memory.h"
#include "reenact/retrieval/pose_index.h"

enum {
    BLOCK = 8,       // points in a block: they share a box, and are bounded side by side
    LANES = 16,      // blocks in a group: their boxes are bounded side by side
    FAR = 8191,      // the farthest coordinate, units
    ANYWHERE = 8192, // a box from -ANYWHERE on, as wide as FAR goes, holds every place
    SUM_MOST = 32767,
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
    _Alignas(MEMORY_LINE) points_lanes own; // units, the points'
    uint32_t known;                         // places known in every point
};

struct nearest {
    int places;
    double unit_m;
    int64_t count, capacity;
    int16_t place_most; // distances count up to this, so that their sum fits
    lanes *bounds;      // [group], nearest_find_all's working memory
    // Until they are settled:
    struct point_lanes *points; // [block][place]
    struct block_head *heads;   // [block]
    struct box_lanes *boxes;    // [group][place]
    lanes *least_own;           // [group], the blocks'
    // From then on:
    struct settled *settled;
    uint32_t *numbers; // [slot]
};

static inline int64_t blocks_of(int64_t count) { return (count + BLOCK - 1) / BLOCK; }

static inline int64_t groups_of(int64_t blocks) { return (blocks + LANES - 1) / LANES; }

// Of the point at `slot`.
static inline int64_t nearest_number(const struct nearest *n, int64_t slot)
{
    return n->settled ? n->numbers[slot] : slot;
}

// Zeros from the first byte of a line on; NULL: no memory.
void *nearest_cleared(size_t bytes);

// What points are held in before they are settled.
void nearest_free_points(struct nearest *n);

static inline int16_t units(double m, double unit_m)
{
    double u = m / unit_m;
    u = !(u > -FAR) ? -FAR : u > FAR ? FAR : u; // a NaN, too, is somewhere
    return (int16_t)(u < 0 ? u - 0.5 : u + 0.5);
}
