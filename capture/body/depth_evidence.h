// One depth picture's evidence about a body: the person's points, thinned out,
// and for every place of the picture the way to the nearest pixel of the
// person. Depth camera's axes, metres. One handle, one thread.
#pragma once
#include "capture/segmentation/segment.h"

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
    struct cell_area area;   // where `nearest` is known: the person and some way around them
    int16_t (*nearest)[2];   // per cell: cells to the nearest inside one, x and y
    const uint16_t *depth;   // the picture itself, borrowed
    const uint8_t *mask;
    struct evidence_point point[EVIDENCE_POINTS_MAX];
    int count;
    int pixels;                   // of the mask
    double extent_m2;             // of what it shows, across the view
    int left, top, right, bottom; // of the mask, pixels, inclusive
    struct vec3 low, high;        // bounds of the points
    struct image_bounds bounds;
};

// Copies the lens. ERR_MEMORY.
MUST_CHECK enum status evidence_open(struct depth_evidence **out, const struct lens *lens);
void evidence_close(struct depth_evidence **e); // NULL is fine

// Reads one frame; `depth` and `mask` are borrowed until the next call. At most
// `wanted` points are taken, evenly over the person. False: too few to say anything.
bool evidence_read(struct depth_evidence *e, const uint16_t *depth, const uint8_t *mask, int wanted);

enum evidence_kind { EVIDENCE_OUTSIDE, EVIDENCE_PERSON, EVIDENCE_OFF_PERSON, EVIDENCE_OCCLUDED };

// What the picture says of a place whose surface would be seen at depth z:
// OUTSIDE the picture; on the PERSON (*depth_m is what was measured there, 0
// where the very pixel has no reading); BESIDE the person, *dx, *dy are the
// pixels to it; HIDDEN behind something nearer that is not the person.
enum evidence_kind evidence_at(const struct depth_evidence *e, struct pixel px, double z, double *depth_m, double *dx,
                               double *dy);

// Of EVIDENCE_PROBES pixels about c, so many show the person's surface where it is `radius` metres before c; *outside:
// none of them is in the picture.
enum { EVIDENCE_PROBES = 5 };
int evidence_visible_count(const struct depth_evidence *e, struct vec3 c, double radius, bool *outside);
