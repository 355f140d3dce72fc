// Which instants of a take the pictures to come will show, so that what they need can be
// made ready: as far from each other as the pictures before. Pure; nanoseconds.
#pragma once
#include "base/status.h"

enum { PREDICTED_MAX = 3 };

// Zeroed before the first picture.
struct playback_predictor {
    int64_t at_ns, step_ns; // of the take: of the last picture, and from the one before that to it; 0: it jumped
    int64_t clock_ns;       // when that was drawn
    int missed;             // pictures one after the other for which nothing was ready
};

struct playback_now {
    int64_t at_ns, length_ns, frame_ns; // of the take: what is shown, how long it is, from recorded frame to frame
    bool playing, loop;
    int64_t clock_ns; // when it is drawn
    int64_t load_ns;  // to make one picture's frame ready; 0: not known
};

// The instants to be made ready for, the first one first. 0: nothing is to come, or what comes cannot be foreseen.
int playback_predict(struct playback_predictor *f, const struct playback_now *now, int64_t at_ns[PREDICTED_MAX]);

// A picture's frame was needed, and was it there?
void playback_predictor_report(struct playback_predictor *f, bool ready);
