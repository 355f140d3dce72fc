#include "compare/movement_index.h"

#include "compare/alignment_internal.h"
#include "compare/feature_box.h"

#include <stdlib.h>
#include <string.h>

enum { BLOCK = 8, MOST_QUERY = 3000 };

struct movement_index {
    struct features frames;
    struct feature_box *boxes;
    int32_t blocks;
};

// Of the block that begins with this frame.
static struct feature_box box_of(const struct features *f, int32_t first)
{
    return feature_box_of(f, first, f->count - first > BLOCK ? first + BLOCK : f->count);
}

enum status movement_index_open(struct movement_index **out, const struct features *f)
{
    *out = NULL;
    if (f->count <= 0)
        return fail(ERR_INPUT, "a movement without frames cannot be searched");
    struct movement_index *m = calloc(1, sizeof *m);
    const int32_t blocks = (f->count + BLOCK - 1) / BLOCK;
    if (m)
        m->boxes = malloc((size_t)blocks * sizeof *m->boxes);
    if (!m || !m->boxes) {
        movement_index_close(&m);
        return fail(ERR_MEMORY, "no memory to index a movement");
    }
    m->frames = *f;
    m->blocks = blocks;
    for (int32_t k = 0; k < blocks; k++)
        m->boxes[k] = box_of(f, k * BLOCK);
    *out = m;
    return OK;
}

void movement_index_close(struct movement_index **m)
{
    if (*m) {
        free((*m)->boxes);
        free(*m);
    }
    *m = NULL;
}

// rest[q][k]: what the query's frames from block q on cost at least on a path that starts in block k; one row more than
// the query has blocks, of zeros. distance: scratch, a number for each block of the index.
static void bound_starts(const struct movement_index *m, const struct features *query, int32_t step, int64_t *rest,
                         int32_t *distance)
{
    const int32_t reach = (2 * query->count + BLOCK - 1) / BLOCK + 1; // blocks that a path may touch
    const int32_t query_blocks = (query->count + BLOCK - 1) / BLOCK;
    memset(rest + (size_t)query_blocks * (size_t)m->blocks, 0, (size_t)m->blocks * sizeof *rest);
    for (int32_t q = query_blocks - 1; q >= 0; q--) {
        const int32_t first = q * BLOCK;
        const int64_t *after = rest + (size_t)(q + 1) * (size_t)m->blocks;
        int64_t *bound = rest + (size_t)q * (size_t)m->blocks;
        const struct feature_box box = box_of(query, first);
        const int32_t frames = query->count - first < BLOCK ? query->count - first : BLOCK;
        for (int32_t k = 0; k < m->blocks; k++)
            distance[k] = feature_box_cost(&box, &m->boxes[k]);
        // Frame first of the query is reached at the earliest at the start, and no path goes on beyond `reach`.
        for (int32_t k = 0; k < m->blocks; k++) {
            int32_t least = distance[k];
            for (int32_t n = k + 1; n < k + reach && n < m->blocks; n++)
                least = distance[n] < least ? distance[n] : least;
            // A frame of the query is arrived at in a step of both, 2 c, or of its own, c + step.
            bound[k] = after[k] + (int64_t)frames * (least + (least < step ? least : step));
        }
    }
}

struct row {
    int64_t price;
    int32_t start;
};

struct sought {
    const struct features *query;
    int32_t step; // price of a step in one of the two alone
};

// The best path from a start in block k. scratch: 2 (2 query + BLOCK) rows.
static void align_from(const struct movement_index *m, struct sought sought, int32_t k, const int64_t *rest,
                       struct row *scratch, struct movement_match *best)
{
    const struct features *query = sought.query;
    const int32_t step = sought.step;
    const int32_t first = k * BLOCK, remaining = m->frames.count - first;
    const int32_t width = 2 * query->count + BLOCK < remaining ? 2 * query->count + BLOCK : remaining;
    struct row *above = scratch, *here = scratch + width;
    best->tried++;
    const struct row none = {INT64_MAX / 2, 0};
    int32_t alive = 0, end = 0; // columns of the row above that a better path than the best may go through
    for (int32_t i = 0; i < query->count; i++) {
        // What is left of this block of the query is not counted.
        const int64_t limit = best->price - rest[(size_t)(i / BLOCK + 1) * (size_t)m->blocks + (size_t)k];
        const struct feature_frame frame = query->frames[i];
        const int32_t from = alive, to = i ? end : BLOCK - 1;
        struct row left = none, above_left = none;
        alive = width;
        end = 0;
        for (int32_t j = from; j < width && (j <= to || left.price <= limit); j++) {
            const struct row over = i && j < to ? above[j] : none, beside = over.price <= left.price ? over : left;
            struct row r = i ? above_left : (struct row){j < BLOCK ? 0 : none.price, j};
            above_left = over;
            if (r.price <= limit || beside.price <= limit) {
                const int64_t c = cost_of(&frame, &m->frames.frames[first + j]);
                r.price += 2 * c;
                if (beside.price + c + step < r.price)
                    r = (struct row){beside.price + c + step, beside.start};
            }
            left = here[j] = r.price <= limit && j - r.start < 2 * query->count ? r : none;
            if (left.price <= limit) {
                alive = j < alive ? j : alive;
                end = j + 1;
            }
        }
        if (alive >= end)
            return;
        struct row *swap = above;
        above = here;
        here = swap;
    }
    // Of equal ones the first counts, in whatever order the blocks are tried.
    int64_t least = best->price + (k < best->first / BLOCK);
    for (int32_t j = alive; j < end; j++)
        if (above[j].price < least) {
            least = best->price = above[j].price;
            best->first = first + above[j].start;
            best->end = first + j + 1;
        }
}

struct start {
    int64_t bound;
    int32_t block;
};

static int by_bound(const void *a, const void *b)
{
    const struct start *x = a, *y = b;
    if (x->bound != y->bound)
        return x->bound < y->bound ? -1 : 1;
    return x->block - y->block;
}

// The starts whose bounds are not above `price`, the lowest first. Returns how many.
static int32_t likely_starts(const struct movement_index *m, const int64_t *bound, int64_t price, struct start *starts)
{
    int32_t count = 0;
    for (int32_t k = 0; k < m->blocks; k++)
        if (bound[k] <= price)
            starts[count++] = (struct start){bound[k], k};
    qsort(starts, (size_t)count, sizeof *starts, by_bound);
    return count;
}

enum status movement_index_find(const struct movement_index *m, const struct features *query, int32_t step,
                                struct movement_match *out)
{
    if (query->count <= 0 || query->count > MOST_QUERY)
        return fail(ERR_INPUT, "a piece of 1 to %d frames can be searched, not of %d", MOST_QUERY, (int)query->count);
    const size_t query_blocks = ((size_t)query->count + BLOCK - 1) / BLOCK;
    int64_t *bound = malloc((query_blocks + 1) * (size_t)m->blocks * sizeof *bound);
    int32_t *distance = malloc((size_t)m->blocks * sizeof *distance);
    struct row *scratch = malloc(2 * (size_t)(2 * query->count + BLOCK) * sizeof *scratch);
    struct start *starts = malloc((size_t)m->blocks * sizeof *starts);
    struct movement_match best = {.price = INT64_MAX / 4};
    const bool have = bound && distance && scratch && starts;
    if (have) {
        bound_starts(m, query, step, bound, distance);
        int32_t likely = 0;
        for (int32_t k = 1; k < m->blocks; k++)
            likely = bound[k] < bound[likely] ? k : likely;
        align_from(m, (struct sought){query, step}, likely, bound, scratch, &best);
        const int32_t count = likely_starts(m, bound, best.price, starts);
        for (int32_t i = 0; i < count && starts[i].bound <= best.price; i++)
            if (starts[i].block != likely)
                align_from(m, (struct sought){query, step}, starts[i].block, bound, scratch, &best);
        *out = best;
    }
    free(bound);
    free(distance);
    free(scratch);
    free(starts);
    return have ? OK : fail(ERR_MEMORY, "no memory to search a movement");
}
