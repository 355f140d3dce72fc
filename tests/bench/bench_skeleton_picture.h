// What a skeleton's error looks like: the estimate in colours and the truth in white over the depth image, cut out
// about the person.
#pragma once
#include "base/lens.h"
#include "recording/skeleton.h"
#include "tests/bench/bench.h"

struct skeleton_instant {
    const struct calibration *calibration;
    const uint16_t *depth;                   // mm
    const struct skeleton *truth, *estimate; // colour camera's axes
};

void bench_skeleton_picture(struct bench *b, const char *caption, const struct skeleton_instant *of);
