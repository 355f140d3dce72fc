// The camera's picture on the graphics chip: read where it lies in the camera's
// memory where the driver can, else uploaded; either way the same pixels. That the
// driver can is believed once it has shown the very pixels that the processor reads.
// One thread, the gpu's.
#pragma once
#include "app/camera/camera_feed.h"
#include "platform/gpu.h"

struct camera_texture;
MUST_CHECK enum status camera_texture_open(struct camera_texture **out, struct gpu *gpu);
void camera_texture_close(struct camera_texture **v); // NULL is fine; waits for the GPU and returns what was lent

bool camera_texture_can_import(const struct camera_texture *v); // it is worth lending it pictures

// The picture of that sight. *dmabuf, where there is one, is the same picture where it lies; it becomes the
// viewfinder's, which returns it when the GPU is done with it. ERR_DEVICE, ERR_MEMORY.
MUST_CHECK enum status camera_texture_update(struct camera_texture *v, const struct camera_frame *frame,
                                             struct dmabuf_image **dmabuf);

// The texture of the picture last shown; linear filtering is its user's affair.
const struct gpu_texture *camera_texture_current(struct camera_texture *v);

struct camera_texture_counts {
    int64_t imported, uploaded; // pictures shown, each way
    const char *why;            // the last one that was lent was not borrowed; "" where there was no such
};
struct camera_texture_counts camera_texture_count(const struct camera_texture *v);
