// Dynamic resolution: keeps the display's frame rate by the share of the pixels at which the actor is drawn. The
// resolution falls quickly, rises slowly and does not oscillate. Where a lower resolution saves no time, the full one
// is kept, and frames are late. Pure.
#pragma once
#include "base/status.h"

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
bool governor_update(struct resolution_governor *g, double took_ms);

// The resolution scale: share of the pixels along each axis, 1 down to 0.4.
double governor_scale(const struct resolution_governor *g);
