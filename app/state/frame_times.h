// How long the stages of the last pictures took, for the strip on the screen and
// for --stats. Milliseconds. Pure.
#pragma once
#include "base/status.h"

enum frame_stage {
    FRAME_LOCATE,   // saying where the camera was
    FRAME_WAIT,     // between threads, for the one before to be done
    FRAME_ACTOR,    // drawing the actor
    FRAME_CONTROLS, // drawing the screen around him
    FRAME_SHOW,     // handing it to the display
    FRAME_STAGES
};
extern const char *const frame_stage_names[FRAME_STAGES];

enum { FRAMES_KEPT = 120 };

struct frame_times {
    float ms[FRAMES_KEPT][FRAME_STAGES]; // a ring
    int next, count;
    // Of all pictures since the beginning.
    int64_t frames;
    double sum_ms[FRAME_STAGES];
    double total_worst_ms;
};

void frame_times_add(struct frame_times *t, const double ms[FRAME_STAGES]);
// The one `back` pictures ago, 0 the last; NULL: not kept.
const float *frame_times_at(const struct frame_times *t, int back);
double frame_times_median(const struct frame_times *t); // of the sums of the kept ones; 0 for none
