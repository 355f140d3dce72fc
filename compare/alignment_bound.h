// Lower bounds of paths through blocks of frames: which cells of the dynamic programme a path of at most a known price
// can go through.
//
// A level cuts both movements into blocks of so many frames. No pair of frames from two blocks costs less than the
// distance of the boxes that hold the blocks' frames (as LB_Keogh for whole sequences, Keogh & Ratanamahatana 2005). Of
// a path through a block of rows and columns, the frames of A before it are paid for on a chain of blocks that never
// goes back, or left out; so are the frames of B; and so is what comes after. Two passes of a dynamic programme give
// the least such sums for every block. What remains of a coarse level is all that the next finer one looks at, so that
// similar movements cost little more than their length.
#pragma once
#include "compare/alignment.h"

struct block_level {
    int block;             // frames
    int32_t rows, columns; // blocks
    int32_t *begin, *end;  // [rows]: columns that a path can go through
    int64_t *offset;       // [rows]: of column begin[row] in the arrays below
    int64_t cells;
    int32_t *least;          // the boxes' distance
    int64_t *before, *after; // at least this much is paid in other rows and columns
};
void block_level_close(struct block_level *l); // zeroed is fine

// The finest level, for paths of at most `best`. ERR_MEMORY.
MUST_CHECK enum status bound_paths(const struct features *a, const struct features *b,
                                   const struct alignment_prices *prices, int64_t best, struct block_level *out);

struct alignment_window;
// The frames' cells in those blocks; w: opened for a->count rows.
void block_level_window(const struct block_level *l, int64_t best, const struct features *a, const struct features *b,
                        struct alignment_window *w);
