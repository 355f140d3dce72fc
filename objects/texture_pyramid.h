// Colour images at falling sizes, as floats. Pure but for memory; any thread may call.
#pragma once
#include "base/status.h"

struct texture_level {
    int width, height;
    float *rgb; // 0..255
};

// Levels of a pyramid: each half the size of the one before, means of 2 x 2. level[0].rgb is there; the caller frees
// all. ERR_MEMORY: those that could be made are there.
MUST_CHECK enum status texture_pyramid(struct texture_level *level, int levels);
