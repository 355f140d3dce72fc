// A camera's picture as it lies in its memory, turned into RGB by the GPU: the same
// pixels, to the bit, as base/pixels.h makes of the same bytes. Threads and
// errors as in platform/gpu.h.
#pragma once
#include "platform/gpu.h"
#include "platform/dmabuf_image.h"

// The textures that a picture of that layout comes in.
struct yuv_plane {
    enum gpu_format format;
    int width, height; // texels
};
// Returns how many there are: 1 or 2.
int yuv_planes(enum dmabuf_layout layout, int width, int height, struct yuv_plane planes[2]);

struct yuv_to_rgb;
MUST_CHECK enum status yuv_to_rgb_open(struct yuv_to_rgb **out, struct gpu *gpu);
void yuv_to_rgb_close(struct yuv_to_rgb **r); // NULL is fine

// Draws `what` (its layout, size and meaning) from the textures of its planes, which are read with the next wait for
// the GPU at the latest.
MUST_CHECK enum status yuv_to_rgb_draw(struct yuv_to_rgb *r, const struct dmabuf_image *what,
                                       const struct gpu_texture *const planes[2]);

// The picture last drawn; until the next of another size, or the end.
const struct gpu_texture *yuv_to_rgb_texture(struct yuv_to_rgb *r);
MUST_CHECK enum status yuv_to_rgb_read(struct yuv_to_rgb *r, uint8_t *rgba); // width * height * 4
