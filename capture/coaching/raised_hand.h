// The gesture by which one person films alone: one hand held still above the head, the other one down, standing upright
// and facing the sensor. Pure.
#pragma once
#include "recording/skeleton.h"

struct raised_hand {
    int64_t since_ns; // when the hand went up; 0: it is down
    int64_t up_ns;    // when it was last seen up
    bool given;       // this raising was already reported
    bool any;
    int64_t last_ns;
    struct vec3 last_hand[2], last_trunk;
};

// How long the hand is held up until the gesture counts, seconds. Chosen by hand: a gesture is found within 0.5 s, and
// a hand that passes above the head in a movement does not count.
#define RAISED_HAND_S 0.35

// One frame; skeleton NULL: no person. True: once for each raising, when it has been held long enough.
bool raised_hand_next(struct raised_hand *hand, int64_t time_ns, const struct skeleton *skeleton);
