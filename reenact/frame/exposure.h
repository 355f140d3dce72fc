// How much brighter a frame has the person than the take's frames have in the mean: lamps are near or far, a camera
// exposes now longer, now shorter. The sides that the frame saw tell; those that it did not see, in colours gathered
// from all frames, are then drawn as bright. Pure; deterministic.
#pragma once
#include "reenact/frame/frame_layer.h"

struct exposure_input {
    const struct avatar *avatar;
    const struct depth_frame *depth_frame;
    const struct lens *color; // the frame's
    const uint8_t *rgb;       // likewise
};

// f: what the frame knows of the mesh's points, their light as it was for all frames. The ratio of the colours' roots,
// 1 where too little is seen to say, and never far from it.
float exposure_estimate(const struct exposure_input *in, const struct frame_layer *f);
