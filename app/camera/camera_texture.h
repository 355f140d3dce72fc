// The camera's image as a GPU texture: imported from the camera's memory (DMA buffer) without a copy where the driver
// can, else uploaded; the pixels are the same either way. A driver is trusted with a kind of image after its pixels
// equalled the CPU's once.
//
// One thread, the GPU's.
#pragma once
#include "app/camera/camera_feed.h"
#include "platform/screen/gpu.h"

struct camera_texture;
MUST_CHECK enum status camera_texture_open(struct camera_texture **out, struct gpu *gpu); // ERR_DEVICE, ERR_MEMORY
void camera_texture_close(struct camera_texture **t); // NULL is fine; waits for the GPU and releases the DMA buffers

// Whether the driver can import at all, so that lending DMA buffers is worth while.
bool camera_texture_can_import(const struct camera_texture *texture);

// Shows the frame's image. *dmabuf, if not NULL, is the same image as a DMA buffer; this takes it over and sets it to
// NULL, and releases it when the GPU has finished reading. ERR_DEVICE, ERR_MEMORY.
MUST_CHECK enum status camera_texture_update(struct camera_texture *texture, const struct camera_frame *frame,
                                             struct dmabuf_image **dmabuf);

// The texture of the image shown last; the user sets its filtering.
const struct gpu_texture *camera_texture_current(struct camera_texture *texture);

struct camera_texture_counts {
    int64_t imported, uploaded; // images shown, each way
    const char *why;            // why the last import failed; "": none failed
};
struct camera_texture_counts camera_texture_count(const struct camera_texture *texture);
