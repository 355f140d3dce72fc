// The coach beside a recorder: fed on the recorder's processing thread, read on the caller's.
#pragma once
#include "capture/coaching/coach.h"
#include "capture/recorder.h"

#include <pthread.h>

struct coaching_line {
    pthread_mutex_t lock;
    struct coach coach; // of the processing thread until recorder_run returns
    char text[96];      // guarded by lock
};

void coaching_line_start(struct coaching_line *l, const struct calibration *calibration, enum verdict_purpose purpose);
void coaching_line_end(struct coaching_line *l);

// For recorder_options.on_seen; context: the line.
void coaching_line_see(struct coaching_line *l, const struct recorder_seen *seen);

// "41 % of the body seen · turn left", for a status line.
void coaching_line_text(struct coaching_line *l, char *out, size_t capacity);
