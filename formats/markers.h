// The joints of a take as the programs of biomechanics read them, points at a constant rate:
//
// - TRC (OpenSim's track row column): tab-separated text, metres, y up; a point that is not known is an empty cell.
// - C3D (c3d.org's user guide): binary, little-endian ("Intel"), numbers in 32 bits, millimetres, y up; a point that is
//   not known has the residual -1. More frames than 65,535 stand in TRIAL:ACTUAL_END_FIELD, as newer readers expect.
#pragma once
#include "recording/skeleton.h"

#include <stdio.h>

struct markers {
    double rate_hz;
    int64_t count;
    float (*at)[JOINT_COUNT][3]; // [count], malloc'ed: metres, y up; NaN: not known
};
void markers_free(struct markers *markers); // zeroed is fine; leaves it zeroed

// One skeleton with its time, y up.
struct marker_sample {
    int64_t time_ns;
    struct skeleton skeleton;
};

// Interpolates `count` samples to the constant rate that is nearest to theirs. A joint is known where it
// has a confidence above 0 in both samples beside an instant, and these are at most MARKERS_GAP_S apart; a clock that
// jumps by more than a minute, stands or goes back goes on after one step. ERR_INPUT: there is none, or more than
// MARKERS_MAX frames come of it. ERR_MEMORY. On failure *out is zeroed.
#define MARKERS_GAP_S 0.25
enum { MARKERS_MAX = 1 << 22 };
MUST_CHECK enum status markers_make(struct markers *out, const struct marker_sample *samples, int64_t count);

// name: the file's, in the first line; of a path the last part. Errors are found in ferror(out).
void trc_print(const struct markers *markers, const char *name, FILE *out);
void c3d_print(const struct markers *markers, FILE *out);
