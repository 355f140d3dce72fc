#include "reenact/nearest_index.h"

#include <stdlib.h>
#include <string.h>

// Zeros from the first byte of a line on.
static void *cleared(size_t bytes)
{
    bytes = (bytes + LINE - 1) / LINE * LINE;
    void *zeros = aligned_alloc(LINE, bytes);
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
    n->points = cleared(blocks * (size_t)places * sizeof *n->points);
    n->heads = cleared(blocks * sizeof *n->heads);
    n->boxes = cleared(groups * (size_t)places * sizeof *n->boxes);
    n->least_own = cleared(groups * sizeof *n->least_own);
    n->bounds = cleared(groups * sizeof *n->bounds);
    if (!n->points || !n->heads || !n->boxes || !n->least_own || !n->bounds) {
        nearest_close(&n);
        return fail(ERR_MEMORY, "out of memory");
    }
    *out = n;
    return OK;
}

void nearest_close(struct nearest **n)
{
    if (!*n)
        return;
    free((*n)->points);
    free((*n)->heads);
    free((*n)->boxes);
    free((*n)->least_own);
    free((*n)->wide_boxes);
    free((*n)->wide_own);
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

// Makes a group's box, in the sixteen it belongs to, hold one of its blocks.
static void widen(struct nearest *n, int64_t block)
{
    int64_t group = block / LANES, wide = group / LANES;
    int lane = (int)(group % LANES), of_block = (int)(block % LANES);
    bool first = of_block == 0;
    for (int p = 0; p < n->places; p++) {
        const struct box_lanes *from = &n->boxes[group * n->places + p];
        struct box_lanes *to = &n->wide_boxes[wide * n->places + p];
        for (int axis = 0; axis < 3; axis++) {
            int16_t low = from->low[axis][of_block], high = from->high[axis][of_block];
            if (first || low < to->low[axis][lane])
                to->low[axis][lane] = low;
            if (first || high > to->high[axis][lane])
                to->high[axis][lane] = high;
        }
    }
    if (first || n->least_own[group][of_block] < n->wide_own[wide][lane])
        n->wide_own[wide][lane] = n->least_own[group][of_block];
}

void nearest_put(struct nearest *n, int64_t number, int16_t (*places)[3], uint32_t known, int16_t own)
{
    int64_t block = n->count / BLOCK, group = block / LANES;
    int lane = (int)(n->count % BLOCK), lane_of_block = (int)(block % LANES);
    bool first = lane == 0;
    n->count++;
    n->heads[block].numbers[lane] = (uint32_t)number;
    n->heads[block].known = first ? known : n->heads[block].known & known;
    for (int p = 0; p < n->places; p++) {
        struct point_lanes *at = &n->points[block * n->places + p];
        struct box_lanes *box = &n->boxes[group * n->places + p];
        bool is_known = known >> p & 1;
        for (int axis = 0; axis < 3; axis++) {
            int16_t u = places[p][axis];
            int16_t low = is_known ? u : -ANYWHERE, high = is_known ? u : ANYWHERE;
            int16_t *box_low = &box->low[axis][lane_of_block], *box_high = &box->high[axis][lane_of_block];
            at->at[axis][lane] = u;
            if (first || low < *box_low)
                *box_low = low;
            if (first || high > *box_high)
                *box_high = high;
        }
    }
    int16_t *least = &n->least_own[group][lane_of_block];
    n->heads[block].own[lane] = own;
    if (first || own < *least)
        *least = own;
    if (n->wide_boxes)
        widen(n, block);
}

void nearest_add(struct nearest *n, const struct nearest_point *point)
{
    assert(n->count < n->capacity && point->own_m >= 0);
    int16_t at[NEAREST_PLACES_MOST][3] = {{0}};
    for (int p = 0; p < n->places; p++)
        if (point->known >> p & 1)
            for (int axis = 0; axis < 3; axis++)
                at[p][axis] = units((&point->place[p].x)[axis], n->unit_m);
    nearest_put(n, n->count, at, point->known, own_units(n, point->own_m));
}
