#include "reenact/retrieval/pose_index.h"

#include <stdlib.h>
#include <string.h>

enum {
    LANES = 8,             // points of a block, blocks of a group: bounded together, in loops that become SIMD
    MAX_COORDINATE = 8191, // units
    UNBOUNDED = 8192,      // a box from -UNBOUNDED to MAX_COORDINATE contains every position
    MAX_SUM = 32767,
};

typedef int16_t lanes[LANES]; // one number of each of eight points or boxes, units

// A position in eight points, or a corner of eight boxes.
struct position_lanes {
    lanes axis[3];
};
struct box_lanes {
    struct position_lanes low, high;
};

struct pose_index {
    int positions;
    double unit_m;
    int64_t count, capacity;
    int16_t max_distance;          // distances are clamped to this in bounds, so that their sum fits into 16 bits
    struct position_lanes *points; // [block][position]
    struct box_lanes *boxes;       // [group][position], of the blocks; unbounded where a point's position is not known
    lanes *fixed_cost;             // [block], of the points
    lanes *min_cost;               // [group], least fixed cost of the blocks' points
    lanes *bounds;                 // [group], of the blocks; scratch of a query
};

// Blocks of points, groups of blocks.
static int64_t groups_of(int64_t count) { return (count + LANES - 1) / LANES; }

enum status pose_index_open(struct pose_index **out, int positions, double unit_m, int64_t capacity)
{
    assert(positions > 0 && positions <= POSE_INDEX_MAX_POSITIONS && unit_m > 0 && capacity >= 0);
    *out = NULL;
    struct pose_index *index = calloc(1, sizeof *index);
    if (!index)
        return fail(ERR_MEMORY, "out of memory for the index of poses");
    *index = (struct pose_index){.positions = positions, .unit_m = unit_m, .capacity = capacity};
    index->max_distance = (int16_t)(MAX_SUM / (positions + 1));
    // One more than needed, so that no allocation is empty.
    const size_t blocks = (size_t)groups_of(capacity) + 1, groups = (size_t)groups_of((int64_t)blocks) + 1;
    index->points = calloc(blocks * (size_t)positions, sizeof *index->points);
    index->boxes = calloc(groups * (size_t)positions, sizeof *index->boxes);
    index->fixed_cost = calloc(blocks, sizeof *index->fixed_cost);
    index->min_cost = calloc(groups, sizeof *index->min_cost);
    index->bounds = calloc(groups, sizeof *index->bounds);
    if (!index->points || !index->boxes || !index->fixed_cost || !index->min_cost || !index->bounds) {
        pose_index_close(&index);
        return fail(ERR_MEMORY, "out of memory for the index of poses");
    }
    *out = index;
    return OK;
}

void pose_index_close(struct pose_index **index)
{
    if (!*index)
        return;
    free((*index)->points);
    free((*index)->boxes);
    free((*index)->fixed_cost);
    free((*index)->min_cost);
    free((*index)->bounds);
    free(*index);
    *index = NULL;
}

// ---------------------------------------------------------------- adding

static int16_t quantize(double m, double unit_m)
{
    const double units = m / unit_m;
    if (!(units > -MAX_COORDINATE)) // NaN, too
        return -MAX_COORDINATE;
    return units > MAX_COORDINATE ? MAX_COORDINATE : (int16_t)(units < 0 ? units - 0.5 : units + 0.5);
}

static void quantize_position(const struct vec3 *m, double unit_m, int16_t units[3])
{
    units[0] = quantize(m->x, unit_m);
    units[1] = quantize(m->y, unit_m);
    units[2] = quantize(m->z, unit_m);
}

static int16_t quantize_fixed_cost(const struct pose_index *index, double fixed_m)
{
    const double units = fixed_m / index->unit_m;
    return units < index->max_distance ? (int16_t)units : index->max_distance;
}

// opens: the position is the box's first. units: NULL: it is not known.
static void extend_box(struct box_lanes *box, int lane, bool opens, const int16_t *units)
{
    for (int axis = 0; axis < 3; axis++) {
        const int16_t low = units ? units[axis] : -UNBOUNDED, high = units ? units[axis] : MAX_COORDINATE;
        if (opens || low < box->low.axis[axis][lane])
            box->low.axis[axis][lane] = low;
        if (opens || high > box->high.axis[axis][lane])
            box->high.axis[axis][lane] = high;
    }
}

void pose_index_add(struct pose_index *index, const struct pose_index_point *point)
{
    assert(index->count < index->capacity && point->fixed_cost_m >= 0);
    const int64_t block = index->count / LANES, group = block / LANES;
    const int lane = (int)(index->count % LANES), block_lane = (int)(block % LANES);
    for (int p = 0; p < index->positions; p++) {
        const bool known = point->known >> p & 1;
        int16_t units[3] = {0};
        if (known)
            quantize_position(&point->position[p], index->unit_m, units);
        for (int axis = 0; axis < 3; axis++)
            index->points[block * index->positions + p].axis[axis][lane] = units[axis];
        extend_box(&index->boxes[group * index->positions + p], block_lane, lane == 0, known ? units : NULL);
    }
    const int16_t cost = quantize_fixed_cost(index, point->fixed_cost_m);
    index->fixed_cost[block][lane] = cost;
    if (lane == 0 || cost < index->min_cost[group][block_lane])
        index->min_cost[group][block_lane] = cost;
    index->count++;
}

// ---------------------------------------------------------------- bounds

struct search {
    struct pose_index *index;
    struct pose_index_query *query;
    int positions[POSE_INDEX_MAX_POSITIONS]; // those known in the query
    int16_t at[POSE_INDEX_MAX_POSITIONS][3]; // where they are, units
    int count;
    int16_t limit; // what is bounded above this cannot lead to a better point, nor to a tie
};

static inline int16_t larger(int16_t a, int16_t b) { return a > b ? a : b; }

// Lower bound of the length of (x, y, z), all from 0 to 16383: the dot product with (0.86, 0.36, 0.36), the largest
// component first; 4 % short on average, at most 14 %.
static inline int16_t length_at_least(int16_t x, int16_t y, int16_t z)
{
    const uint16_t sum = (uint16_t)(x + y + z);
    return (int16_t)((larger(larger(x, y), z) >> 1) + (int16_t)((uint32_t)sum * 23600 >> 16));
}

// How far a coordinate is outside an interval.
static inline int16_t interval_distance(int16_t low, int16_t high, int16_t at)
{
    return larger(larger((int16_t)(low - at), (int16_t)(at - high)), 0);
}

// Adds lower bounds of the distances of a position from boxes, or from points where both corners are the same; each at
// most `max`.
static inline void add_distances(const struct position_lanes *low, const struct position_lanes *high,
                                 const int16_t at[3], int16_t max, int16_t *restrict sums)
{
    const int16_t x = at[0], y = at[1], z = at[2];
    for (int i = 0; i < LANES; i++) {
        const int16_t distance = length_at_least(interval_distance(low->axis[0][i], high->axis[0][i], x),
                                                 interval_distance(low->axis[1][i], high->axis[1][i], y),
                                                 interval_distance(low->axis[2][i], high->axis[2][i], z));
        sums[i] = (int16_t)(sums[i] + (distance < max ? distance : max));
    }
}

static inline bool any_within(const int16_t *bounds, int16_t limit)
{
    int16_t any = 0;
    for (int i = 0; i < LANES; i++)
        any |= bounds[i] <= limit;
    return any;
}

// Writes the lower bounds of all blocks into index->bounds.
static void bound_blocks(const struct search *search)
{
    const struct pose_index *index = search->index;
    const int64_t groups = groups_of(groups_of(index->count));
    memcpy(index->bounds, index->min_cost, (size_t)groups * sizeof *index->bounds);
    for (int64_t group = 0; group < groups; group++)
        for (int k = 0; k < search->count; k++) {
            const struct box_lanes *box = &index->boxes[group * index->positions + search->positions[k]];
            add_distances(&box->low, &box->high, search->at[k], index->max_distance, index->bounds[group]);
        }
}

static void bound_points(const struct search *search, int64_t block, lanes sums)
{
    const struct pose_index *index = search->index;
    memcpy(sums, index->fixed_cost[block], sizeof(lanes));
    for (int k = 0; k < search->count; k++) {
        const int p = search->positions[k];
        const struct position_lanes *points = &index->points[block * index->positions + p];
        if (index->boxes[block / LANES * index->positions + p].low.axis[0][block % LANES] != -UNBOUNDED)
            add_distances(points, points, search->at[k], index->max_distance, sums);
    }
}

// ---------------------------------------------------------------- search

static void evaluate_point(struct search *search, int64_t number)
{
    struct pose_index_query *query = search->query;
    const double cost = query->cost(query->context, number);
    if (!(cost >= 0))
        return;
    if (query->number >= 0 && (cost > query->cost_m || (cost == query->cost_m && number > query->number)))
        return;
    query->number = number;
    query->cost_m = cost;
    // Rounding errs by less than one unit in each coordinate's difference, so by less than 0.86 + 0.36 + 0.36 units in
    // a position's bound.
    const double limit = cost / query->scale / search->index->unit_m + 1.6 * search->count + 1;
    search->limit = limit < MAX_SUM ? (int16_t)limit : MAX_SUM;
}

// The point with the least bound first: mostly, none of the others is evaluated then.
static void search_block(struct search *search, int64_t block)
{
    lanes bounds;
    bound_points(search, block, bounds);
    const int64_t first = block * LANES, rest = search->index->count - first;
    const int count = rest < LANES ? (int)rest : LANES;
    int promising = 0;
    for (int i = 1; i < count; i++)
        promising = bounds[i] < bounds[promising] ? i : promising;
    if (bounds[promising] <= search->limit)
        evaluate_point(search, first + promising);
    for (int i = 0; i < count; i++)
        if (i != promising && bounds[i] <= search->limit)
            evaluate_point(search, first + i);
}

static int64_t max_promising_block(const struct pose_index *index)
{
    const int64_t blocks = groups_of(index->count);
    int64_t promising = 0;
    for (int64_t group = 0; group < groups_of(blocks); group++) {
        const int16_t min = index->bounds[promising / LANES][promising % LANES];
        if (!any_within(index->bounds[group], (int16_t)(min - 1)))
            continue;
        for (int64_t block = group * LANES; block < blocks && block < (group + 1) * LANES; block++)
            if (index->bounds[group][block % LANES] < index->bounds[promising / LANES][promising % LANES])
                promising = block;
    }
    return promising;
}

// All blocks of a group but the one that has been searched.
static void search_group(struct search *search, int64_t group, int64_t searched)
{
    const struct pose_index *index = search->index;
    const int64_t rest = groups_of(index->count) - group * LANES;
    for (int i = 0; i < LANES && i < rest; i++)
        if (index->bounds[group][i] <= search->limit && group * LANES + i != searched)
            search_block(search, group * LANES + i);
}

void pose_index_find(struct pose_index *index, struct pose_index_query *query)
{
    assert(query->scale > 0);
    query->number = -1;
    struct search search = {.index = index, .query = query, .limit = MAX_SUM};
    for (int p = 0; p < index->positions; p++)
        if (query->point.known >> p & 1) {
            quantize_position(&query->point.position[p], index->unit_m, search.at[search.count]);
            search.positions[search.count++] = p;
        }
    if (index->count == 0)
        return;
    bound_blocks(&search);
    // The block with the least bound sets the limit for all.
    const int64_t promising = max_promising_block(index);
    search_block(&search, promising);
    for (int64_t group = 0; group < groups_of(groups_of(index->count)); group++)
        if (any_within(index->bounds[group], search.limit))
            search_group(&search, group, promising);
}
