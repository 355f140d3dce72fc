// The parts' measured shapes: for each part how far its surface stands off the
// bone, all round and all along, gathered from the depth of the whole take in
// the part's bodily axes. Where nothing was seen it is closed over smoothly
// between what was. Pure; deterministic.
#pragma once
#include "reenact/cylinders.h"
#include "reenact/part_label.h"

enum { SHAPE_AROUND = 32, SHAPE_ALONG = 56 };

// radius[i][k]: in units of the part's cylinder radius (radius_rate * length), at
// ring i's height and at angle 2 pi k / SHAPE_AROUND from the x axis towards y.
struct part_shape {
    bool known;      // enough was seen; else draw the cylinder
    int first, last; // rings that are there
    float radius[SHAPE_ALONG][SHAPE_AROUND];
};

struct shape {
    struct part_shape parts[PART_COUNT];
};

// Height of ring i on the bone: 0 its first joint, 1 its second; reaching beyond both.
double shape_height(int ring);

// Reads at most `max_frames` frames of the take, spread evenly. rays as
// source_rays_open made them for this take. ERR_CORRUPT, ERR_IO, ERR_MEMORY.
MUST_CHECK enum status shape_measure(struct shape *out, struct take *take, const struct source_rays *rays,
                                     int max_frames);

// How far the shape must be moved across the bone, in the part's axes, to lie on
// the measured points (x, y, z each; the axes that `bodily` is in). Joints are a
// few centimetres wrong; the surface is not. A side of which nothing was measured
// keeps the joints' word. radius: of the part's cylinder, metres.
// free_end: nothing follows on the second joint (the head); then also along the bone.
struct vec3 shape_shift(const struct part_shape *shape, const struct part_frame *bodily, double radius, bool free_end,
                        const float *points, int count);

// Its mesh, closed at both ends; cylinder_mesh_free. ERR_MEMORY.
MUST_CHECK enum status shape_mesh(const struct part_shape *shape, struct cylinder_mesh *out);
