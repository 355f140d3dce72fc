// What the files of the alignment share: a dynamic programme over a set of cells.
#pragma once
#include "compare/alignment.h"

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
MUST_CHECK enum status cells_open(struct alignment_window *w, int32_t rows);
void cells_close(struct alignment_window *w);
void cells_count(struct alignment_window *w, int32_t rows); // offsets and cells from begin and end

// May a path through cell (i, j) whose price is `price` when it leaves the cell still win? NULL in align_in_window:
// always.
struct alignment_bound {
    int64_t best;          // price of a known path
    const int64_t *rest;   // of the blocks of the window: at least this follows
    const int64_t *offset; // [row block]: where in `rest` that row's first block is
    const int32_t *begin;  // [row block]: the column block that it is
    int block;             // frames in a block
};

// The best path within the window. ERR_INPUT: there is none. ERR_MEMORY.
MUST_CHECK enum status align_in_window(const struct features *a, const struct features *b,
                                       const struct alignment_prices *prices, const struct alignment_window *w,
                                       const struct alignment_bound *bound, struct alignment *out);
