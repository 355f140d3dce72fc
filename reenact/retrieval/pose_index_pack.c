// Packs a pose index: k-d order, 8-bit coordinates.
#include "reenact/retrieval/pose_index_packed.h"

#include <stdlib.h>
#include <string.h>

// ---------------------------------------------------------------- records

// Positions known in all of these points.
static uint32_t known_in(const struct pose_index *n, const int64_t *points, int count)
{
    uint32_t known = UINT32_MAX;
    for (int i = 0; i < count; i++)
        known &= n->heads[points[i] / BLOCK].known;
    return known;
}

static int16_t min_fixed_cost(const struct pose_index *n, const int64_t *points, int count)
{
    int16_t least = MAX_SUM;
    for (int i = 0; i < count; i++)
        least = pose_index_fixed_cost(n, points[i]) < least ? pose_index_fixed_cost(n, points[i]) : least;
    return least;
}

// Range of points along one axis of one position; unbounded if the position is unknown in one of them.
struct interval {
    int16_t low, high;
};

static struct interval interval_of(const struct pose_index *n, int dimension, const int64_t *points, int count)
{
    struct interval range = {MAX_COORDINATE, -UNBOUNDED};
    if (!(known_in(n, points, count) >> dimension / 3 & 1))
        return (struct interval){-UNBOUNDED, MAX_COORDINATE};
    for (int i = 0; i < count; i++) {
        int16_t at = pose_index_coordinate(n, points[i], dimension);
        range.low = at < range.low ? at : range.low;
        range.high = at > range.high ? at : range.high;
    }
    return range;
}

// Writes the intervals of all dimensions; returns the least shift with which 256 steps cover each dimension of a known
// position, with the high end rounded up.
static int measure(const struct pose_index *n, uint32_t known, const int64_t *points, int count,
                   struct interval *intervals)
{
    int widest = 0, shift = 0;
    for (int d = 0; d < 3 * n->positions; d++) {
        intervals[d] = interval_of(n, d, points, count);
        int width = intervals[d].high - intervals[d].low;
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

static uint8_t fixed_cost_steps(const struct packed_index *s, int16_t fixed_cost)
{
    return (uint8_t)(fixed_cost >> s->fixed_cost_shift);
}

// Returns the block's shift. Positions not known in every point are never read. An incomplete block is padded with its
// first point.
static int pack_block(const struct pose_index *n, struct packed_index *s, int64_t block, const int64_t *points,
                      int count)
{
    struct packed_block *to = packed_block_at(s, block);
    struct packed_points *positions = packed_block_points(n, to);
    struct interval intervals[3 * POSE_INDEX_MAX_POSITIONS];
    int shift = measure(n, known_in(n, points, count), points, count, intervals);
    for (int d = 0; d < 3 * n->positions; d++)
        to->from[d] = intervals[d].low;
    for (int i = 0; i < LANES; i++) {
        int64_t point = points[i < count ? i : 0];
        to->fixed_cost[i] = fixed_cost_steps(s, pose_index_fixed_cost(n, point));
        for (int d = 0; d < 3 * n->positions; d++)
            positions[d / 3].at[d % 3][i] = steps(pose_index_coordinate(n, point, d), intervals[d].low, shift);
    }
    return shift;
}

static void pack_box(const struct pose_index *n, struct packed_group *g, int lane, const int64_t *points, int count)
{
    struct packed_boxes *positions = packed_group_boxes(n, g);
    for (int d = 0; d < 3 * n->positions; d++) {
        struct interval range = interval_of(n, d, points, count);
        positions[d / 3].low[d % 3][lane] = steps(range.low, g->from[d], g->shift);
        positions[d / 3].high[d % 3][lane] = steps(range.high + (1 << g->shift) - 1, g->from[d], g->shift);
    }
}

static void pack_wide_box(const struct pose_index *n, struct packed_index *s, int64_t group,
                          const struct interval *intervals)
{
    int64_t wide = group / LANES, lane = group % LANES;
    for (int d = 0; d < 3 * n->positions; d++) {
        struct box_lanes *boxes = &s->wide_boxes[wide * n->positions + d / 3];
        boxes->low[d % 3][lane] = intervals[d].low;
        boxes->high[d % 3][lane] = intervals[d].high;
    }
}

// An incomplete group is padded with its first block.
static void pack_group(const struct pose_index *n, struct packed_index *s, int64_t group, const int64_t *points,
                       int count)
{
    struct packed_group *to = packed_group_at(s, group);
    struct interval intervals[3 * POSE_INDEX_MAX_POSITIONS];
    uint32_t known = known_in(n, points, count);
    to->known = (uint16_t)known;
    to->shift = (uint16_t)measure(n, known, points, count, intervals);
    for (int d = 0; d < 3 * n->positions; d++)
        to->from[d] = intervals[d].low;
    pack_wide_box(n, s, group, intervals);
    s->wide_fixed_cost[group / LANES][group % LANES] = min_fixed_cost(n, points, count);
    for (int lane = 0; lane < LANES; lane++) {
        int first = lane * LANES < count ? lane * LANES : 0, many = count - first < LANES ? count - first : LANES;
        pack_box(n, to, lane, points + first, many);
        to->fixed_cost[lane] = fixed_cost_steps(s, min_fixed_cost(n, points + first, many));
        if (lane * LANES < count)
            to->shifts[lane] = (uint8_t)pack_block(n, s, group * LANES + lane, points + first, many);
    }
}

static size_t whole_lines(size_t bytes) { return (bytes + CACHE_LINE_BYTES - 1) / CACHE_LINE_BYTES * CACHE_LINE_BYTES; }

static struct packed_index *packed_index_open(const struct pose_index *n)
{
    struct packed_index *s = calloc(1, sizeof *s);
    if (!s)
        return NULL;
    size_t positions = (size_t)n->positions, from = 3 * positions * sizeof(int16_t);
    size_t blocks = (size_t)packed_blocks_of(n->count), groups = (size_t)groups_of((int64_t)blocks),
           wide = (size_t)groups_of((int64_t)groups);
    s->block_bytes = whole_lines(sizeof(struct packed_block) + from + positions * sizeof(struct packed_points));
    s->group_bytes = whole_lines(sizeof(struct packed_group) + from + positions * sizeof(struct packed_boxes));
    // One more than needed, so that no allocation is empty and reads past a record's end are valid.
    s->blocks = pose_index_alloc_zeroed((blocks + 1) * s->block_bytes);
    s->groups = pose_index_alloc_zeroed((groups + 1) * s->group_bytes);
    s->wide_boxes = pose_index_alloc_zeroed((wide + 1) * positions * sizeof *s->wide_boxes);
    s->wide_fixed_cost = pose_index_alloc_zeroed((wide + 1) * sizeof *s->wide_fixed_cost);
    if (!s->blocks || !s->groups || !s->wide_boxes || !s->wide_fixed_cost)
        packed_index_close(&s);
    return s;
}

// Permutes `items`: item points[i] becomes the i-th. copy: scratch of the same size.
static void rearrange(char *items, char *copy, size_t bytes, const int64_t *points, int64_t count)
{
    if (bytes == 0)
        return;
    memcpy(copy, items, (size_t)count * bytes);
    for (int64_t i = 0; i < count; i++)
        memcpy(items + (size_t)i * bytes, copy + (size_t)points[i] * bytes, bytes);
}

static void pack_all(const struct pose_index *n, struct packed_index *s, const int64_t *points)
{
    enum { GROUP = LANES * LANES };
    int16_t max_fixed_cost = 0;
    for (int64_t i = 0; i < n->count; i++)
        max_fixed_cost = pose_index_fixed_cost(n, i) > max_fixed_cost ? pose_index_fixed_cost(n, i) : max_fixed_cost;
    while (max_fixed_cost >> s->fixed_cost_shift >= STEPS)
        s->fixed_cost_shift++;
    for (int64_t i = 0; i < n->count; i += GROUP)
        pack_group(n, s, i / GROUP, points + i, (int)(n->count - i < GROUP ? n->count - i : GROUP));
}

enum status pose_index_pack(struct pose_index *n, void *payload, size_t bytes)
{
    assert(!n->packed);
    struct packed_index *s = packed_index_open(n);
    size_t capacity = (size_t)n->count + 1;
    int64_t *points = malloc(capacity * sizeof *points);
    uint32_t *numbers = malloc(capacity * sizeof *numbers);
    char *copy = malloc(capacity * bytes + 1);
    enum status status = s && points && numbers && copy ? OK : fail(ERR_MEMORY, "out of memory");
    if (status == OK) {
        for (int64_t i = 0; i < n->count; i++)
            points[i] = i;
        pose_index_order_kdtree(n, points, n->count);
        for (int64_t i = 0; i < n->count; i++)
            numbers[i] = (uint32_t)points[i];
        pack_all(n, s, points);
        rearrange(payload, copy, bytes, points, n->count);
        s->payload = payload;
        s->payload_bytes = bytes;
        pose_index_free_points(n);
        n->packed = s;
        n->numbers = numbers;
    } else {
        free(numbers);
        packed_index_close(&s);
    }
    free(copy);
    free(points);
    return status;
}
