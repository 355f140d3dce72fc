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

struct repetition_span {
    int32_t first, end; // frames of the movement
};

struct repetition_list {
    struct repetition_span *spans; // malloc'ed, in order, not overlapping
    int32_t count;
    struct repetition_span cycle; // the template, where it was searched
};
void repetition_list_free(struct repetition_list *l); // zeroed is fine; leaves it zeroed

// f at MOVEMENT_RATE_HZ. count 0: the movement does not repeat itself; one performance alone is not a repetition.
// ERR_MEMORY; *out is then zeroed.
MUST_CHECK enum status repetitions_find(const struct features *f, struct repetition_list *out);

// Where `cycle` occurs in f, once or several times.
MUST_CHECK enum status repetitions_of(const struct features *cycle, const struct features *f,
                                      struct repetition_list *out);
