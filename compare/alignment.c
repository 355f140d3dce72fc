#include "compare/alignment.h"

#include "compare/feature_box.h"

#include <stdlib.h>
#include <string.h>

// feature_cost, for loops.
static inline int32_t cost_of(const struct feature_frame *a, const struct feature_frame *b)
{
    const int16_t *restrict x = a->number, *restrict y = b->number;
    int32_t sum = 0;
    for (int k = 0; k < FEATURE_NUMBERS; k++) {
        const int16_t d = (int16_t)(x[k] - y[k]);
        sum += d * d;
    }
    return sum;
}

// A price that no path has; costs can be added to it.
#define ALIGNMENT_INFINITE (INT64_MAX / 4)

// Cells of row i: columns begin[i] .. end[i] - 1; empty rows are allowed. Backpointers of row i begin at offset[i].
struct alignment_window {
    int32_t *begin, *end;
    int64_t *offset;
    int64_t cells;
};

// May a path through cell (i, j) whose price is `price` when it leaves the cell still win? NULL in align_in_window:
// always.
struct alignment_bound {
    int64_t best;          // price of a known path
    const int64_t *rest;   // of the blocks of the window: at least this follows
    const int64_t *offset; // [row block]: where in `rest` that row's first block is
    const int32_t *begin;  // [row block]: the column block that it is
    int block;             // frames in a block
};

// ---------------------------------------------------------------- alignment bound, types

// Lower bounds of paths through blocks of frames: which cells of the dynamic programme a path of at most a known price
// can go through.
//
// A level cuts both movements into blocks of so many frames. No pair of frames from two blocks costs less than the
// distance of the boxes that hold the blocks' frames (as LB_Keogh for whole sequences, Keogh & Ratanamahatana 2005). Of
// a path through a block of rows and columns, the frames of A before it are paid for on a chain of blocks that never
// goes back, or left out; so are the frames of B; and so is what comes after. Two passes of a dynamic programme give
// the least such sums for every block. What remains of a coarse level is all that the next finer one looks at, so that
// similar movements cost little more than their length.

struct block_level {
    int block;             // frames
    int32_t rows, columns; // blocks
    int32_t *begin, *end;  // [rows]: columns that a path can go through
    int64_t *offset;       // [rows]: of column begin[row] in the arrays below
    int64_t cells;
    int32_t *least;          // the boxes' distance
    int64_t *before, *after; // at least this much is paid in other rows and columns
};

struct alignment_window;

static void cells_close(struct alignment_window *window);

// ---------------------------------------------------------------- alignment window

// The dynamic programme of alignment.h over the cells of a window.

int32_t feature_cost(const struct feature_frame *a, const struct feature_frame *b) { return cost_of(a, b); }

void alignment_free(struct alignment *alignment)
{
    free(alignment->pairs);
    *alignment = (struct alignment){0};
}

static enum status cells_open(struct alignment_window *window, int32_t rows)
{
    *window = (struct alignment_window){.begin = calloc((size_t)rows, sizeof *window->begin),
                                        .end = calloc((size_t)rows, sizeof *window->end),
                                        .offset = calloc((size_t)rows, sizeof *window->offset)};
    if (window->begin && window->end && window->offset)
        return OK;
    cells_close(window);
    return fail(ERR_MEMORY, "no memory to align two movements");
}

static void cells_close(struct alignment_window *window)
{
    free(window->begin);
    free(window->end);
    free(window->offset);
    *window = (struct alignment_window){0};
}

// offsets and cells from begin and end
static void cells_count(struct alignment_window *window, int32_t rows)
{
    window->cells = 0;
    for (int32_t i = 0; i < rows; i++) {
        window->offset[i] = window->cells;
        if (window->end[i] > window->begin[i])
            window->cells += window->end[i] - window->begin[i];
    }
}

enum { FROM_BOTH, FROM_A, FROM_B, FROM_START };

struct programme {
    const struct features *a, *b;
    const struct alignment_prices *prices;
    const struct alignment_window *w;
    const struct alignment_bound *bound;
    int64_t *above, *here; // prices of the row before and of this one, by column; infinite where not computed
    uint8_t *from;
    int64_t best, cells;
    int32_t best_a, best_b;
    int32_t alive_begin, alive_end; // columns of the row before between which prices are finite
};

// One row of cells. Everything that does not depend on the column is kept out of the loop, which is where the time
// goes.
static void fill_row(struct programme *programme, int32_t i)
{
    const struct alignment_bound *bound = programme->bound;
    const struct alignment_prices prices = *programme->prices;
    const int32_t window = programme->w->begin[i], end = programme->w->end[i], block = bound ? bound->block : end + 1;
    const struct feature_frame copy = programme->a->frames[i], *row = &copy; // what the loop writes cannot change it
    const int64_t *rest = bound ? bound->rest + bound->offset[i / block] - bound->begin[i / block] : NULL;
    const int64_t tail =
        (int64_t)prices.skip_a * (programme->a->count - 1 - i) + (int64_t)prices.skip_b * (programme->b->count - 1);
    const int64_t start = (int64_t)prices.skip_a * i + (int64_t)prices.skip_b * window,
                  max = bound ? bound->best : ALIGNMENT_INFINITE;
    // Where no path can start any more, cells are reached only from the row before.
    const int32_t begin = start > max && programme->alive_begin > window ? programme->alive_begin : window;
    int64_t skipped_b = (int64_t)prices.skip_b * begin, skipped = (int64_t)prices.skip_a * i + skipped_b;
    uint8_t *from = programme->from + programme->w->offset[i] - window;
    int64_t left = ALIGNMENT_INFINITE, above_left = begin ? programme->above[begin - 1] : ALIGNMENT_INFINITE;
    int32_t alive_begin = end, alive_end = begin;
    for (int32_t first = begin, next; first < end; first = next) {
        next = (first / block + 1) * block < end ? (first / block + 1) * block : end;
        const int64_t limit = rest ? bound->best - rest[first / block] : ALIGNMENT_INFINITE;
        for (int32_t j = first; j < next; j++, skipped += prices.skip_b, skipped_b += prices.skip_b) {
            const int64_t above = programme->above[j], before = above_left < skipped ? above_left : skipped,
                          beside = above <= left ? above : left;
            const int32_t c = cost_of(row, &programme->b->frames[j]);
            const int64_t both = before + 2 * (int64_t)c, one = beside + c + prices.step;
            const uint8_t from_both = above_left <= skipped ? FROM_BOTH : FROM_START,
                          from_one = above <= left ? FROM_A : FROM_B;
            int64_t price = one < both ? one : both;
            from[j] = one < both ? from_one : from_both;
            if (price + tail - skipped_b < programme->best) {
                programme->best = price + tail - skipped_b;
                programme->best_a = i;
                programme->best_b = j;
            }
            price = price > limit ? ALIGNMENT_INFINITE : price;
            programme->cells++;
            programme->here[j] = left = price;
            above_left = above;
            if (price != ALIGNMENT_INFINITE) {
                alive_begin = j < alive_begin ? j : alive_begin;
                alive_end = j + 1;
            } else if (j > programme->alive_end && skipped > max) {
                next = end;
                break;
            }
        }
    }
    programme->alive_begin = alive_begin;
    programme->alive_end = alive_end;
}

static void clear_row(const struct alignment_window *window, int32_t i, int64_t *row)
{
    for (int32_t j = window->begin[i]; j < window->end[i]; j++)
        row[j] = ALIGNMENT_INFINITE;
}

static enum status trace_back(const struct programme *programme, struct alignment *out)
{
    int32_t i = programme->best_a, j = programme->best_b, count = 0;
    for (int pass = 0; pass < 2; pass++) {
        i = programme->best_a;
        j = programme->best_b;
        int32_t at = count;
        for (bool started = false; !started;) {
            if (pass)
                out->pairs[--at] = (struct alignment_pair){i, j};
            else
                count++;
            const uint8_t from = programme->from[programme->w->offset[i] + j - programme->w->begin[i]];
            started = from == FROM_START;
            i -= from == FROM_BOTH || from == FROM_A;
            j -= from == FROM_BOTH || from == FROM_B;
        }
        if (!pass && !(out->pairs = malloc((size_t)count * sizeof *out->pairs)))
            return fail(ERR_MEMORY, "no memory to align two movements");
    }
    out->count = count;
    out->price = programme->best;
    out->cells = programme->cells;
    return OK;
}

// The best path within the window. ERR_INPUT: there is none. ERR_MEMORY.
static enum status align_in_window(const struct features *a, const struct features *b,
                                   const struct alignment_prices *prices, const struct alignment_window *window,
                                   const struct alignment_bound *bound, struct alignment *out)
{
    struct programme p = {.a = a,
                          .b = b,
                          .prices = prices,
                          .w = window,
                          .bound = bound,
                          .best = ALIGNMENT_INFINITE,
                          .alive_begin = 0,
                          .alive_end = b->count};
    p.above = malloc((size_t)b->count * sizeof *p.above);
    p.here = malloc((size_t)b->count * sizeof *p.here);
    p.from = malloc((size_t)(window->cells > 0 ? window->cells : 1));
    *out = (struct alignment){0};
    enum status status = p.above && p.here && p.from ? OK : fail(ERR_MEMORY, "no memory to align two movements");
    for (int32_t j = 0; j < b->count && status == OK; j++)
        p.above[j] = p.here[j] = ALIGNMENT_INFINITE;
    for (int32_t i = 0; i < a->count && status == OK; i++) {
        fill_row(&p, i);
        if (i > 0)
            clear_row(window, i - 1, p.above);
        int64_t *swap = p.above;
        p.above = p.here;
        p.here = swap;
    }
    if (status == OK && p.best == ALIGNMENT_INFINITE)
        status = fail(ERR_INPUT, "the movements cannot be aligned");
    if (status == OK)
        status = trace_back(&p, out);
    free(p.above);
    free(p.here);
    free(p.from);
    return status;
}

// ---------------------------------------------------------------- alignment bound

// FINEST: frames in a block of the finest level; each coarser one has COARSER times as many, until it is at most MOST
// blocks wide and high. Chosen by time on the alignments of reenact-bench compare and growth.
enum { FINEST = 6, COARSER = 2, MOST = 24, LEVELS = 12 };

static struct feature_box *boxes_of(const struct features *features, int block, int32_t blocks)
{
    struct feature_box *boxes = malloc((size_t)blocks * sizeof *boxes);
    for (int32_t k = 0; boxes && k < blocks; k++) {
        const int32_t first = k * block;
        boxes[k] = feature_box_of(features, first, features->count - first > block ? first + block : features->count);
    }
    return boxes;
}

// zeroed is fine
static void block_level_close(struct block_level *level)
{
    free(level->begin);
    free(level->end);
    free(level->offset);
    free(level->least);
    free(level->before);
    free(level->after);
    *level = (struct block_level){0};
}

// ------------------------------------------------------------- the window

// What a path of at most `best` can go through of that row, as an interval; empty: begin = end.
static void alive_columns(const struct block_level *level, int32_t row, int64_t best, int32_t *begin, int32_t *end)
{
    *begin = *end = 0;
    for (int32_t column = level->begin[row]; column < level->end[row]; column++) {
        const int64_t at = level->offset[row] + column - level->begin[row];
        if (level->before[at] + level->after[at] > best)
            continue;
        *begin = *end ? *begin : column;
        *end = column + 1;
    }
}

// The frames' cells in those blocks; window: opened for a->count rows.
static void block_level_window(const struct block_level *level, int64_t best, const struct features *a,
                               const struct features *b, struct alignment_window *window)
{
    for (int32_t row = 0; row < level->rows; row++) {
        int32_t begin, end;
        alive_columns(level, row, best, &begin, &end);
        for (int32_t i = row * level->block; end && i < (row + 1) * level->block && i < a->count; i++) {
            window->begin[i] = begin * level->block;
            window->end[i] = end * level->block < b->count ? end * level->block : b->count;
        }
    }
    cells_count(window, a->count);
}

// coarser NULL: all columns.
static enum status level_open(struct block_level *level, const struct features *a, const struct features *b,
                              const struct block_level *coarser, int64_t best)
{
    level->rows = (a->count + level->block - 1) / level->block;
    level->columns = (b->count + level->block - 1) / level->block;
    level->begin = calloc((size_t)level->rows, sizeof *level->begin);
    level->end = calloc((size_t)level->rows, sizeof *level->end);
    level->offset = calloc((size_t)level->rows, sizeof *level->offset);
    if (!level->begin || !level->end || !level->offset)
        return fail(ERR_MEMORY, "no memory to align two movements");
    for (int32_t row = 0; row < level->rows; row++) {
        int32_t begin = 0, end = level->columns;
        if (coarser && row % COARSER == 0)
            alive_columns(coarser, row / COARSER, best, &begin, &end);
        if (coarser && row % COARSER) {
            level->begin[row] = level->begin[row - 1];
            level->end[row] = level->end[row - 1];
        } else {
            level->begin[row] = coarser ? begin * COARSER : 0;
            level->end[row] = !coarser || end * COARSER > level->columns ? level->columns : end * COARSER;
        }
        level->offset[row] = level->cells;
        level->cells += level->end[row] - level->begin[row];
    }
    const size_t cells = (size_t)level->cells + 1;
    level->least = malloc(cells * sizeof *level->least);
    level->before = malloc(cells * sizeof *level->before);
    level->after = malloc(cells * sizeof *level->after);
    return level->least && level->before && level->after ? OK : fail(ERR_MEMORY, "no memory to align two movements");
}

static enum status fill_costs(struct block_level *level, const struct features *a, const struct features *b)
{
    struct feature_box *rows = boxes_of(a, level->block, level->rows),
                       *columns = boxes_of(b, level->block, level->columns);
    const bool have = rows && columns;
    for (int32_t row = 0; row < level->rows && have; row++)
        for (int32_t column = level->begin[row]; column < level->end[row]; column++)
            level->least[level->offset[row] + column - level->begin[row]] =
                feature_box_cost(&rows[row], &columns[column]);
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

static int64_t min_int64(int64_t a, int64_t b) { return a < b ? a : b; }

// Frames in block k, and in all before it (or after it, where the pass goes back).
static int32_t frames_in(const struct pass *pass, int32_t k, int32_t count)
{
    const int32_t first = k * pass->l->block;
    return count - first < pass->l->block ? count - first : pass->l->block;
}

static int32_t frames_before(const struct pass *pass, int32_t k, int32_t count)
{
    return pass->back ? count - k * pass->l->block - frames_in(pass, k, count) : k * pass->l->block;
}

// A chain goes on through a block of `frames`, or begins in it, where some of these may still be left out.
static int64_t go_on(int64_t chain, int64_t skipped, int32_t frames, int32_t cost, int32_t skip)
{
    return min_int64(chain + (int64_t)frames * cost, skipped + (int64_t)frames * (cost < skip ? cost : skip));
}

static void pass_row(struct pass *pass, int32_t row)
{
    const struct block_level *l = pass->l;
    const int32_t begin = l->begin[row], count = l->end[row] - begin, step = pass->back ? -1 : 1;
    const int32_t rows = frames_in(pass, row, pass->a_count);
    const int64_t skipped_a = (int64_t)pass->prices->skip_a * frames_before(pass, row, pass->a_count);
    int64_t chain_a = ALIGNMENT_INFINITE; // the least of the row before, up to this column
    int32_t next = pass->back ? pass->above_end - 1 : pass->above_begin;
    for (int32_t k = 0; k < count; k++) {
        const int32_t column = pass->back ? l->end[row] - 1 - k : begin + k, before = column - step;
        const int64_t at = l->offset[row] + column - begin;
        const int32_t cost = l->least[at], columns = frames_in(pass, column, pass->b_count);
        const int64_t skipped_b = (int64_t)pass->prices->skip_b * frames_before(pass, column, pass->b_count);
        for (; next >= pass->above_begin && next < pass->above_end && (pass->back ? next >= column : next <= column);
             next += step)
            chain_a = min_int64(chain_a, pass->above[next]);
        const int64_t chain_b = before >= 0 && before < l->columns ? pass->column[before] : ALIGNMENT_INFINITE;
        pass->sum[at] = min_int64(chain_a, skipped_a) + min_int64(chain_b, skipped_b);
        pass->here[column] = go_on(chain_a, skipped_a, rows, cost, pass->prices->skip_a);
        pass->column[column] =
            min_int64(pass->column[column], go_on(chain_b, skipped_b, columns, cost, pass->prices->skip_b));
    }
    pass->above_begin = begin;
    pass->above_end = l->end[row];
    int64_t *swap = pass->above;
    pass->above = pass->here;
    pass->here = swap;
}

static void pass_all(struct pass *pass)
{
    for (int32_t column = 0; column < pass->l->columns; column++)
        pass->column[column] = ALIGNMENT_INFINITE;
    pass->above_begin = pass->above_end = 0;
    for (int32_t k = 0; k < pass->l->rows; k++)
        pass_row(pass, pass->back ? pass->l->rows - 1 - k : k);
}

static enum status add_chains(struct block_level *level, const struct features *a, const struct features *b,
                              const struct alignment_prices *prices)
{
    int64_t *scratch = malloc(3 * (size_t)level->columns * sizeof *scratch);
    if (!scratch)
        return fail(ERR_MEMORY, "no memory to align two movements");
    struct pass p = {.l = level,
                     .prices = prices,
                     .a_count = a->count,
                     .b_count = b->count,
                     .sum = level->before,
                     .above = scratch,
                     .here = scratch + level->columns,
                     .column = scratch + 2 * (size_t)level->columns};
    pass_all(&p);
    p.back = true;
    p.sum = level->after;
    pass_all(&p);
    free(scratch);
    return OK;
}

// The finest level, for paths of at most `best`. ERR_MEMORY.
static enum status bound_paths(const struct features *a, const struct features *b,
                               const struct alignment_prices *prices, int64_t best, struct block_level *out)
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

// ---------------------------------------------------------------- alignment

enum { CORRIDOR = 10, SMALLEST = 24 };
static const int64_t MAX_EXACT_CELLS = (int64_t)1 << 27;

static enum status check_features(const struct features *a, const struct features *b)
{
    return a->count > 0 && b->count > 0 ? OK : fail(ERR_INPUT, "a movement without frames cannot be aligned");
}

enum status align_plain(const struct features *a, const struct features *b, const struct alignment_prices *prices,
                        struct alignment *out)
{
    struct alignment_window w = {0};
    *out = (struct alignment){0};
    enum status status = check_features(a, b);
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
static enum status halve_rate(const struct features *features, struct feature_frame **frames, struct features *out)
{
    out->count = (features->count + 1) / 2;
    out->frames = *frames = malloc((size_t)out->count * sizeof **frames);
    if (!*frames)
        return fail(ERR_MEMORY, "no memory to align two movements");
    for (int32_t i = 0; i < out->count; i++) {
        const struct feature_frame *first = &features->frames[2 * i],
                                   *second = &features->frames[2 * i + (2 * i + 1 < features->count)];
        for (int k = 0; k < FEATURE_NUMBERS; k++)
            (*frames)[i].number[k] = (int16_t)((first->number[k] + second->number[k]) / 2);
    }
    return OK;
}

static void widen_row(struct alignment_window *window, int32_t row, int32_t begin, int32_t end)
{
    if (window->end[row] == 0 || begin < window->begin[row])
        window->begin[row] = begin;
    if (end > window->end[row])
        window->end[row] = end;
}

// Cells within `radius` of the pairs of a path of every second frame.
static void window_about(const struct alignment *half, int32_t rows, int32_t columns, int32_t radius,
                         struct alignment_window *window)
{
    for (int32_t k = 0; k < half->count; k++) {
        const int32_t a = 2 * half->pairs[k].a, b = 2 * half->pairs[k].b;
        const int32_t begin = b - radius > 0 ? b - radius : 0,
                      end = b + 2 + radius < columns ? b + 2 + radius : columns;
        for (int32_t i = a - radius > 0 ? a - radius : 0; i < a + 2 + radius && i < rows; i++)
            widen_row(window, i, begin, end);
    }
    cells_count(window, rows);
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
    enum status status = halve_rate(a, &frames_a, &half_a);
    if (status == OK)
        status = halve_rate(b, &frames_b, &half_b);
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
    enum status status = check_features(a, b);
    if (status != OK)
        return status;
    const bool exact = (int64_t)a->count * b->count <= MAX_EXACT_CELLS;
    if (a->count <= SMALLEST || b->count <= SMALLEST)
        return exact ? align_plain(a, b, prices, out) : align_corridor(a, b, prices, CORRIDOR, out);
    status = align_corridor(a, b, prices, exact ? 1 : CORRIDOR, out);
    if (status == OK && exact)
        status = align_pruned(a, b, prices, out);
    if (status != OK)
        alignment_free(out);
    return status;
}
