// The points that a picture sees, with a local plane each; steps of dense_depth_make.
#pragma once
#include "surround/depth/dense_depth.h"

struct seed {
    int u, v;
    float ray[3];   // unit, camera axes, to the point itself
    float inverse;  // 1 / distance
    float plane[3]; // 1 / distance along a unit ray r is plane . r
    float weight;   // square root of its points' weights, so that one sharp point does not silence all others
    bool hidden;
};

struct depth_seeds {
    struct seed *list;
    int count;
    int32_t *at;     // width * height: index of the pixel's seed, or -1: none, or a hidden one
    int32_t *before; // (width + 1) * (height + 1): seeds above and left (summed-area table)
    float up[3];     // world's up in camera axes
    bool sparse;     // depth_options
};

// The nearest point of each pixel, with the planes fitted and the hidden marked. ERR_MEMORY.
MUST_CHECK enum status depth_seeds_make(struct depth_seeds *s, const struct surround_picture *p,
                                        const struct world_points *points, const struct depth_options *how);
void depth_seeds_free(struct depth_seeds *s); // what was zeroed, too
