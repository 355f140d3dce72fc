// Which rows and columns of a depth image carry depth samples. Pure.
//
// A depth image registered to colour has an empty rim. A person who is cut off there is cropped as by the edge of the
// image itself.
#pragma once
#include "base/lens.h"

// Pixels, inclusive.
struct image_bounds {
    int left, top, right, bottom;
};

// The image without its empty rim, at most a quarter on each side. The whole image where more than half of it has no
// depth.
struct image_bounds find_image_bounds(const uint16_t *depth, const struct lens *lens);
