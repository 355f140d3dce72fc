// Depth samples inside a tag, and the noise of a depth sensor. Pure.
#pragma once
#include "base/depth_noise.h"
#include "locate/tag_corners.h"

enum { TAG_DEPTH_SAMPLES = 36 };

// A depth sample inside a tag: its ray and its depth along z, metres.
struct depth_sample {
    double x, y, z; // the point is z * (x, y, 1), camera axes
};

struct tag_depth {
    int32_t count;
    double share; // weight of a sample against an independent one: far away, a whole tag falls on two or three of the
                  // sensor's quantisation steps
    struct depth_sample sample[TAG_DEPTH_SAMPLES];
};

// Samples up to TAG_DEPTH_SAMPLES pixels evenly spread inside the tag; pixels without depth and outliers of the tag's
// plane are left out. depth: millimetres, of the same pixels as `lens`. out->count is 0 where fewer than 6 are left.
void tag_read_depth(const struct tag_observation *seen, const struct lens *lens, const uint16_t *depth,
                    struct tag_depth *out);
