// The usual alternative: one recorded frame's depth image as a mesh, each pixel of the person with its own colour, seen
// from the viewer. No fusion with other frames.
#pragma once
#include "recording/recording.h"

// Draws frame `frame` of the take over rgb (of `lens`); alpha gets 255 where it drew, else 0. ERR_MEMORY, as take_read.
MUST_CHECK enum status views_mesh_draw(struct take *take, int64_t frame, const struct lens *lens,
                                       struct pose world_from_viewer, uint8_t *rgb, uint8_t *alpha);
