// How the actor stands in the picture, from the mask: cut off at an edge, too near, too far. Pure.
#pragma once
#include "base/lens.h"
#include "recording/skeleton.h"

struct framing {
    bool feet_outside, head_outside, side_outside, too_near, too_far;
    double distance_m; // of the trunk, level; 0: unknown
};

struct framing_view {
    const struct calibration *calibration;
    const uint8_t *mask;             // of the depth image
    const struct skeleton *skeleton; // colour camera's axes
};
struct framing framing_of(const struct framing_view *view);
