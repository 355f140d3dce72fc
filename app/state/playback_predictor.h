// Which instants of a take the pictures to come will show, so that what they need can be
// made ready: as far from each other as the pictures before. Pure; nanoseconds.
#pragma once
#include "base/status.h"

enum { FORESEEN_MOST = 3 };

// Zeroed before the first picture.
struct foresight {
    int64_t at_ns, step_ns; // of the take: of the last picture, and from the one before that to it; 0: it jumped
    int64_t clock_ns;       // when that was drawn
    int missed;             // pictures one after the other for which nothing was ready
};

struct foresight_now {
    int64_t at_ns, length_ns, each_ns; // of the take: what is shown, how long it is, from recorded frame to frame
    bool playing, loop;
    int64_t clock_ns; // when it is drawn
    int64_t takes_ns; // to make one picture's frame ready; 0: not known
};

// The instants to be made ready for, the first one first. 0: nothing is to come, or what comes cannot be foreseen.
int foresee(struct foresight *f, const struct foresight_now *now, int64_t at_ns[FORESEEN_MOST]);

// A picture's frame was needed, and was it there?
void foresight_met(struct foresight *f, bool ready);
