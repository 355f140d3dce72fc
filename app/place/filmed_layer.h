// What the room worker drew last, shown from where the viewpoint is now: the picture itself where they are the same,
// else bent over its own depth (reprojection), so that the viewpoint moves at the display's rate while new pictures
// come more slowly. The GPU's thread.
#pragma once
#include "app/place/room_worker.h"
#include "reenact/render/solid_renderer.h"

struct filmed_layer;
MUST_CHECK enum status filmed_layer_open(struct filmed_layer **out, struct gpu *gpu);
void filmed_layer_close(struct filmed_layer **f); // NULL is fine

// Draws the picture into a texture of the lens's size, premultiplied, transparent where nothing was filmed; valid until
// the next call. Costs nothing where nothing has changed. ERR_DEVICE, ERR_MEMORY.
MUST_CHECK enum status filmed_layer_draw(struct filmed_layer *f, struct solid_renderer *r,
                                         const struct room_picture *picture, const struct lens *lens,
                                         struct pose world_from_camera, const struct gpu_texture **out);
