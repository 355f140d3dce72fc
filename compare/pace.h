// What the alignment of two movements says about time: pieces of the reference that the attempt lacks, pieces it adds,
// pauses, and its pace. Pure.
#pragma once
#include "compare/difference.h"

enum piece_kind {
    PIECE_MISSING,       // in A, not in B
    PIECE_EXTRA,         // in B, not in A
    PIECE_PAUSE,         // B waits where A goes on
    PIECE_PAUSE_SKIPPED, // A waits where B goes on
};

struct piece {
    enum piece_kind kind;
    int32_t a_first, a_end, b_first, b_end; // frames; of a missing piece the b's are one place, of an extra one the a's
    double turned_rad;                      // heading gained in the piece, in the movement that has it
};

struct pace {
    struct piece *pieces; // malloc'ed, in B's order
    int32_t piece_count;
    double ratio;                           // seconds of A for one of B where A moves, median; 1: as fast; 0: unknown
    int32_t missing, extra;                 // frames in such pieces
    int32_t a_first, a_end, b_first, b_end; // what is aligned
};
void pace_free(struct pace *pace); // zeroed is fine; leaves it zeroed

// Frames of A, or of B, that lie in a piece which the other does not have: true. malloc'ed, [count]; NULL: no memory.
bool *pace_left_out(const struct pace *pace, bool of_a, int32_t count);

// Takes frames of B at its ends out of the timeline (NaN) that all show A's first or last aligned frame: getting into
// position and out of it. repeated: the timeline is that of several repetitions: of these nothing is taken out, and
// pieces are not looked for. ERR_MEMORY; *out is then zeroed.
MUST_CHECK enum status pace_measure(const struct movement *a, const struct movement *b, uint16_t parts,
                                    struct timeline *t, bool repeated, struct pace *out);
