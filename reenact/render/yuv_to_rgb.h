// A camera's picture as it lies in its memory, turned into RGB by the GPU: the same
// pixels, to the bit, as base/pixels.h makes of the same bytes. Threads and
// errors as in platform/gpu.h.
#pragma once
#include "platform/gpu.h"
#include "platform/dmabuf_image.h"

// The textures that a picture of that layout comes in.
struct raw_plane {
    enum gpu_format format;
    int width, height; // texels
};
// Returns how many there are: 1 or 2.
int raw_planes(enum loan_layout layout, int width, int height, struct raw_plane planes[2]);

struct raw_picture;
MUST_CHECK enum status raw_picture_open(struct raw_picture **out, struct gpu *gpu);
void raw_picture_close(struct raw_picture **r); // NULL is fine

// Draws `what` (its layout, size and meaning) from the textures of its planes, which are read with the next wait for
// the GPU at the latest.
MUST_CHECK enum status raw_picture_draw(struct raw_picture *r, const struct loan *what,
                                        const struct gpu_texture *const planes[2]);

// The picture last drawn; until the next of another size, or the end.
const struct gpu_texture *raw_picture_texture(struct raw_picture *r);
MUST_CHECK enum status raw_picture_read(struct raw_picture *r, uint8_t *rgba); // width * height * 4
