// What a person should do next so that more of the body is seen: turn, lift the arms, spread the legs, or nothing.
// Pure.
//
// A side that the sensor has not faced yet is asked for by a turn. One that it has faced and yet not seen is hidden by
// the body itself, so that a further turn would not show it: then a pose is asked for, and when that was held before
// the same side, or was not taken for some seconds, no more. What is less than the picture shows is not asked for at
// all.
#pragma once
#include "capture/coaching/coverage.h"

enum pose_advice {
    ADVICE_ENOUGH,
    ADVICE_TURN_LEFT, // of the person
    ADVICE_TURN_RIGHT,
    ADVICE_LIFT_ARMS,
    ADVICE_SPREAD_LEGS,
    ADVICE_SHOW_SOLES, // where the take shows them: who kneels, lies or kicks
};

struct advisor {
    uint32_t lifted[SURFACE_ANGLES],
        spread[SURFACE_ANGLES]; // as coverage.facing, with the arms lifted, the legs spread
    enum pose_advice last;
    int64_t asked_ns; // since when, for a pose
    bool lift_refused, spread_refused, soles_refused;
    int soles[2]; // how often the left, the right shin lay so that its sole faced the side
};

// After each coverage_add. The answer's reason is in c: cells unseen.
enum pose_advice advisor_next(struct advisor *a, const struct coverage *c, const struct skeleton *s, int64_t time_ns);

// Share of the surface that a turn would still show.
double advisor_turn_share(const struct coverage *c);
