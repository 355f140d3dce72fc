// Opening, adding points, closing.
#include "reenact/retrieval/pose_index_packed.h"

#include <stdlib.h>

enum status pose_index_open(struct pose_index **out, int positions, double unit_m, int64_t capacity)
{
    assert(positions > 0 && positions <= POSE_INDEX_MAX_POSITIONS && unit_m > 0 && capacity >= 0 &&
           capacity < UINT32_MAX);
    *out = NULL;
    struct pose_index *n = calloc(1, sizeof *n);
    if (!n)
        return fail(ERR_MEMORY, "out of memory");
    *n = (struct pose_index){.positions = positions, .unit_m = unit_m, .capacity = capacity};
    n->max_distance = (int16_t)(MAX_SUM / (positions + 1));
    // One more than needed, so that no allocation is empty.
    size_t blocks = (size_t)blocks_of(capacity) + 1, groups = (size_t)groups_of((int64_t)blocks) + 1;
    n->points = pose_index_alloc_zeroed(blocks * (size_t)positions * sizeof *n->points);
    n->heads = pose_index_alloc_zeroed(blocks * sizeof *n->heads);
    n->boxes = pose_index_alloc_zeroed(groups * (size_t)positions * sizeof *n->boxes);
    n->min_fixed_cost = pose_index_alloc_zeroed(groups * sizeof *n->min_fixed_cost);
    n->bounds = pose_index_alloc_zeroed(groups * sizeof *n->bounds);
    if (!n->points || !n->heads || !n->boxes || !n->min_fixed_cost || !n->bounds) {
        pose_index_close(&n);
        return fail(ERR_MEMORY, "out of memory");
    }
    *out = n;
    return OK;
}

void pose_index_close(struct pose_index **n)
{
    if (!*n)
        return;
    pose_index_free_points(*n);
    packed_index_close(&(*n)->packed);
    free((*n)->numbers);
    free((*n)->bounds);
    free(*n);
    *n = NULL;
}

// ---------------------------------------------------------------- adding

static int16_t quantize_fixed_cost(const struct pose_index *n, double fixed_m)
{
    double u = fixed_m / n->unit_m;
    return u < n->max_distance ? (int16_t)u : n->max_distance;
}

void pose_index_add(struct pose_index *n, const struct pose_index_point *point)
{
    assert(n->count < n->capacity && !n->packed && point->fixed_cost_m >= 0);
    int64_t block = n->count / BLOCK, group = block / LANES;
    int lane = (int)(n->count % BLOCK), lane_of_block = (int)(block % LANES);
    bool first = lane == 0;
    n->count++;
    struct block_head *head = &n->heads[block];
    head->known = first ? point->known : head->known & point->known;
    for (int p = 0; p < n->positions; p++) {
        struct point_lanes *at = &n->points[block * n->positions + p];
        struct box_lanes *box = &n->boxes[group * n->positions + p];
        bool is_known = point->known >> p & 1;
        int16_t units[3] = {0};
        if (is_known)
            quantize_position(point->position[p], n->unit_m, units);
        for (int axis = 0; axis < 3; axis++) {
            int16_t u = units[axis];
            int16_t low = is_known ? u : -UNBOUNDED, high = is_known ? u : MAX_COORDINATE;
            int16_t *box_low = &box->low[axis][lane_of_block], *box_high = &box->high[axis][lane_of_block];
            at->at[axis][lane] = u;
            if (first || low < *box_low)
                *box_low = low;
            if (first || high > *box_high)
                *box_high = high;
        }
    }
    int16_t *least = &n->min_fixed_cost[group][lane_of_block];
    head->fixed_cost[lane] = quantize_fixed_cost(n, point->fixed_cost_m);
    if (first || head->fixed_cost[lane] < *least)
        *least = head->fixed_cost[lane];
}

int64_t pose_index_slot(const struct pose_index *n, int64_t number)
{
    assert(number >= 0 && number < n->count);
    int64_t slot = 0;
    while (pose_index_number(n, slot) != number)
        slot++;
    return slot;
}
