// Finding a short movement in a long one: the piece of an hour that resembles a second most.
//
// The query is aligned whole (alignment.h's prices without skips) with a piece of the long movement that is at most
// twice as long; all starts and ends are allowed (subsequence dynamic time warping, Mueller 2007). The index holds the
// boxes of blocks of 8 frames; a start is left out where the query's boxes are too far from all boxes that a path from
// there can reach. The result is that of trying every start. Immutable after opening: any number of threads may search.
//
// Memory: 20 bytes a frame. Time: an hour at 30 Hz is searched for a second in some milliseconds.
#pragma once
#include "compare/alignment.h"

struct movement_index;

// Borrows the frames, which must outlive it. ERR_INPUT: no frames. ERR_MEMORY. On failure *out is NULL.
MUST_CHECK enum status movement_index_open(struct movement_index **out, const struct features *f);
void movement_index_close(struct movement_index **m); // NULL is fine; sets *m = NULL

struct movement_match {
    int32_t first, end; // frames of the long movement
    int64_t price;      // of the alignment; / (2 * frames of the query) a mean cost
    int32_t tried;      // starts' blocks that were aligned
};
// The cheapest; the earliest of equal ones. ERR_INPUT: the query has no frames, or more than 3000. ERR_MEMORY.
MUST_CHECK enum status movement_index_find(const struct movement_index *m, const struct features *query, int32_t step,
                                           struct movement_match *out);
