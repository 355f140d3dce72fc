// Predicts which instants of a take the next frames will show, so that their data can be loaded beforehand: as far
// apart as the last frames were. Pure; nanoseconds.
#pragma once
#include "base/status.h"

enum { PREDICTED_MAX = 3 };

// Zeroed before the first frame.
struct playback_predictor {
    int64_t at_ns;    // the take's instant in the last frame
    int64_t step_ns;  // from the frame before to the last one, in the take's time; 0: it jumped
    int64_t clock_ns; // when the last frame was drawn
    int missed;       // consecutive frames for which nothing was ready
};

struct playback_now {
    int64_t at_ns;     // the take's instant that is shown
    int64_t length_ns; // of the take
    int64_t frame_ns;  // from one recorded frame to the next
    bool playing, loop;
    int64_t clock_ns; // when it is drawn
    int64_t load_ns;  // duration of loading one frame's data; 0: not known
};

// The instants to load for, the nearest first. Returns how many; 0: paused, or predictions keep failing.
int playback_predict(struct playback_predictor *p, const struct playback_now *now, int64_t at_ns[PREDICTED_MAX]);

// Reports whether the data of a drawn frame was ready.
void playback_predictor_report(struct playback_predictor *p, bool ready);
