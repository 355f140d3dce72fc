// Memory layout of a pose index before packing; for pose_index*.c only.
#pragma once
#include "base/memory.h"
#include "reenact/retrieval/pose_index.h"

enum {
    BLOCK = 8,             // points in a block: they share a box, and are bounded together (SIMD)
    LANES = 16,            // blocks in a group: their boxes are bounded together (SIMD)
    MAX_COORDINATE = 8191, // largest coordinate, units
    UNBOUNDED = 8192,      // a box from -UNBOUNDED to MAX_COORDINATE contains every position
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

// The rest of a block: one cache line.
struct block_head {
    _Alignas(CACHE_LINE_BYTES) points_lanes fixed_cost; // of the points, units
    uint32_t known;                                     // bit i: position i is known in every point
};

struct pose_index {
    int positions;
    double unit_m;
    int64_t count, capacity;
    int16_t max_distance; // distances are clamped to this in bounds, so that their sum fits into 16 bits
    lanes *bounds;        // [group], scratch of pose_index_query_all
    // Before packing:
    struct point_lanes *points; // [block][position]
    struct block_head *heads;   // [block]
    struct box_lanes *boxes;    // [group][position]
    lanes *min_fixed_cost;      // [group], of the blocks
    // After packing:
    struct packed_index *packed;
    uint32_t *numbers; // [slot]
};

static inline int64_t blocks_of(int64_t count) { return (count + BLOCK - 1) / BLOCK; }

static inline int64_t groups_of(int64_t blocks) { return (blocks + LANES - 1) / LANES; }

// The number of the point at `slot`.
static inline int64_t pose_index_number(const struct pose_index *n, int64_t slot)
{
    return n->packed ? n->numbers[slot] : slot;
}

// Zeroed memory, aligned to cache lines; NULL: out of memory. free() releases it.
void *pose_index_alloc_zeroed(size_t bytes);

// Frees what holds the points before packing.
void pose_index_free_points(struct pose_index *n);

static inline int16_t quantize(double m, double unit_m)
{
    double u = m / unit_m;
    u = !(u > -MAX_COORDINATE) ? -MAX_COORDINATE : u > MAX_COORDINATE ? MAX_COORDINATE : u; // NaN becomes the lowest
    return (int16_t)(u < 0 ? u - 0.5 : u + 0.5);
}

static inline void quantize_position(struct vec3 m, double unit_m, int16_t units[3])
{
    units[0] = quantize(m.x, unit_m);
    units[1] = quantize(m.y, unit_m);
    units[2] = quantize(m.z, unit_m);
}
