#include "reenact/nearest_index.h"

#include <stdlib.h>

// A point's coordinate in one dimension (place and axis); those in blocks where it is unknown come first.
static int16_t key_of(const struct nearest *n, int64_t point, int dimension)
{
    int64_t block = point / BLOCK;
    int place = dimension / 3;
    bool known = n->heads[block].known >> place & 1;
    return known ? n->points[block * n->places + place].at[dimension % 3][point % BLOCK] : -ANYWHERE;
}

// Where they are spread most: the largest variance.
static int widest_dimension(const struct nearest *n, const int64_t *points, int64_t count)
{
    int widest = 0;
    double most = -1;
    for (int d = 0; d < 3 * n->places; d++) {
        int64_t sum = 0, squares = 0;
        for (int64_t i = 0; i < count; i++) {
            int64_t key = key_of(n, points[i], d);
            sum += key;
            squares += key * key;
        }
        double spread = (double)squares - (double)sum / (double)count * (double)sum;
        if (spread > most) {
            most = spread;
            widest = d;
        }
    }
    return widest;
}

// Whether point a comes before b: no two are alike.
static bool before(const struct nearest *n, int dimension, int64_t a, int64_t b)
{
    int16_t at_a = key_of(n, a, dimension), at_b = key_of(n, b, dimension);
    return at_a < at_b || (at_a == at_b && a < b);
}

// Hoare's selection: no point before `middle` comes after one from there on.
static void divide(const struct nearest *n, int dimension, int64_t *points, int64_t count, int64_t middle)
{
    int64_t low = 0, high = count - 1;
    while (low < high) {
        int64_t pivot = points[low + (high - low) / 2], i = low, j = high;
        while (i <= j) {
            while (before(n, dimension, points[i], pivot))
                i++;
            while (before(n, dimension, pivot, points[j]))
                j--;
            if (i <= j) {
                int64_t swapped = points[i];
                points[i++] = points[j];
                points[j--] = swapped;
            }
        }
        if (middle <= j)
            high = j;
        else if (middle >= i)
            low = i;
        else
            return;
    }
}

// Halves, across the widest dimension, until a half is a block: a k-d tree, but halves end where groups and blocks do.
static void order(const struct nearest *n, int64_t *points, int64_t count)
{
    while (count > BLOCK) {
        int64_t group = LANES * BLOCK, unit = count > LANES * group ? LANES * group : count > group ? group : BLOCK;
        int64_t half = (count / 2 + unit - 1) / unit * unit;
        divide(n, widest_dimension(n, points, count), points, count, half);
        order(n, points, half);
        points += half;
        count -= half;
    }
}

// Point in_order[i] of `old` becomes slot i. Of a place that is unknown somewhere in its block, no more is known.
static void rearrange(struct nearest *n, const struct nearest *old, const int64_t *in_order)
{
    n->count = 0;
    for (int64_t to = 0; to < old->count; to++) {
        int64_t from = in_order[to], block = from / BLOCK;
        int lane = (int)(from % BLOCK);
        int16_t at[NEAREST_PLACES_MOST][3] = {{0}};
        for (int p = 0; p < n->places; p++)
            for (int axis = 0; axis < 3; axis++)
                at[p][axis] = old->points[block * n->places + p].at[axis][lane];
        nearest_put(n, old->heads[block].numbers[lane], at, old->heads[block].known, old->heads[block].own[lane]);
    }
}

enum status nearest_settle(struct nearest *n, const void *costs_from, size_t cost_bytes)
{
    struct nearest *settled;
    enum status status = nearest_open(&settled, n->places, n->unit_m, n->capacity);
    if (status != OK)
        return status;
    size_t wide = (size_t)groups_of(groups_of(blocks_of(n->capacity) + 1) + 1);
    int64_t *in_order = malloc((size_t)(n->count + 1) * sizeof *in_order);
    settled->wide_boxes = calloc(wide * (size_t)n->places, sizeof *n->wide_boxes);
    settled->wide_own = calloc(wide, sizeof *n->wide_own);
    if (in_order && settled->wide_boxes && settled->wide_own) {
        for (int64_t i = 0; i < n->count; i++)
            in_order[i] = i;
        order(n, in_order, n->count);
        rearrange(settled, n, in_order);
        settled->costs_from = costs_from;
        settled->cost_bytes = cost_bytes;
        struct nearest old = *n;
        *n = *settled;
        *settled = old;
    } else
        status = fail(ERR_MEMORY, "out of memory");
    free(in_order);
    nearest_close(&settled);
    return status;
}
