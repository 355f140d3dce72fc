// Converts a camera image from its own memory layout to RGB on the GPU, bit for bit as
// base/pixels.h does on the CPU. Threads and errors as in platform/screen/gpu.h.
#pragma once
#include "platform/screen/gpu.h"
#include "platform/sensors/source.h"

// One texture per plane of the layout.
struct yuv_plane {
    enum gpu_format format;
    int width, height; // texels
};
// Returns the number of planes: 1 or 2.
int yuv_planes(enum dmabuf_layout layout, int width, int height, struct yuv_plane planes[2]);

struct yuv_to_rgb;
MUST_CHECK enum status yuv_to_rgb_open(struct yuv_to_rgb **out, struct gpu *gpu);
void yuv_to_rgb_close(struct yuv_to_rgb **rgb); // NULL is fine

// Draws the image (its layout, size and encoding) from the textures of its planes, which the GPU has read once
// a gpu_fence opened after it has passed.
MUST_CHECK enum status yuv_to_rgb_draw(struct yuv_to_rgb *converter, const struct dmabuf_image *image,
                                       const struct gpu_texture *const planes[2]);

// The image last drawn; valid until one of another size is drawn, or the end.
const struct gpu_texture *yuv_to_rgb_texture(struct yuv_to_rgb *rgb);
MUST_CHECK enum status yuv_to_rgb_read(struct yuv_to_rgb *converter, uint8_t *rgba); // width * height * 4
