// Dark circles of a printed board in a grey image: their centres to a few hundredths of a pixel and their places in the
// board's lattice. The board may be cut off by the image's edge; a circle that touches the edge is left out.
//
// Method: pixels darker than their surroundings (box mean of an integral image), connected components, ellipses by
// second moments, centroids weighted by darkness; the lattice grows from a circle with four regular neighbours. Pure;
// any thread may call.
#pragma once
#include "base/lens.h"

struct circle {
    struct pixel at; // centroid of the image of the disc, pixels; not the image of its centre
    double area_px;  // pixels^2
    int column, row; // lattice: (row's axis) lies clockwise of (column's axis) in the image; the origin is arbitrary
};

enum { STEREO_MOST_CIRCLES = 1024 };

// gray: width * height bytes. Writes the largest lattice found, at most STEREO_MOST_CIRCLES circles, lattice
// coordinates from 0 on; *count is their number, 0 for none. ERR_MEMORY.
MUST_CHECK enum status stereo_circles_find(const uint8_t *gray, int width, int height, struct circle *out, int *count);
