// Time alignment of two movements: dynamic time warping (Sakoe & Chiba 1978, symmetric steps) with free ends. Getting
// into position before a movement and out of it afterwards is left out at a fixed price a frame.
//
// A feature frame is FEATURE_NUMBERS 16-bit integers: the directions of the body's parts times FEATURE_UNIT. The cost
// of matching frame i of A with frame j of B, c(i, j), is the sum of the squared differences, an integer. A path is a
// chain of matched pairs; its price is
//
//     first pair            2 c   (and skip_a for each frame of A before it, skip_b for each of B)
//     one frame in both     2 c
//     one frame in A or B   c + step
//     after the last pair   skip_a, skip_b as before it
//
// so every frame of either movement is paid for exactly once, and price / (frames of A + frames of B) is a mean. All is
// computed in integers: the same bits on every machine, and the pruned search can be compared with the plain one
// exactly. Pure; any thread.
#pragma once
#include "base/status.h"

enum {
    FEATURE_NUMBERS = 40,   // a multiple of 8, so that compilers use vector instructions
    FEATURE_UNIT = 2048,    // a unit vector's length
    FEATURE_LARGEST = 3600, // no number is larger: 40 squared differences fit in 32 bits
};

struct feature_frame {
    int16_t number[FEATURE_NUMBERS];
};

struct features {
    const struct feature_frame *frames;
    int32_t count;
};

struct alignment_prices {
    int32_t skip_a, skip_b; // a frame left out at an end
    int32_t step;           // a frame of one movement that the other does not advance for
};

struct alignment_pair {
    int32_t a, b;
};

struct alignment {
    int64_t price;
    struct alignment_pair *pairs; // malloc'ed, rising in a and b
    int32_t count;                // at least 1
    bool exact;                   // false: too long for the exact search, see below
    int64_t cells;                // how many costs were computed
};
void alignment_free(struct alignment *alignment); // zeroed is fine; leaves it zeroed

int32_t feature_cost(const struct feature_frame *a, const struct feature_frame *b);

// The plain way: all frames of A against all of B. For tests and for measuring. ERR_INPUT: a movement without frames.
// ERR_MEMORY. On failure *out is zeroed.
MUST_CHECK enum status align_plain(const struct features *a, const struct features *b,
                                   const struct alignment_prices *prices, struct alignment *out);

// The same price, several times faster. An upper bound comes from an alignment in a corridor; blocks of frames, from
// coarse to fine, are left out where lower bounds prove that every path through them costs more (alignment.c).
// Movements whose product is above 2^27 frames are aligned in a corridor about the alignment of every second frame
// (Salvador & Chan 2007, FastDTW), which is not always the optimum; `exact` says so. Errors as align_plain.
MUST_CHECK enum status align(const struct features *a, const struct features *b, const struct alignment_prices *prices,
                             struct alignment *out);

// FastDTW alone: the path within `radius` frames of the path of every second frame, recursively.
MUST_CHECK enum status align_corridor(const struct features *a, const struct features *b,
                                      const struct alignment_prices *prices, int32_t radius, struct alignment *out);
