// What a user would take instead of view-dependent geometry and texture on a graphics card: every known pixel of every
// picture as a coloured point, uploaded once, drawn 2 x 2 pixels large, the nearest winning.
#pragma once
#include "platform/screen/gpu.h"
#include "surround/view/surround_view.h"

struct point_splats;
// ERR_MEMORY, ERR_DEVICE.
MUST_CHECK enum status point_splats_open(struct point_splats **out, struct gpu *gpu,
                                         const struct surround_picture *pictures, int count);
void point_splats_close(struct point_splats **s); // NULL is fine

MUST_CHECK enum status point_splats_draw(struct point_splats *s, const struct lens *lens, struct pose world_from_view);
// Fills rgb, source and inverse_z of a view of the last image's size; draws its depth for that.
MUST_CHECK enum status point_splats_read(struct point_splats *s, struct surround_view *view);
