#include "compare/alignment.h"

#include "compare/alignment_bound.h"
#include "compare/alignment_internal.h"

#include <stdlib.h>

enum { CORRIDOR = 10, SMALLEST = 24 };
static const int64_t MOST_EXACT_CELLS = (int64_t)1 << 27;

static enum status check(const struct features *a, const struct features *b)
{
    return a->count > 0 && b->count > 0 ? OK : fail(ERR_INPUT, "a movement without frames cannot be aligned");
}

enum status align_plain(const struct features *a, const struct features *b, const struct alignment_prices *prices,
                        struct alignment *out)
{
    struct alignment_window w = {0};
    *out = (struct alignment){0};
    enum status status = check(a, b);
    if (status == OK)
        status = cells_open(&w, a->count);
    for (int32_t i = 0; i < a->count && status == OK; i++)
        w.end[i] = b->count;
    if (status == OK) {
        cells_count(&w, a->count);
        status = align_in_window(a, b, prices, &w, NULL, out);
        out->exact = true;
    }
    cells_close(&w);
    return status;
}

// ------------------------------------------------------------- corridor (FastDTW)

// Means of two frames each; an odd last frame stays alone.
static enum status halve(const struct features *f, struct feature_frame **frames, struct features *out)
{
    out->count = (f->count + 1) / 2;
    out->frames = *frames = malloc((size_t)out->count * sizeof **frames);
    if (!*frames)
        return fail(ERR_MEMORY, "no memory to align two movements");
    for (int32_t i = 0; i < out->count; i++) {
        const struct feature_frame *first = &f->frames[2 * i], *second = &f->frames[2 * i + (2 * i + 1 < f->count)];
        for (int k = 0; k < FEATURE_NUMBERS; k++)
            (*frames)[i].number[k] = (int16_t)((first->number[k] + second->number[k]) / 2);
    }
    return OK;
}

static void widen(struct alignment_window *w, int32_t row, int32_t begin, int32_t end)
{
    if (w->end[row] == 0 || begin < w->begin[row])
        w->begin[row] = begin;
    if (end > w->end[row])
        w->end[row] = end;
}

// Cells within `radius` of the pairs of a path of every second frame.
static void window_about(const struct alignment *half, int32_t rows, int32_t columns, int32_t radius,
                         struct alignment_window *w)
{
    for (int32_t k = 0; k < half->count; k++) {
        const int32_t a = 2 * half->pairs[k].a, b = 2 * half->pairs[k].b;
        const int32_t begin = b - radius > 0 ? b - radius : 0,
                      end = b + 2 + radius < columns ? b + 2 + radius : columns;
        for (int32_t i = a - radius > 0 ? a - radius : 0; i < a + 2 + radius && i < rows; i++)
            widen(w, i, begin, end);
    }
    cells_count(w, rows);
}

enum status align_corridor(const struct features *a, const struct features *b, const struct alignment_prices *prices,
                           int32_t radius, struct alignment *out)
{
    *out = (struct alignment){0};
    if (a->count <= SMALLEST || b->count <= SMALLEST)
        return align_plain(a, b, prices, out);
    struct features half_a = {0}, half_b = {0};
    struct feature_frame *frames_a = NULL, *frames_b = NULL;
    struct alignment half = {0};
    struct alignment_window w = {0};
    enum status status = halve(a, &frames_a, &half_a);
    if (status == OK)
        status = halve(b, &frames_b, &half_b);
    if (status == OK)
        status = align_corridor(&half_a, &half_b, prices, radius, &half);
    if (status == OK)
        status = cells_open(&w, a->count);
    if (status == OK) {
        window_about(&half, a->count, b->count, radius, &w);
        status = align_in_window(a, b, prices, &w, NULL, out);
    }
    free(frames_a);
    free(frames_b);
    alignment_free(&half);
    cells_close(&w);
    return status;
}

// ------------------------------------------------------------- exact

static enum status align_pruned(const struct features *a, const struct features *b,
                                const struct alignment_prices *prices, struct alignment *known)
{
    struct block_level blocks = {0};
    struct alignment_window w = {0};
    struct alignment found = {0};
    enum status status = bound_paths(a, b, prices, known->price, &blocks);
    if (status == OK)
        status = cells_open(&w, a->count);
    if (status == OK) {
        block_level_window(&blocks, known->price, a, b, &w);
        const struct alignment_bound bound = {known->price, blocks.after, blocks.offset, blocks.begin, blocks.block};
        status = align_in_window(a, b, prices, &w, &bound, &found);
    }
    if (status == OK) {
        found.cells += known->cells;
        alignment_free(known);
        *known = found;
        known->exact = true;
    }
    block_level_close(&blocks);
    cells_close(&w);
    return status;
}

enum status align(const struct features *a, const struct features *b, const struct alignment_prices *prices,
                  struct alignment *out)
{
    *out = (struct alignment){0};
    enum status status = check(a, b);
    if (status != OK)
        return status;
    const bool exact = (int64_t)a->count * b->count <= MOST_EXACT_CELLS;
    if (a->count <= SMALLEST || b->count <= SMALLEST)
        return exact ? align_plain(a, b, prices, out) : align_corridor(a, b, prices, CORRIDOR, out);
    status = align_corridor(a, b, prices, exact ? 1 : CORRIDOR, out);
    if (status == OK && exact)
        status = align_pruned(a, b, prices, out);
    if (status != OK)
        alignment_free(out);
    return status;
}
