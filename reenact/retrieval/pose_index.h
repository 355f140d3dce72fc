// Exact nearest-neighbour index of body poses, for frame selection. A point is a handful of
// positions in space (a body's joints); the cost between two points is a sum of distances
// between their positions. Pure; one thread at a time.
//
// Branch and bound over axis-aligned bounding boxes (after packing, over the leaves of a k-d
// tree): the caller evaluates the cost of a point, the index prunes points whose lower bound
// exceeds the best cost. Points are added in an order in which neighbours are similar, as
// the frames of a take are: eight in a row share one box per position. Bounds are integers,
// so every machine evaluates the same points; and they are admissible (never above the
// cost), so the answer is that of exhaustive search.
#pragma once
#include "base/geometry.h"

enum { POSE_INDEX_MAX_POSITIONS = 16 };

struct pose_index;

struct pose_index_point {
    struct vec3 position[POSE_INDEX_MAX_POSITIONS]; // metres
    uint32_t known;                                 // bit i: position[i] is known
    double fixed_cost_m;                            // part of the cost that does not depend on the query; >= 0
};

// The cost of the point at `slot`, metres; negative: it is excluded. At least `scale`
// (of the query) times the sum of fixed_cost_m and of the distances between the positions
// known in both points.
typedef double pose_index_cost(const void *context, int64_t slot);

// positions: of each point. unit_m: quantum of the bounds; positions farther than 8191 units
// from 0 are clamped in the bounds. capacity: of points, below 2^32 - 1. Memory of a point: 9
// bytes and 7.5 a position; packed 6 and 4, rounded up to cache lines a block. ERR_MEMORY.
MUST_CHECK enum status pose_index_open(struct pose_index **out, int positions, double unit_m, int64_t capacity);
void pose_index_close(struct pose_index **n);

// The point's number, and until packing its slot, is the number of points added before. Not after packing.
void pose_index_add(struct pose_index *n, const struct pose_index_point *point);

// After the last point, once: reorders points into the leaves of a k-d tree, so that most searches prune 256 at a time,
// and quantizes them to 8 bits a coordinate. Changes no answer. Worth it for points of few positions; with many,
// neighbours in time are more similar than k-d leaves. payload: the caller's data of each point from which costs are
// computed, by slot, `bytes` each; it is reordered, too, must stay at its address while n is used, and is prefetched
// before a cost is evaluated. NULL and 0: none. ERR_MEMORY: nothing has changed.
MUST_CHECK enum status pose_index_pack(struct pose_index *n, void *payload, size_t bytes);

// The slot of point `number`; linear in the number of points.
int64_t pose_index_slot(const struct pose_index *n, int64_t number);

struct pose_index_query {
    struct pose_index *index;
    struct pose_index_point point; // the pose to be found
    double scale;                  // of the costs, see pose_index_cost; > 0
    const void *context;           // the cost function's
    int64_t number;                // result: the nearest point, ties: the lowest; -1: all are excluded
    double cost_m;                 // result: its cost
};
enum { POSE_INDEX_MAX_QUERIES = 16 };
// Each in an index of its own; all packed or none. Together they take less time than one after the other, as memory
// latency of one overlaps with the work of others.
void pose_index_query_all(struct pose_index_query *queries, int count, pose_index_cost *cost);
