// Which located camera images to show. An image whose pose took unusually long to find is skipped when a newer one
// already waits: that one is tracked from it within milliseconds, so the screen shows the more recent of the two.
// Pure.
#pragma once
#include "base/status.h"

struct frame_skip {
    double typical_ms; // exponential mean of the locating time; 0 before the first image
    bool skipped_last; // the previous image was skipped
};

// Counts one more located image. placed: its pose was found. newer: another image waits already.
// True: skip this one in favour of the newer. Never two in a row.
bool frame_skip_update(struct frame_skip *s, double took_ms, bool placed, bool newer);
