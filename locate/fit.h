// A camera's pose from tags whose place is known: all corners of all tags at
// once, each weighed by how well it was seen, depth where there is some. Every
// tag's two mirrored poses are tried as a start, tags that do not fit the rest
// are left out. Pure; no allocation.
#pragma once
#include "locate/refine.h"
#include "locate/square.h"

enum { FIT_MAX_TAGS = 64, TAG_DEPTH_SAMPLES = 36 };

// Depth read inside a tag: the ray and the depth along z, metres.
struct depth_sample {
    double x, y, z; // the point is z * (x, y, 1), camera axes
};

struct tag_depth {
    int32_t count;
    struct depth_sample sample[TAG_DEPTH_SAMPLES];
};

// Reads up to TAG_DEPTH_SAMPLES pixels evenly spread inside the tag; zeros and
// pixels that jump out of the tag's plane are left out.
// depth: of the same pixels as `lens`.
void tag_read_depth(const struct sighting *seen, const struct lens *lens, const uint16_t *depth, struct tag_depth *out);

// The sensor's noise at a distance: 1.5e-3 z^2 (Khoshelham and Elberink 2012), metres.
static inline double depth_sigma(double z) { return 1.5e-3 * z * z + 1e-3; }

struct fit_tag {
    const struct sighting *seen;
    const struct tag_depth *depth;  // or NULL
    struct pose world_from_tag;
    double side_m;
    bool used;     // out: in agreement with the pose
    double rms_px; // out: reprojection error of its corners
};

struct camera_fit {
    struct pose camera_from_world;
    double rms_px; // over the corners used
    double cost;   // robust, whitened; of the tags used
    int32_t used;
};

// fx, fy: what a pixel is. 0 <= count <= FIT_MAX_TAGS; the same tag may be there
// twice, one at most is used.
// OK, NOTHING (no pose fits within max_rms_px; *out untouched) or AMBIGUOUS
// (*out is the better of two poses that are apart but fit alike).
enum status fit_camera(struct fit_tag *tags, int count, double fx, double fy, double max_rms_px,
                       struct camera_fit *out);
