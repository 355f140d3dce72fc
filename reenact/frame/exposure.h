// Estimates a frame's exposure gain against the avatar's mean colours: lamps are nearer or farther, and the camera's
// automatic exposure varies. It is measured where the frame saw the actor; what it did not see is drawn from the
// avatar's colours multiplied by it. Method: a one-parameter weighted least-squares fit, iterated, with Geman-McClure
// weights against outliers and a prior at gain 1. Pure; deterministic.
#pragma once
#include "reenact/frame/frame_layer.h"

struct exposure_input {
    const struct avatar *avatar;
    const struct depth_frame *depth_frame;
    const struct lens *color; // the frame's
    const uint8_t *rgb;       // the frame's colours, gamma-encoded
};

// f: its points' positions, visibility and irradiance, the last before any gain. Returns the gain of gamma-encoded
// colours (square roots of linear ones), in [1/1.4, 1.4]; near 1 where too little is seen.
float exposure_estimate(const struct exposure_input *in, const struct frame_layer *f);
