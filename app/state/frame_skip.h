// Which of the located pictures are worth showing: one whose place took unusually long to
// find was overtaken by what came meanwhile, and that is followed from it in no time. Pure.
#pragma once
#include "base/status.h"

struct frame_skip {
    double typical_ms; // of locating, smoothed; 0 before the first
    bool skipped_last; // the picture before was
};

// One more picture was located (placed: its place was found) in that time; newer: another waits already.
// True: it is to be passed over for that one. Never two in a row.
bool frame_skip_update(struct frame_skip *p, double took_ms, bool placed, bool newer);
