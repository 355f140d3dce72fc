// How long each stage of the last frames took, for the frame graph on the screen and for --stats. Milliseconds. Pure.
#pragma once
#include "base/status.h"

// ---------------------------------------------------------------- frame skip

// Which located camera images to show. An image whose pose took unusually long to find is skipped when a newer one
// already waits: that one is tracked from it within milliseconds, so the screen shows the more recent of the two.
// Pure.

struct frame_skip {
    double typical_ms; // exponential mean of the locating time; 0 before the first image
    bool skipped_last; // the previous image was skipped
};

// Counts one more located image. placed: its pose was found. newer: another image waits already.
// True: skip this one in favour of the newer. Never two in a row.
bool frame_skip_update(struct frame_skip *skip, double took_ms, bool placed, bool newer);

// ---------------------------------------------------------------- frame times

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

void frame_times_add(struct frame_times *times, const double ms[FRAME_STAGES]);
// The stages of the frame `back` frames ago, 0 the last; NULL: not kept.
const float *frame_times_at(const struct frame_times *times, int back);
double frame_times_median(const struct frame_times *times); // of the kept frames' totals; 0 for none

// ---------------------------------------------------------------- resolution governor

// Dynamic resolution: keeps the display's frame rate by the share of the pixels at which the actor is drawn. The
// resolution falls quickly, rises slowly and does not oscillate. Where a lower resolution saves no time, the full one
// is kept, and frames are late. Pure.

struct resolution_governor {
    double budget_ms;    // what drawing may take
    double typical_ms;   // what it takes now, exponential mean
    int level;           // 0: every pixel; up to GOVERNOR_LEVELS - 1
    int headroom_frames; // consecutive frames with enough headroom for the finer level
    int warmup_left;     // frames to come that still measure the level before
    int headroom_needed; // how many headroom_frames a rise takes; doubles when a rise had to be taken back
    bool rose;           // the last change was a rise
    double before_ms;    // typical_ms before the last fall
    int since_fall;      // frames since then; -1: its gain has been evaluated
    int backoff_left;    // frames to come in which the level does not fall, because a fall gained nothing
};
enum { GOVERNOR_LEVELS = 5 };

struct resolution_governor governor_start(double budget_ms);

// Counts one more frame, drawn in that time. True: the level has changed.
bool governor_update(struct resolution_governor *governor, double took_ms);

// The resolution scale: share of the pixels along each axis, 1 down to 0.4.
double governor_scale(const struct resolution_governor *governor);
