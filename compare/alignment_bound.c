#include "compare/alignment_bound.h"

#include "compare/alignment_internal.h"
#include "compare/feature_box.h"

#include <stdlib.h>
#include <string.h>

// FINEST: frames in a block of the finest level; each coarser one has COARSER times as many, until it is at most MOST
// blocks wide and high. Chosen by time on the alignments of reenact-bench compare and growth.
enum { FINEST = 6, COARSER = 2, MOST = 24, LEVELS = 12 };

static struct feature_box *boxes_of(const struct features *f, int block, int32_t blocks)
{
    struct feature_box *boxes = malloc((size_t)blocks * sizeof *boxes);
    for (int32_t k = 0; boxes && k < blocks; k++) {
        const int32_t first = k * block;
        boxes[k] = feature_box_of(f, first, f->count - first > block ? first + block : f->count);
    }
    return boxes;
}

void block_level_close(struct block_level *l)
{
    free(l->begin);
    free(l->end);
    free(l->offset);
    free(l->least);
    free(l->before);
    free(l->after);
    *l = (struct block_level){0};
}

// ------------------------------------------------------------- the window

// What a path of at most `best` can go through of that row, as an interval; empty: begin = end.
static void alive_columns(const struct block_level *l, int32_t row, int64_t best, int32_t *begin, int32_t *end)
{
    *begin = *end = 0;
    for (int32_t column = l->begin[row]; column < l->end[row]; column++) {
        const int64_t at = l->offset[row] + column - l->begin[row];
        if (l->before[at] + l->after[at] > best)
            continue;
        *begin = *end ? *begin : column;
        *end = column + 1;
    }
}

void block_level_window(const struct block_level *l, int64_t best, const struct features *a, const struct features *b,
                        struct alignment_window *w)
{
    for (int32_t row = 0; row < l->rows; row++) {
        int32_t begin, end;
        alive_columns(l, row, best, &begin, &end);
        for (int32_t i = row * l->block; end && i < (row + 1) * l->block && i < a->count; i++) {
            w->begin[i] = begin * l->block;
            w->end[i] = end * l->block < b->count ? end * l->block : b->count;
        }
    }
    cells_count(w, a->count);
}

// coarser NULL: all columns.
static enum status level_open(struct block_level *l, const struct features *a, const struct features *b,
                              const struct block_level *coarser, int64_t best)
{
    l->rows = (a->count + l->block - 1) / l->block;
    l->columns = (b->count + l->block - 1) / l->block;
    l->begin = calloc((size_t)l->rows, sizeof *l->begin);
    l->end = calloc((size_t)l->rows, sizeof *l->end);
    l->offset = calloc((size_t)l->rows, sizeof *l->offset);
    if (!l->begin || !l->end || !l->offset)
        return fail(ERR_MEMORY, "no memory to align two movements");
    for (int32_t row = 0; row < l->rows; row++) {
        int32_t begin = 0, end = l->columns;
        if (coarser && row % COARSER == 0)
            alive_columns(coarser, row / COARSER, best, &begin, &end);
        if (coarser && row % COARSER) {
            l->begin[row] = l->begin[row - 1];
            l->end[row] = l->end[row - 1];
        } else {
            l->begin[row] = coarser ? begin * COARSER : 0;
            l->end[row] = !coarser || end * COARSER > l->columns ? l->columns : end * COARSER;
        }
        l->offset[row] = l->cells;
        l->cells += l->end[row] - l->begin[row];
    }
    const size_t cells = (size_t)l->cells + 1;
    l->least = malloc(cells * sizeof *l->least);
    l->before = malloc(cells * sizeof *l->before);
    l->after = malloc(cells * sizeof *l->after);
    return l->least && l->before && l->after ? OK : fail(ERR_MEMORY, "no memory to align two movements");
}

static enum status fill_costs(struct block_level *l, const struct features *a, const struct features *b)
{
    struct feature_box *rows = boxes_of(a, l->block, l->rows), *columns = boxes_of(b, l->block, l->columns);
    const bool have = rows && columns;
    for (int32_t row = 0; row < l->rows && have; row++)
        for (int32_t column = l->begin[row]; column < l->end[row]; column++)
            l->least[l->offset[row] + column - l->begin[row]] = feature_box_cost(&rows[row], &columns[column]);
    free(rows);
    free(columns);
    return have ? OK : fail(ERR_MEMORY, "no memory to align two movements");
}

// ------------------------------------------------------------- the chains

// One pass over the blocks, from the first to the last or back. Both movements are counted in the pass's direction.
struct pass {
    const struct block_level *l;
    const struct alignment_prices *prices;
    int32_t a_count, b_count; // frames
    bool back;
    int64_t *sum;          // what is filled: of the level's cells
    int64_t *above, *here; // [columns]: the least price of the rows up to one on chains that end in each column
    int64_t *column;       // [columns]: of the columns up to this one, on chains that end in the rows so far
    int32_t above_begin, above_end;
};

static int64_t smaller(int64_t a, int64_t b) { return a < b ? a : b; }

// Frames in block k, and in all before it (or after it, where the pass goes back).
static int32_t frames_in(const struct pass *p, int32_t k, int32_t count)
{
    const int32_t first = k * p->l->block;
    return count - first < p->l->block ? count - first : p->l->block;
}

static int32_t frames_before(const struct pass *p, int32_t k, int32_t count)
{
    return p->back ? count - k * p->l->block - frames_in(p, k, count) : k * p->l->block;
}

// A chain goes on through a block of `frames`, or begins in it, where some of these may still be left out.
static int64_t go_on(int64_t chain, int64_t skipped, int32_t frames, int32_t cost, int32_t skip)
{
    return smaller(chain + (int64_t)frames * cost, skipped + (int64_t)frames * (cost < skip ? cost : skip));
}

static void pass_row(struct pass *p, int32_t row)
{
    const struct block_level *l = p->l;
    const int32_t begin = l->begin[row], count = l->end[row] - begin, step = p->back ? -1 : 1;
    const int32_t rows = frames_in(p, row, p->a_count);
    const int64_t skipped_a = (int64_t)p->prices->skip_a * frames_before(p, row, p->a_count);
    int64_t chain_a = ALIGNMENT_INFINITE; // the least of the row before, up to this column
    int32_t next = p->back ? p->above_end - 1 : p->above_begin;
    for (int32_t k = 0; k < count; k++) {
        const int32_t column = p->back ? l->end[row] - 1 - k : begin + k, before = column - step;
        const int64_t at = l->offset[row] + column - begin;
        const int32_t cost = l->least[at], columns = frames_in(p, column, p->b_count);
        const int64_t skipped_b = (int64_t)p->prices->skip_b * frames_before(p, column, p->b_count);
        for (; next >= p->above_begin && next < p->above_end && (p->back ? next >= column : next <= column);
             next += step)
            chain_a = smaller(chain_a, p->above[next]);
        const int64_t chain_b = before >= 0 && before < l->columns ? p->column[before] : ALIGNMENT_INFINITE;
        p->sum[at] = smaller(chain_a, skipped_a) + smaller(chain_b, skipped_b);
        p->here[column] = go_on(chain_a, skipped_a, rows, cost, p->prices->skip_a);
        p->column[column] = smaller(p->column[column], go_on(chain_b, skipped_b, columns, cost, p->prices->skip_b));
    }
    p->above_begin = begin;
    p->above_end = l->end[row];
    int64_t *swap = p->above;
    p->above = p->here;
    p->here = swap;
}

static void pass_all(struct pass *p)
{
    for (int32_t column = 0; column < p->l->columns; column++)
        p->column[column] = ALIGNMENT_INFINITE;
    p->above_begin = p->above_end = 0;
    for (int32_t k = 0; k < p->l->rows; k++)
        pass_row(p, p->back ? p->l->rows - 1 - k : k);
}

static enum status add_chains(struct block_level *l, const struct features *a, const struct features *b,
                              const struct alignment_prices *prices)
{
    int64_t *scratch = malloc(3 * (size_t)l->columns * sizeof *scratch);
    if (!scratch)
        return fail(ERR_MEMORY, "no memory to align two movements");
    struct pass p = {.l = l,
                     .prices = prices,
                     .a_count = a->count,
                     .b_count = b->count,
                     .sum = l->before,
                     .above = scratch,
                     .here = scratch + l->columns,
                     .column = scratch + 2 * (size_t)l->columns};
    pass_all(&p);
    p.back = true;
    p.sum = l->after;
    pass_all(&p);
    free(scratch);
    return OK;
}

enum status bound_paths(const struct features *a, const struct features *b, const struct alignment_prices *prices,
                        int64_t best, struct block_level *out)
{
    struct block_level coarser = {0};
    const int32_t longer = a->count > b->count ? a->count : b->count;
    int block = FINEST;
    for (int k = 0; k < LEVELS && longer / block > MOST; k++)
        block *= COARSER;
    enum status status = OK;
    *out = (struct block_level){0};
    for (bool first = true; status == OK && block >= FINEST; block /= COARSER, first = false) {
        block_level_close(&coarser);
        coarser = *out;
        *out = (struct block_level){.block = block};
        status = level_open(out, a, b, first ? NULL : &coarser, best);
        if (status == OK)
            status = fill_costs(out, a, b);
        if (status == OK)
            status = add_chains(out, a, b, prices);
    }
    block_level_close(&coarser);
    if (status != OK)
        block_level_close(out);
    return status;
}
