#include "reenact/retrieval/pose_index_packed.h"

#include <stdlib.h>
#include <string.h>

void *nearest_cleared(size_t bytes)
{
    void *zeros = memory_in_lines(bytes);
    return zeros ? memset(zeros, 0, bytes) : NULL;
}

enum status nearest_open(struct nearest **out, int places, double unit_m, int64_t capacity)
{
    assert(places > 0 && places <= NEAREST_PLACES_MOST && unit_m > 0 && capacity >= 0 && capacity < UINT32_MAX);
    *out = NULL;
    struct nearest *n = calloc(1, sizeof *n);
    if (!n)
        return fail(ERR_MEMORY, "out of memory");
    *n = (struct nearest){.places = places, .unit_m = unit_m, .capacity = capacity};
    n->place_most = (int16_t)(SUM_MOST / (places + 1));
    // One more than needed, so that none is empty.
    size_t blocks = (size_t)blocks_of(capacity) + 1, groups = (size_t)groups_of((int64_t)blocks) + 1;
    n->points = nearest_cleared(blocks * (size_t)places * sizeof *n->points);
    n->heads = nearest_cleared(blocks * sizeof *n->heads);
    n->boxes = nearest_cleared(groups * (size_t)places * sizeof *n->boxes);
    n->least_own = nearest_cleared(groups * sizeof *n->least_own);
    n->bounds = nearest_cleared(groups * sizeof *n->bounds);
    if (!n->points || !n->heads || !n->boxes || !n->least_own || !n->bounds) {
        nearest_close(&n);
        return fail(ERR_MEMORY, "out of memory");
    }
    *out = n;
    return OK;
}

void nearest_free_points(struct nearest *n)
{
    free(n->points);
    free(n->heads);
    free(n->boxes);
    free(n->least_own);
    n->points = NULL;
    n->heads = NULL;
    n->boxes = NULL;
    n->least_own = NULL;
}

void nearest_close(struct nearest **n)
{
    if (!*n)
        return;
    nearest_free_points(*n);
    settled_close(&(*n)->settled);
    free((*n)->numbers);
    free((*n)->bounds);
    free(*n);
    *n = NULL;
}

// ---------------------------------------------------------------- adding

static int16_t own_units(const struct nearest *n, double own_m)
{
    double u = own_m / n->unit_m;
    return u < n->place_most ? (int16_t)u : n->place_most;
}

void nearest_add(struct nearest *n, const struct nearest_point *point)
{
    assert(n->count < n->capacity && !n->settled && point->own_m >= 0);
    int64_t block = n->count / BLOCK, group = block / LANES;
    int lane = (int)(n->count % BLOCK), lane_of_block = (int)(block % LANES);
    bool first = lane == 0;
    n->count++;
    struct block_head *head = &n->heads[block];
    head->known = first ? point->known : head->known & point->known;
    for (int p = 0; p < n->places; p++) {
        struct point_lanes *at = &n->points[block * n->places + p];
        struct box_lanes *box = &n->boxes[group * n->places + p];
        bool is_known = point->known >> p & 1;
        for (int axis = 0; axis < 3; axis++) {
            int16_t u = is_known ? units((&point->place[p].x)[axis], n->unit_m) : 0;
            int16_t low = is_known ? u : -ANYWHERE, high = is_known ? u : FAR;
            int16_t *box_low = &box->low[axis][lane_of_block], *box_high = &box->high[axis][lane_of_block];
            at->at[axis][lane] = u;
            if (first || low < *box_low)
                *box_low = low;
            if (first || high > *box_high)
                *box_high = high;
        }
    }
    int16_t *least = &n->least_own[group][lane_of_block];
    head->own[lane] = own_units(n, point->own_m);
    if (first || head->own[lane] < *least)
        *least = head->own[lane];
}

int64_t nearest_slot(const struct nearest *n, int64_t number)
{
    assert(number >= 0 && number < n->count);
    int64_t slot = 0;
    while (nearest_number(n, slot) != number)
        slot++;
    return slot;
}
