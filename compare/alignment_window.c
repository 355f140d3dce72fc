// The dynamic programme of alignment.h over the cells of a window.
#include "compare/alignment_internal.h"

#include <stdlib.h>
#include <string.h>

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

int32_t feature_cost(const struct feature_frame *a, const struct feature_frame *b) { return cost_of(a, b); }

void alignment_free(struct alignment *a)
{
    free(a->pairs);
    *a = (struct alignment){0};
}

enum status cells_open(struct alignment_window *w, int32_t rows)
{
    *w = (struct alignment_window){.begin = calloc((size_t)rows, sizeof *w->begin),
                                   .end = calloc((size_t)rows, sizeof *w->end),
                                   .offset = calloc((size_t)rows, sizeof *w->offset)};
    if (w->begin && w->end && w->offset)
        return OK;
    cells_close(w);
    return fail(ERR_MEMORY, "no memory to align two movements");
}

void cells_close(struct alignment_window *w)
{
    free(w->begin);
    free(w->end);
    free(w->offset);
    *w = (struct alignment_window){0};
}

void cells_count(struct alignment_window *w, int32_t rows)
{
    w->cells = 0;
    for (int32_t i = 0; i < rows; i++) {
        w->offset[i] = w->cells;
        if (w->end[i] > w->begin[i])
            w->cells += w->end[i] - w->begin[i];
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
};

// Prices of the cells from which a cell can be reached.
struct neighbors {
    int64_t above_left, above, left;
};

// The best way to cell (i, j) before its own cost: which step, and its price without c and with `twice` if 2 c follow.
static inline int64_t arrive(const struct programme *p, struct neighbors near, int32_t i, int32_t j, int32_t c,
                             uint8_t *from)
{
    const int64_t above_left = near.above_left, above = near.above, left = near.left;
    const int64_t skipped = (int64_t)p->prices->skip_a * i + (int64_t)p->prices->skip_b * j;
    int64_t before = above_left < skipped ? above_left : skipped;
    *from = above_left <= skipped ? FROM_BOTH : FROM_START;
    int64_t price = before + 2 * (int64_t)c;
    if (above != ALIGNMENT_INFINITE && above + c + p->prices->step < price) {
        price = above + c + p->prices->step;
        *from = FROM_A;
    }
    if (left != ALIGNMENT_INFINITE && left + c + p->prices->step < price) {
        price = left + c + p->prices->step;
        *from = FROM_B;
    }
    return price;
}

// The least that any way to the cell costs, before its cost is known.
static inline int64_t at_least(const struct programme *p, struct neighbors near, int32_t i, int32_t j)
{
    int64_t least = (int64_t)p->prices->skip_a * i + (int64_t)p->prices->skip_b * j;
    least = near.above_left < least ? near.above_left : least;
    least = near.above < least ? near.above : least;
    return near.left < least ? near.left : least;
}

static void fill_row(struct programme *p, int32_t i)
{
    const struct alignment_bound *bound = p->bound;
    const int32_t begin = p->w->begin[i], end = p->w->end[i];
    const struct feature_frame *row = &p->a->frames[i];
    const int64_t *rest = bound ? bound->rest + (int64_t)(i / bound->block) * bound->columns : NULL;
    uint8_t *from = p->from + p->w->offset[i] - begin;
    int64_t left = ALIGNMENT_INFINITE, above_left = begin ? p->above[begin - 1] : ALIGNMENT_INFINITE;
    for (int32_t j = begin; j < end; j++) {
        const int64_t above = p->above[j];
        const int64_t limit = rest ? bound->best - rest[j / bound->block] : ALIGNMENT_INFINITE;
        int64_t price = ALIGNMENT_INFINITE;
        const struct neighbors near = {above_left, above, left};
        if (at_least(p, near, i, j) <= limit) {
            const int32_t c = cost_of(row, &p->b->frames[j]);
            p->cells++;
            price = arrive(p, near, i, j, c, &from[j]);
            const int64_t total = price + (int64_t)p->prices->skip_a * (p->a->count - 1 - i) +
                                  (int64_t)p->prices->skip_b * (p->b->count - 1 - j);
            if (total < p->best) {
                p->best = total;
                p->best_a = i;
                p->best_b = j;
            }
            if (price > limit)
                price = ALIGNMENT_INFINITE;
        }
        p->here[j] = left = price;
        above_left = above;
    }
}

static void clear_row(const struct alignment_window *w, int32_t i, int64_t *row)
{
    for (int32_t j = w->begin[i]; j < w->end[i]; j++)
        row[j] = ALIGNMENT_INFINITE;
}

static enum status trace_back(const struct programme *p, struct alignment *out)
{
    int32_t i = p->best_a, j = p->best_b, count = 0;
    for (int pass = 0; pass < 2; pass++) {
        i = p->best_a;
        j = p->best_b;
        int32_t at = count;
        for (bool started = false; !started;) {
            if (pass)
                out->pairs[--at] = (struct alignment_pair){i, j};
            else
                count++;
            const uint8_t from = p->from[p->w->offset[i] + j - p->w->begin[i]];
            started = from == FROM_START;
            i -= from == FROM_BOTH || from == FROM_A;
            j -= from == FROM_BOTH || from == FROM_B;
        }
        if (!pass && !(out->pairs = malloc((size_t)count * sizeof *out->pairs)))
            return fail(ERR_MEMORY, "no memory to align two movements");
    }
    out->count = count;
    out->price = p->best;
    out->cells = p->cells;
    return OK;
}

enum status align_in_window(const struct features *a, const struct features *b, const struct alignment_prices *prices,
                            const struct alignment_window *w, const struct alignment_bound *bound,
                            struct alignment *out)
{
    struct programme p = {.a = a, .b = b, .prices = prices, .w = w, .bound = bound, .best = ALIGNMENT_INFINITE};
    p.above = malloc((size_t)b->count * sizeof *p.above);
    p.here = malloc((size_t)b->count * sizeof *p.here);
    p.from = malloc((size_t)(w->cells > 0 ? w->cells : 1));
    *out = (struct alignment){0};
    enum status status = p.above && p.here && p.from ? OK : fail(ERR_MEMORY, "no memory to align two movements");
    for (int32_t j = 0; j < b->count && status == OK; j++)
        p.above[j] = p.here[j] = ALIGNMENT_INFINITE;
    for (int32_t i = 0; i < a->count && status == OK; i++) {
        fill_row(&p, i);
        if (i > 0)
            clear_row(w, i - 1, p.above);
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
