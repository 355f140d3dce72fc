// The nearest of many points, exactly, where a point is a handful of positions in
// space (a body's joints) and how far two points are from each other is a sum
// of distances between their positions. Pure; one thread at a time.
//
// The caller tells the cost of any one point; what is kept here only says which
// points need not be asked. Points come in an order in which neighbours are
// alike, as the frames of a take are: eight in a row are held in one box for
// each position, and a whole box is passed over when even its nearest corner costs
// too much. The bounds are whole numbers, so every machine asks about the same
// points; and they are never too high, so the answer is that of asking about
// all of them.
#pragma once
#include "base/geometry.h"

enum { POSE_INDEX_MAX_POSITIONS = 16 };

struct pose_index;

struct pose_index_point {
    struct vec3 position[POSE_INDEX_MAX_POSITIONS]; // metres
    uint32_t known;                                 // bit i: position[i] means something
    double fixed_cost_m; // of its cost, what does not depend on whom it is compared with; >= 0
};

// The cost of the point at `slot`, metres; negative: it cannot be chosen. Never
// less than `scale` (of a query) times the sum of the point's own and of the
// distances between the positions known in both points.
typedef double pose_index_cost(const void *context, int64_t slot);

// positions: of each point. unit_m: what bounds are counted in; positions beyond
// 8191 of it from 0 count as if they were there. capacity: of points, below 2^32 - 1.
MUST_CHECK enum status pose_index_open(struct pose_index **out, int positions, double unit_m, int64_t capacity);
void pose_index_close(struct pose_index **n);

// Its number, and its slot until they are settled, is how many were there before. Not once they are settled.
void pose_index_add(struct pose_index *n, const struct pose_index_point *point);

// After the last point, once: puts points that are alike side by side, wherever they were in the order of points, as
// the leaves of a k-d tree, so that most searches pass over 256 at once, and makes them smaller. Changes no answer.
// Worth it for points of few positions; of many positions, those next to each other in time are the more alike.
// payload: what the caller keeps of each point and works costs out from, slot by slot, `bytes` each; put into the new
// order, too. It stays where it is as long as n is used, and is fetched before a cost is asked for. NULL and 0:
// nothing. ERR_MEMORY: nothing has changed.
MUST_CHECK enum status pose_index_pack(struct pose_index *n, void *payload, size_t bytes);

// The slot of point `number`; takes as long as there are points.
int64_t pose_index_slot(const struct pose_index *n, int64_t number);

struct pose_index_query {
    struct pose_index *index;
    struct pose_index_point point; // what is looked for
    double scale;
    const void *context; // the cost's
    int64_t number;      // found: the nearest, ties: the lowest; -1: no point can be chosen
    double cost_m;       // its
};
enum { POSE_INDEX_MAX_QUERIES = 16 };
// Each in an index of its own; all settled or none. Several at once take less time than one after the other.
void pose_index_query_all(struct pose_index_query *queries, int count, pose_index_cost *cost);
