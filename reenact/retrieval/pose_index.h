// Exact nearest-neighbour index of body poses, for frame selection. A point is a handful of
// positions in space (a body's joints); the cost between two points is a sum of distances
// between their positions. Pure; one thread at a time.
//
// One scan with one bound: eight points in a row share an axis-aligned box per position, and
// are looked at only where their box could hold a point as good as the best so far; the
// caller evaluates the cost of those points whose own bound could be. Points are added in an
// order in which neighbours are similar, as the frames of a take are. Bounds are integers,
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

// The cost of point `number`, metres; negative or NaN: it is excluded. At least `scale` (of
// the query) times the sum of fixed_cost_m and of the distances between the positions known
// in both points.
typedef double pose_index_cost(const void *context, int64_t number);

// positions: of each point. unit_m: quantum of the bounds; positions farther than 8191 units
// from 0 are clamped in the bounds. capacity: of points; each takes 2.5 bytes and 7.5 a
// position. ERR_MEMORY.
MUST_CHECK enum status pose_index_open(struct pose_index **out, int positions, double unit_m, int64_t capacity);
void pose_index_close(struct pose_index **index);

// The point's number is the number of points added before.
void pose_index_add(struct pose_index *index, const struct pose_index_point *point);

struct pose_index_query {
    struct pose_index_point point; // the pose to be found
    double scale;                  // of the costs, see pose_index_cost; > 0
    pose_index_cost *cost;
    const void *context; // the cost function's
    int64_t number;      // result: the nearest point, ties: the lowest; -1: all are excluded
    double cost_m;       // result: its cost
};
void pose_index_find(struct pose_index *index, struct pose_index_query *query);
