// The tablet as a head tracker: how it moves and turns in its own place, the eye moves and turns about the robot. Where
// the tablet is when it is centred, and which way it looks then, is the viewpoint's place, looking ahead; up stays up.
// Pure.
#pragma once
#include "base/geometry.h"

struct head_tracker {
    bool centred;
    struct vec3 origin; // the tablet's, in its place
    double c, s;        // cosine and sine of the way it looked
};

// place_from_camera: axes x right, y down, z ahead; the place's z is up. viewpoint: where the eye is in the body's axes
// (x ahead, y left, z up) with the tablet at its origin. The first call, and the first after `centred` is cleared,
// centres. Returns body_from_eye, the eye's axes as the camera's.
struct pose head_tracker_eye(struct head_tracker *t, struct pose place_from_camera, struct vec3 viewpoint);
