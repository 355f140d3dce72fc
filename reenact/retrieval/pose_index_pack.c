#include "reenact/retrieval/pose_index_packed.h"

#include <stdlib.h>
#include <string.h>

// ---------------------------------------------------------------- records

// Known in all of them.
static uint32_t known_in(const struct nearest *n, const int64_t *points, int count)
{
    uint32_t known = UINT32_MAX;
    for (int i = 0; i < count; i++)
        known &= n->heads[points[i] / BLOCK].known;
    return known;
}

static int16_t least_own(const struct nearest *n, const int64_t *points, int count)
{
    int16_t least = SUM_MOST;
    for (int i = 0; i < count; i++)
        least = nearest_own(n, points[i]) < least ? nearest_own(n, points[i]) : least;
    return least;
}

// Where some points are along one axis of one place; anywhere, if one of them is unknown.
struct span {
    int16_t low, high;
};

static struct span span_of(const struct nearest *n, int dimension, const int64_t *points, int count)
{
    struct span span = {FAR, -ANYWHERE};
    if (!(known_in(n, points, count) >> dimension / 3 & 1))
        return (struct span){-ANYWHERE, FAR};
    for (int i = 0; i < count; i++) {
        int16_t at = nearest_coordinate(n, points[i], dimension);
        span.low = at < span.low ? at : span.low;
        span.high = at > span.high ? at : span.high;
    }
    return span;
}

// The spans of all dimensions; the least shift with which 256 steps reach across each whose place is known, rounded up
// as a box's high end is.
static int measure(const struct nearest *n, uint32_t known, const int64_t *points, int count, struct span *spans)
{
    int widest = 0, shift = 0;
    for (int d = 0; d < 3 * n->places; d++) {
        spans[d] = span_of(n, d, points, count);
        int width = spans[d].high - spans[d].low;
        if (known >> d / 3 & 1 && width > widest)
            widest = width;
    }
    while ((widest + (1 << shift) - 1) >> shift >= STEPS)
        shift++;
    return shift;
}

static uint8_t steps(int at, int from, int shift)
{
    int step = (at - from) >> shift;
    return (uint8_t)(step < 0 ? 0 : step < STEPS ? step : STEPS - 1);
}

static uint8_t own_steps(const struct settled *s, int16_t own) { return (uint8_t)(own >> s->own_shift); }

// Returns its shift. What is not known in every point is not looked at. A block is filled up with its first point.
static int put_block(const struct nearest *n, struct settled *s, int64_t block, const int64_t *points, int count)
{
    struct settled_block *to = settled_block(s, block);
    struct settled_points *places = settled_points(n, to);
    struct span spans[3 * NEAREST_PLACES_MOST];
    int shift = measure(n, known_in(n, points, count), points, count, spans);
    for (int d = 0; d < 3 * n->places; d++)
        to->from[d] = spans[d].low;
    for (int i = 0; i < LANES; i++) {
        int64_t point = points[i < count ? i : 0];
        to->own[i] = own_steps(s, nearest_own(n, point));
        for (int d = 0; d < 3 * n->places; d++)
            places[d / 3].at[d % 3][i] = steps(nearest_coordinate(n, point, d), spans[d].low, shift);
    }
    return shift;
}

static void put_box(const struct nearest *n, struct settled_group *g, int lane, const int64_t *points, int count)
{
    struct settled_boxes *places = settled_boxes(n, g);
    for (int d = 0; d < 3 * n->places; d++) {
        struct span span = span_of(n, d, points, count);
        places[d / 3].low[d % 3][lane] = steps(span.low, g->from[d], g->shift);
        places[d / 3].high[d % 3][lane] = steps(span.high + (1 << g->shift) - 1, g->from[d], g->shift);
    }
}

static void put_wide_box(const struct nearest *n, struct settled *s, int64_t group, const struct span *spans)
{
    int64_t wide = group / LANES, lane = group % LANES;
    for (int d = 0; d < 3 * n->places; d++) {
        struct box_lanes *boxes = &s->wide_boxes[wide * n->places + d / 3];
        boxes->low[d % 3][lane] = spans[d].low;
        boxes->high[d % 3][lane] = spans[d].high;
    }
}

// A group is filled up with its first block.
static void put_group(const struct nearest *n, struct settled *s, int64_t group, const int64_t *points, int count)
{
    struct settled_group *to = settled_group(s, group);
    struct span spans[3 * NEAREST_PLACES_MOST];
    uint32_t known = known_in(n, points, count);
    to->known = (uint16_t)known;
    to->shift = (uint16_t)measure(n, known, points, count, spans);
    for (int d = 0; d < 3 * n->places; d++)
        to->from[d] = spans[d].low;
    put_wide_box(n, s, group, spans);
    s->wide_own[group / LANES][group % LANES] = least_own(n, points, count);
    for (int lane = 0; lane < LANES; lane++) {
        int first = lane * LANES < count ? lane * LANES : 0, many = count - first < LANES ? count - first : LANES;
        put_box(n, to, lane, points + first, many);
        to->own[lane] = own_steps(s, least_own(n, points + first, many));
        if (lane * LANES < count)
            to->shifts[lane] = (uint8_t)put_block(n, s, group * LANES + lane, points + first, many);
    }
}

static size_t whole_lines(size_t bytes) { return (bytes + MEMORY_LINE - 1) / MEMORY_LINE * MEMORY_LINE; }

static struct settled *settled_open(const struct nearest *n)
{
    struct settled *s = calloc(1, sizeof *s);
    if (!s)
        return NULL;
    size_t places = (size_t)n->places, from = 3 * places * sizeof(int16_t);
    size_t blocks = (size_t)settled_blocks_of(n->count), groups = (size_t)groups_of((int64_t)blocks),
           wide = (size_t)groups_of((int64_t)groups);
    s->block_bytes = whole_lines(sizeof(struct settled_block) + from + places * sizeof(struct settled_points));
    s->group_bytes = whole_lines(sizeof(struct settled_group) + from + places * sizeof(struct settled_boxes));
    // One more than needed, so that none is empty, and what is read past a record's end is there.
    s->blocks = nearest_cleared((blocks + 1) * s->block_bytes);
    s->groups = nearest_cleared((groups + 1) * s->group_bytes);
    s->wide_boxes = nearest_cleared((wide + 1) * places * sizeof *s->wide_boxes);
    s->wide_own = nearest_cleared((wide + 1) * sizeof *s->wide_own);
    if (!s->blocks || !s->groups || !s->wide_boxes || !s->wide_own)
        settled_close(&s);
    return s;
}

void settled_close(struct settled **s)
{
    if (!*s)
        return;
    free((*s)->blocks);
    free((*s)->groups);
    free((*s)->wide_boxes);
    free((*s)->wide_own);
    free(*s);
    *s = NULL;
}

// Item points[i] of `items` comes to be the i-th, by way of `copy`.
static void rearrange(char *items, char *copy, size_t bytes, const int64_t *points, int64_t count)
{
    if (bytes == 0)
        return;
    memcpy(copy, items, (size_t)count * bytes);
    for (int64_t i = 0; i < count; i++)
        memcpy(items + (size_t)i * bytes, copy + (size_t)points[i] * bytes, bytes);
}

static void put_all(const struct nearest *n, struct settled *s, const int64_t *points)
{
    enum { GROUP = LANES * LANES };
    int16_t most_own = 0;
    for (int64_t i = 0; i < n->count; i++)
        most_own = nearest_own(n, i) > most_own ? nearest_own(n, i) : most_own;
    while (most_own >> s->own_shift >= STEPS)
        s->own_shift++;
    for (int64_t i = 0; i < n->count; i += GROUP)
        put_group(n, s, i / GROUP, points + i, (int)(n->count - i < GROUP ? n->count - i : GROUP));
}

enum status nearest_settle(struct nearest *n, void *of_points, size_t bytes)
{
    assert(!n->settled);
    struct settled *s = settled_open(n);
    size_t room = (size_t)n->count + 1;
    int64_t *points = malloc(room * sizeof *points);
    uint32_t *numbers = malloc(room * sizeof *numbers);
    char *copy = malloc(room * bytes + 1);
    enum status status = s && points && numbers && copy ? OK : fail(ERR_MEMORY, "out of memory");
    if (status == OK) {
        for (int64_t i = 0; i < n->count; i++)
            points[i] = i;
        nearest_order(n, points, n->count);
        for (int64_t i = 0; i < n->count; i++)
            numbers[i] = (uint32_t)points[i];
        put_all(n, s, points);
        rearrange(of_points, copy, bytes, points, n->count);
        s->of_points = of_points;
        s->of_point_bytes = bytes;
        nearest_free_points(n);
        n->settled = s;
        n->numbers = numbers;
    } else {
        free(numbers);
        settled_close(&s);
    }
    free(copy);
    free(points);
    return status;
}
