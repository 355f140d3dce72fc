#include "compare/alignment.h"

#include "compare/alignment_internal.h"

#include <stdlib.h>
#include <string.h>

enum { BLOCK = 6, CORRIDOR = 10, SMALLEST = 24 };
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

// ------------------------------------------------------------- lower bounds

struct box {
    int16_t low[FEATURE_NUMBERS], high[FEATURE_NUMBERS];
};

static struct box *boxes_of(const struct features *f, int32_t blocks)
{
    struct box *boxes = malloc((size_t)blocks * sizeof *boxes);
    for (int32_t k = 0; boxes && k < blocks; k++) {
        struct box *box = &boxes[k];
        memcpy(box->low, f->frames[k * BLOCK].number, sizeof box->low);
        memcpy(box->high, f->frames[k * BLOCK].number, sizeof box->high);
        for (int32_t i = k * BLOCK + 1; i < (k + 1) * BLOCK && i < f->count; i++)
            for (int n = 0; n < FEATURE_NUMBERS; n++) {
                const int16_t x = f->frames[i].number[n];
                box->low[n] = x < box->low[n] ? x : box->low[n];
                box->high[n] = x > box->high[n] ? x : box->high[n];
            }
    }
    return boxes;
}

// No pair of frames from the two boxes costs less.
static int32_t box_cost(const struct box *a, const struct box *b)
{
    int32_t sum = 0;
    for (int n = 0; n < FEATURE_NUMBERS; n++) {
        const int16_t below = (int16_t)(a->low[n] - b->high[n]), above = (int16_t)(b->low[n] - a->high[n]);
        int16_t d = below > above ? below : above;
        d = d > 0 ? d : 0;
        sum += d * d;
    }
    return sum;
}

struct blocks {
    int32_t rows, columns, last_row, last_column; // last: frames in the last block
    int32_t *least;                               // [row][column]: box_cost
    int64_t *before, *after;                      // [row][column]: what the blocks of other rows and columns cost
};

static inline int32_t frames_in(int32_t k, int32_t count, int32_t last) { return k + 1 < count ? BLOCK : last; }

// Adds to sum[row][column] what frames of the rows before (direction 1) or after (-1) `row` cost at least on a monotone
// path through this block. by_column exchanges rows and columns. scratch: as many numbers as there are columns.
static void add_chain(const struct blocks *k, int64_t *sum, int direction, bool by_column, int32_t skip,
                      int64_t *scratch)
{
    const int32_t rows = by_column ? k->columns : k->rows, columns = by_column ? k->rows : k->columns;
    const int32_t last = by_column ? k->last_column : k->last_row;
    const int64_t row_stride = by_column ? 1 : k->columns, column_stride = by_column ? k->columns : 1;
    for (int32_t j = 0; j < columns; j++)
        scratch[j] = 0;
    for (int32_t r = 0; r < rows; r++) {
        const int32_t row = direction > 0 ? r : rows - 1 - r;
        const int64_t frames = frames_in(row, rows, last);
        int64_t running = ALIGNMENT_INFINITE;
        for (int32_t c = 0; c < columns; c++) {
            const int32_t column = direction > 0 ? c : columns - 1 - c;
            const int64_t at = row * row_stride + column * column_stride;
            const int32_t cost = k->least[at] < skip ? k->least[at] : skip;
            sum[at] += scratch[column];
            const int64_t through = scratch[column] + frames * cost;
            running = through < running ? through : running;
            scratch[column] = running;
        }
    }
}

static enum status bound_blocks(struct blocks *k, const struct features *a, const struct features *b,
                                const struct alignment_prices *prices)
{
    k->rows = (a->count + BLOCK - 1) / BLOCK;
    k->columns = (b->count + BLOCK - 1) / BLOCK;
    k->last_row = a->count - (k->rows - 1) * BLOCK;
    k->last_column = b->count - (k->columns - 1) * BLOCK;
    const size_t count = (size_t)k->rows * (size_t)k->columns;
    struct box *rows = boxes_of(a, k->rows), *columns = boxes_of(b, k->columns);
    int64_t *scratch = malloc((size_t)(k->rows > k->columns ? k->rows : k->columns) * sizeof *scratch);
    k->least = malloc(count * sizeof *k->least);
    k->before = calloc(count, sizeof *k->before);
    k->after = calloc(count, sizeof *k->after);
    const bool have = rows && columns && scratch && k->least && k->before && k->after;
    if (have) {
        for (int32_t i = 0; i < k->rows; i++)
            for (int32_t j = 0; j < k->columns; j++)
                k->least[(int64_t)i * k->columns + j] = box_cost(&rows[i], &columns[j]);
        add_chain(k, k->before, 1, false, prices->skip_a, scratch);
        add_chain(k, k->before, 1, true, prices->skip_b, scratch);
        add_chain(k, k->after, -1, false, prices->skip_a, scratch);
        add_chain(k, k->after, -1, true, prices->skip_b, scratch);
    }
    free(rows);
    free(columns);
    free(scratch);
    return have ? OK : fail(ERR_MEMORY, "no memory to align two movements");
}

// Rows of blocks that a path of at most `best` can go through, as an interval of columns for each row.
static void window_of_blocks(const struct blocks *k, int64_t best, const struct features *a, const struct features *b,
                             struct alignment_window *w)
{
    for (int32_t row = 0; row < k->rows; row++) {
        int32_t first = -1, last = -1;
        for (int32_t column = 0; column < k->columns; column++) {
            const int64_t at = (int64_t)row * k->columns + column;
            if (k->before[at] + k->after[at] > best)
                continue;
            first = first < 0 ? column : first;
            last = column;
        }
        for (int32_t i = row * BLOCK; first >= 0 && i < (row + 1) * BLOCK && i < a->count; i++) {
            w->begin[i] = first * BLOCK;
            w->end[i] = (last + 1) * BLOCK < b->count ? (last + 1) * BLOCK : b->count;
        }
    }
    cells_count(w, a->count);
}

static enum status align_pruned(const struct features *a, const struct features *b,
                                const struct alignment_prices *prices, struct alignment *known)
{
    struct blocks k = {0};
    struct alignment_window w = {0};
    struct alignment found = {0};
    enum status status = bound_blocks(&k, a, b, prices);
    if (status == OK)
        status = cells_open(&w, a->count);
    if (status == OK) {
        window_of_blocks(&k, known->price, a, b, &w);
        const struct alignment_bound bound = {known->price, k.after, k.columns, BLOCK};
        status = align_in_window(a, b, prices, &w, &bound, &found);
    }
    if (status == OK) {
        found.cells += known->cells;
        alignment_free(known);
        *known = found;
        known->exact = true;
    }
    free(k.least);
    free(k.before);
    free(k.after);
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
