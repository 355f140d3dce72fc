// Repetitions in a movement, and which of them resemble a given one.
//
// A repetition model is one cycle, a template of T frames. A movement is explained by it frame by frame: either idle,
// at a fixed price, or at some place of the cycle, which goes on by 0 to 2 places a frame and starts again after its
// end; the cheapest explanation is found by dynamic programming (the one-pass algorithm for connected words, Ney 1984,
// with one word). A cycle that is not gone through to its end is none, so getting into position is not counted.
//
// Where no cycle is given, it is searched in the movement: for the lags at which the movement resembles itself most
// (as YIN does with a difference function, de Cheveigne & Kawahara 2002), pieces of that length from all places are
// tried, and halves of those lags, because one cycle alone is no such lag where the pace changes; the piece whose
// repetitions explain the rest of the movement at the least price is taken, a shorter one where it does as well. Parts
// that do not repeat themselves from cycle to cycle while others do (legs that a tracker loses) are left out, and so is
// what resembles the cycle far less than the other repetitions (walking off). Searched in 7.5 Hz, in the two
// minutes that move most. Pure.
#pragma once
#include "compare/alignment.h"
#include "compare/difference.h"
#include "compare/score.h"

struct repetition_span {
    int32_t first, end; // frames of the movement
};

struct repetition_list {
    struct repetition_span *spans; // malloc'ed, in order, not overlapping
    int32_t count;
    struct repetition_span cycle; // the template, where it was searched
};
void repetition_list_free(struct repetition_list *list); // zeroed is fine; leaves it zeroed

// f at MOVEMENT_RATE_HZ. count 0: the movement does not repeat itself; one performance alone is not a repetition.
// ERR_MEMORY; *out is then zeroed.
MUST_CHECK enum status repetitions_find(const struct features *f, struct repetition_list *out);

// ---------------------------------------------------------------- performances

// Which stretches of two movements are performances of the same: where either repeats something, each repetition of the
// attempt belongs to a repetition of the reference. Repetitions are those of a movement that together hold nearly all
// of what it moves; of a movement that holds one performance alone, the other's repetitions are where that occurs.

struct performance {
    struct repetition_span attempt, reference; // frames of B and A
    double score;                              // of how it is held and moved alone
};

struct performances {
    struct performance *at;   // malloc'ed, in B's order
    int32_t count;            // B's repetitions; 0: neither movement repeats anything
    int32_t reference_count;  // A's that count; 1: one performance
    int32_t all_references;   // and with those that do not count
    struct pair_sums sums;    // of all
    double moved[PART_COUNT]; // how much A's repetitions move each part alike, rad; only where there are several
};
void performances_free(struct performances *performances); // zeroed is fine; leaves it zeroed

// A movement and its feature frames: those in which both are aligned, and at full size, in which repetitions are found.
struct performed {
    const struct movement *movement;
    struct features features; // of as many frames
    struct feature_frame *plain;
};

// of: A and B. within: NULL, or the frames of A that count: of A's repetitions only those that lie mostly in it are
// references, and of each what lies in it; of B's what shows that. Each of B's repetitions is judged against the one of
// A's (at most 12 are tried) that it resembles most; *timeline is theirs, NaN between them, and the caller's to free.
// Where neither repeats anything there are none, and no timeline. prices: of the alignment; by: what counts.
// ERR_MEMORY; *out and *timeline are then zeroed.
struct performance_terms {
    const struct alignment_prices *prices;
    const struct tolerances *by;
    const struct repetition_span *within;
};
MUST_CHECK enum status performances_judge(const struct performed of[2], const struct performance_terms *terms,
                                          struct timeline *timeline, struct performances *out);
