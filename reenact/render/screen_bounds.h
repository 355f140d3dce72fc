// Bounding box in pixels of what lies within a frustum, lens distortion included. Pure.
#pragma once
#include "platform/screen/gpu.h"
#include "base/lens.h"

// low, high: bounds of x / z and y / z, camera axes; infinite: unbounded on that side. The box has a margin of 2 pixels
// for smooth silhouettes. Width 0: the whole image.
struct gpu_box screen_bounds(const struct lens *lens, const double low[2], const double high[2]);
