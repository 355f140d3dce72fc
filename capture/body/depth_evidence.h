// One depth image's evidence about a body: the person's points, subsampled, and a distance transform that gives for
// every pixel the vector to the nearest pixel of the person (Danielsson 1980, on a grid). Depth camera's axes, metres.
// One handle, one thread.
#pragma once
#include "capture/segmentation/image_bounds.h"

struct evidence_point {
    struct vec3 p;
    double weight; // 1 / variance, 1/m^2: sensor noise and cloth
};

enum { EVIDENCE_POINTS_MAX = 1600 };

struct cell_area {
    int left, top, right, bottom; // cells, inclusive
};

struct depth_evidence {
    struct lens lens;
    int step, width, height; // of the grids: pixels a cell, cells
    uint8_t *inside;         // per cell: some pixel is the person
    struct cell_area area;   // where `nearest` is known: the person and a margin
    int16_t (*nearest)[2];   // per cell: cells to the nearest inside one, x and y
    const uint16_t *depth;   // the depth image and its mask, borrowed
    const uint8_t *mask;
    struct evidence_point point[EVIDENCE_POINTS_MAX];
    int count;
    int pixels;                   // of the mask
    double extent_m2;             // visible area of the person, perpendicular to the view
    int left, top, right, bottom; // of the mask, pixels, inclusive
    struct vec3 low, high;        // bounds of the points
    struct image_bounds bounds;
};

// Copies the lens. ERR_MEMORY: *out is NULL.
MUST_CHECK enum status evidence_open(struct depth_evidence **out, const struct lens *lens);
void evidence_close(struct depth_evidence **evidence); // NULL is fine

// Reads one frame; `depth` and `mask` are borrowed until the next call. At most `wanted` points are taken, evenly
// spread over the person. False: fewer than 40 pixels or 30 points, too few to fit; *evidence must not be used then.
bool evidence_read(struct depth_evidence *evidence, const uint16_t *depth, const uint8_t *mask, int wanted);

// The image's edges that crop the person: those within CROP_MARGIN pixels of the mask. A set of bits.
enum { CROP_LEFT = 1, CROP_RIGHT = 2, CROP_TOP = 4, CROP_BOTTOM = 8, CROP_MARGIN = 2 };
unsigned evidence_cropped_edges(const struct depth_evidence *evidence);

enum evidence_kind { EVIDENCE_OUTSIDE, EVIDENCE_PERSON, EVIDENCE_OFF_PERSON, EVIDENCE_OCCLUDED };

// What the image says of a point of the model that projects to `px` at depth z:
// OUTSIDE     not within the image's bounds
// PERSON      on the mask; *depth_m is the measured depth, 0 where that pixel has none
// OFF_PERSON  beside the mask; *dx, *dy are the pixels to it
// OCCLUDED    behind something nearer that is not the person
enum evidence_kind evidence_at(const struct depth_evidence *e, struct pixel px, double z, double *depth_m, double *dx,
                               double *dy);

// How many of EVIDENCE_PROBES pixels about c show the person's surface, which is expected `radius` metres in front of
// c; *outside: none of them is in the image.
enum { EVIDENCE_PROBES = 5 };
int evidence_visible_count(const struct depth_evidence *evidence, struct vec3 c, double radius, bool *outside);
