// Points of a depth picture in its body's axes, each with its standard deviation. What lies on a jump of depth is left
// out: there a sample may hang between the near and the far surface (flying pixels). Pure but for memory.
#pragma once
#include "base/lens.h"

struct depth_points {
    float (*xyz)[3]; // metres
    float *sigma;    // metres
    int count, room;
};

// Appends the points of a depth picture (millimetres, 0 = no reading), every `step`-th row and column. ERR_MEMORY: as
// before.
MUST_CHECK enum status depth_points_add(struct depth_points *points, const uint16_t *depth, const struct lens *lens,
                                        struct pose body_from_camera, int step);
void depth_points_free(struct depth_points *points); // what was zeroed, too
