// How right the picture of a recorded take is, drawn from all round: beside the small world's truth. Errors abort.
#pragma once
#include "platform/screen/gpu.h"
#include "tests/world/world.h"

struct drawn_film {
    const char *take;
    double seconds, rate_hz; // of the film
};

struct drawn_score {
    double outline; // mean intersection over union of the person's
    double psnr_db; // over the union
};

// Draws twelve frames of the take, each from another side, 2.6 m from the person and 1.3 m high. The take was filmed by
// the world's sensor on its stand, level, from the motion's start, and has no place.
struct drawn_score draw_film(const struct world *world, const char *path, const struct drawn_film *film,
                             struct gpu *gpu);
