// The pixels of a tablet camera's picture that something may fall on.
#pragma once
#include "platform/gpu.h"
#include "base/lens.h"

// low, high: between which all of it lies, x and y where z is 1, camera axes; infinite: some of it is beside the
// camera. With some pixels about it, for a smooth outline. Width 0: all of the picture.
struct gpu_box screen_bounds(const struct lens *lens, const double low[2], const double high[2]);
