// How far a sensor without a place was tilted or rolled from level: by the floor in its depth images. Who compares
// takes the person's standing for it (compare/joint_samples.h), and without that, takes the sensor as held level.
#pragma once
#include "recording/recorded_verdict.h"

struct sensor_tilt {
    bool matters; // it has no place, and nobody stands upright for a second in sight of a sensor that is nearly level
    bool known;   // a floor is seen
    double degrees;
};

// Reads at most five depth images. ERR_IO, ERR_MEMORY.
MUST_CHECK enum status sensor_tilt_find(struct take *take, struct sensor_tilt *out);
void sensor_tilt_say(const struct sensor_tilt *t, struct take_verdict *out);
