// Holds the display's rate: how finely the actor is drawn, by how long drawing
// took. Falls quickly, rises slowly, and does not swing; where drawing coarsely
// saves no time, it draws finely and late. Pure.
#pragma once
#include "base/status.h"

struct resolution_governor {
    double budget_ms;    // what drawing may take
    double typical_ms;   // what it takes now, smoothed
    int level;           // 0: every pixel; up to GOVERNOR_LEVELS - 1
    int headroom_frames; // pictures in a row that left room for the finer level
    int warmup_left;     // pictures to come that still tell of the level before
    int headroom_needed; // how many calm pictures it takes; grows when a rise proved too bold
    bool rose;           // the last change was a rise
    double before_ms;    // typical before the last fall
    int since_fall;      // pictures that tell of it; -1: it was judged
    int backoff_left;    // pictures to come for which falling is no use
};
enum { GOVERNOR_LEVELS = 5 };

struct resolution_governor governor_start(double budget_ms);

// One more picture took that long. True: the level is another from now on.
bool governor_update(struct resolution_governor *g, double took_ms);

// The share of the picture's pixels in each direction that is drawn at: 1 down to 0.4.
double governor_scale(const struct resolution_governor *g);
