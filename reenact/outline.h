// How the fused shape's outline meets the outlines that frames show. A shape gathered from many postures, none of them
// quite right, comes out too thin, thin limbs most of all, and no single reading contradicts; outlines do. Pure.
#pragma once
#include "reenact/volume.h"

// How far lines of sight along the person's outline pass by the shape (+, metres: it is too thin) or cut into it (-).
struct outline_gaps {
    double sum[BONE_COUNT];
    int count[BONE_COUNT];
};

// Adds what one frame says, the person being in `posture`.
void outline_measure(const struct volume *v, const struct calibration *calibration, const struct sight *sight,
                     const struct posture *posture, struct outline_gaps *gaps);

// Moves each bone's surface out (or in) by its mean gap.
void outline_meet(struct volume *v, const struct outline_gaps *gaps);
