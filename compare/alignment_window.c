// The dynamic programme of alignment.h over the cells of a window.
#include "compare/alignment_internal.h"

#include <stdlib.h>
#include <string.h>

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
    int32_t alive_begin, alive_end; // columns of the row before between which prices are finite
};

// One row of cells. Everything that does not depend on the column is kept out of the loop, which is where the time
// goes.
static void fill_row(struct programme *p, int32_t i)
{
    const struct alignment_bound *bound = p->bound;
    const struct alignment_prices prices = *p->prices;
    const int32_t window = p->w->begin[i], end = p->w->end[i], block = bound ? bound->block : end + 1;
    const struct feature_frame copy = p->a->frames[i], *row = &copy; // what the loop writes cannot change it
    const int64_t *rest = bound ? bound->rest + bound->offset[i / block] - bound->begin[i / block] : NULL;
    const int64_t tail = (int64_t)prices.skip_a * (p->a->count - 1 - i) + (int64_t)prices.skip_b * (p->b->count - 1);
    const int64_t start = (int64_t)prices.skip_a * i + (int64_t)prices.skip_b * window,
                  most = bound ? bound->best : ALIGNMENT_INFINITE;
    // Where no path can start any more, cells are reached only from the row before.
    const int32_t begin = start > most && p->alive_begin > window ? p->alive_begin : window;
    int64_t skipped_b = (int64_t)prices.skip_b * begin, skipped = (int64_t)prices.skip_a * i + skipped_b;
    uint8_t *from = p->from + p->w->offset[i] - window;
    int64_t left = ALIGNMENT_INFINITE, above_left = begin ? p->above[begin - 1] : ALIGNMENT_INFINITE;
    int32_t alive_begin = end, alive_end = begin;
    for (int32_t first = begin, next; first < end; first = next) {
        next = (first / block + 1) * block < end ? (first / block + 1) * block : end;
        const int64_t limit = rest ? bound->best - rest[first / block] : ALIGNMENT_INFINITE;
        for (int32_t j = first; j < next; j++, skipped += prices.skip_b, skipped_b += prices.skip_b) {
            const int64_t above = p->above[j], before = above_left < skipped ? above_left : skipped,
                          beside = above <= left ? above : left;
            const int32_t c = cost_of(row, &p->b->frames[j]);
            const int64_t both = before + 2 * (int64_t)c, one = beside + c + prices.step;
            const uint8_t from_both = above_left <= skipped ? FROM_BOTH : FROM_START,
                          from_one = above <= left ? FROM_A : FROM_B;
            int64_t price = one < both ? one : both;
            from[j] = one < both ? from_one : from_both;
            if (price + tail - skipped_b < p->best) {
                p->best = price + tail - skipped_b;
                p->best_a = i;
                p->best_b = j;
            }
            price = price > limit ? ALIGNMENT_INFINITE : price;
            p->cells++;
            p->here[j] = left = price;
            above_left = above;
            if (price != ALIGNMENT_INFINITE) {
                alive_begin = j < alive_begin ? j : alive_begin;
                alive_end = j + 1;
            } else if (j > p->alive_end && skipped > most) {
                next = end;
                break;
            }
        }
    }
    p->alive_begin = alive_begin;
    p->alive_end = alive_end;
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
    struct programme p = {.a = a,
                          .b = b,
                          .prices = prices,
                          .w = w,
                          .bound = bound,
                          .best = ALIGNMENT_INFINITE,
                          .alive_begin = 0,
                          .alive_end = b->count};
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
