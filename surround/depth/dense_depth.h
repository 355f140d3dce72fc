// Dense depth of a picture from sparse world points (paper 003, section III-B, a-2): the points that the picture sees
// are projected into it, each gets a local plane, a watershed segmentation of the image (Meyer 1991) with the points as
// seeds gives every pixel one of them, and the pixel's depth is that plane's. The sky is set apart first. What no point
// reaches is continued along its column from the surface below, where that stands upright: walls are taller than a
// scanner sees.
//
// Pure but for memory; any thread, one picture each.
#pragma once
#include "surround/picture/surround_picture.h"

struct depth_options {
    bool sky;                     // outdoors: look for the sky
    bool upright;                 // continue what stands upright above the last point
    bool walls;                   // indoors: large upright planes are flat (dense_depth.c)
    bool sparse;                  // points of scanners' lines, with gaps between them that others show through
    int reach;                    // most pixels from a point that its segment grows, of a panorama 1024 high; 24
    double tolerance;             // of a point against a local plane, share of its distance; 0.012
    double nearest_m, farthest_m; // points outside are left out
};
struct depth_options depth_default_options(void);

// Points of the world; up is z.
struct world_points {
    const float (*xyz)[3];
    const float *weight; // of each, 1 / sigma^2; NULL: all alike
    int count;
    const uint8_t (*rgb)[4]; // depth_seeds.h; NULL: not known
};

// Makes picture->inverse and joined. The picture must be placed. ERR_MEMORY: they are as before.
MUST_CHECK enum status dense_depth_make(struct surround_picture *picture, const struct world_points *points,
                                        const struct depth_options *options);
