// What the depth sensor would see of the empty place from where it stands now,
// predicted from the views kept when the place was mapped. Pure.
#pragma once
#include "capture/recording/place.h"

// Fills depth[lens->width * lens->height], millimetres, 0 = not known. A pixel
// holds the nearest surface that the place's views saw there, as the mean of
// their readings.
// `lens` and `world_from_depth` are the depth camera's. ERR_MEMORY.
MUST_CHECK enum status background_depth_render(const struct place *place, const struct lens *lens,
                                               struct pose world_from_depth, uint16_t *depth);
