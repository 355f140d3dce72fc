// What a depth sensor reads of a tag, and how well it reads at all. Pure.
#pragma once
#include "base/depth_noise.h"
#include "locate/tag_corners.h"

enum { TAG_DEPTH_SAMPLES = 36 };

// Depth read inside a tag: the ray and the depth along z, metres.
struct depth_sample {
    double x, y, z; // the point is z * (x, y, 1), camera axes
};

struct tag_depth {
    int32_t count;
    double share; // what one reading is worth beside independent ones: far off, a whole
                  // tag falls on two or three of the sensor's steps
    struct depth_sample sample[TAG_DEPTH_SAMPLES];
};

// Reads up to TAG_DEPTH_SAMPLES pixels evenly spread inside the tag; zeros and
// pixels that jump out of the tag's plane are left out.
// depth: of the same pixels as `lens`.
void tag_read_depth(const struct tag_observation *seen, const struct lens *lens, const uint16_t *depth,
                    struct tag_depth *out);
