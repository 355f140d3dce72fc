// The nearest of many points, exactly, where a point is a handful of places in
// space (a body's joints) and how far two points are from each other is a sum
// of distances between their places. Pure; one thread at a time.
//
// The caller tells the cost of any one point; what is kept here only says which
// points need not be asked. Points come in an order in which neighbours are
// alike, as the frames of a take are: eight in a row are held in one box for
// each place, and a whole box is passed over when even its nearest corner costs
// too much. The bounds are whole numbers, so every machine asks about the same
// points; and they are never too high, so the answer is that of asking about
// all of them.
#pragma once
#include "base/geometry.h"

enum { NEAREST_PLACES_MOST = 16 };

struct nearest;

struct nearest_point {
    struct vec3 place[NEAREST_PLACES_MOST]; // metres
    uint32_t known;                         // bit i: place[i] means something
    double own_m;                           // of its cost, what does not depend on whom it is compared with; >= 0
};

// The cost of the point at `slot`, metres; negative: it cannot be chosen. Never
// less than `scale` (of a query) times the sum of the point's own and of the
// distances between the places known in both points.
typedef double nearest_cost(const void *context, int64_t slot);

// places: of each point. unit_m: what bounds are counted in; places beyond
// 8191 of it from 0 count as if they were there. capacity: of points, below 2^32 - 1.
MUST_CHECK enum status nearest_open(struct nearest **out, int places, double unit_m, int64_t capacity);
void nearest_close(struct nearest **n);

// Its number, and its slot until they are settled, is how many were there before. Not once they are settled.
void nearest_add(struct nearest *n, const struct nearest_point *point);

// After the last point, once: puts points that are alike side by side, wherever they were in the order of points, as
// the leaves of a k-d tree, so that most searches pass over 256 at once, and makes them smaller. Changes no answer.
// Worth it for points of few places; of many places, those next to each other in time are the more alike.
// of_points: what the caller keeps of each point and works costs out from, slot by slot, `bytes` each; put into the new
// order, too. It stays where it is as long as n is used, and is fetched before a cost is asked for. NULL and 0:
// nothing. ERR_MEMORY: nothing has changed.
MUST_CHECK enum status nearest_settle(struct nearest *n, void *of_points, size_t bytes);

// The slot of point `number`; takes as long as there are points.
int64_t nearest_slot(const struct nearest *n, int64_t number);

struct nearest_query {
    struct nearest *index;
    struct nearest_point point; // what is looked for
    double scale;
    const void *context; // the cost's
    int64_t number;      // found: the nearest, ties: the lowest; -1: no point can be chosen
    double cost_m;       // its
};
enum { NEAREST_QUERIES_MOST = 16 };
// Each in an index of its own; all settled or none. Several at once take less time than one after the other.
void nearest_find_all(struct nearest_query *queries, int count, nearest_cost *cost);
