// The depth image that the sensor would record of the empty place from where it stands now, rendered from the keyframe
// views of the place's map. Pure.
//
// Method: every view's depth pixels are splatted into the image; each pixel keeps the nearest surface, as the mean of
// its samples (a z-buffer that averages within the noise).
#pragma once
#include "recording/place.h"

// Fills depth[lens->width * lens->height], millimetres, 0 = unknown. `lens` and `world_from_depth` are the depth
// camera's. ERR_MEMORY: depth is all 0.
MUST_CHECK enum status background_depth_render(const struct place *place, const struct lens *lens,
                                               struct pose world_from_depth, uint16_t *depth);
