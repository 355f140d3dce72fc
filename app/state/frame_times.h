// How long each stage of the last frames took, for the frame graph on the screen and for --stats. Milliseconds. Pure.
#pragma once
#include "base/status.h"

enum frame_stage {
    FRAME_LOCATE,   // finding the camera's pose
    FRAME_WAIT,     // between threads, until the thread before is done
    FRAME_ACTOR,    // drawing the actor
    FRAME_CONTROLS, // drawing the controls
    FRAME_SHOW,     // handing the frame to the display
    FRAME_STAGES
};
extern const char *const frame_stage_names[FRAME_STAGES];

enum { FRAMES_KEPT = 120 };

struct frame_times {
    float ms[FRAMES_KEPT][FRAME_STAGES]; // a ring buffer of the last frames
    int next, count;
    // Over all frames since the start:
    int64_t frames;
    double sum_ms[FRAME_STAGES];
    double total_worst_ms; // the longest sum of one frame's stages
};

void frame_times_add(struct frame_times *t, const double ms[FRAME_STAGES]);
// The stages of the frame `back` frames ago, 0 the last; NULL: not kept.
const float *frame_times_at(const struct frame_times *t, int back);
double frame_times_median(const struct frame_times *t); // of the kept frames' totals; 0 for none
