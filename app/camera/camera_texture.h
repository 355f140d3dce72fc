// The camera's picture on the graphics chip: read where it lies in the camera's
// memory where the driver can, else uploaded; either way the same pixels. That the
// driver can is believed once it has shown the very pixels that the processor reads.
// One thread, the gpu's.
#pragma once
#include "app/camera/camera_feed.h"
#include "platform/gpu.h"

struct viewfinder;
MUST_CHECK enum status viewfinder_open(struct viewfinder **out, struct gpu *gpu);
void viewfinder_close(struct viewfinder **v); // NULL is fine; waits for the GPU and returns what was lent

bool viewfinder_can_borrow(const struct viewfinder *v); // it is worth lending it pictures

// The picture of that sight. *loan, where there is one, is the same picture where it lies; it becomes the
// viewfinder's, which returns it when the GPU is done with it. ERR_DEVICE, ERR_MEMORY.
MUST_CHECK enum status viewfinder_show(struct viewfinder *v, const struct sight *sight, struct loan **loan);

// The texture of the picture last shown; linear filtering is its user's affair.
const struct gpu_texture *viewfinder_texture(struct viewfinder *v);

struct viewfinder_counts {
    int64_t borrowed, uploaded; // pictures shown, each way
    const char *why;            // the last one that was lent was not borrowed; "" where there was no such
};
struct viewfinder_counts viewfinder_counts(const struct viewfinder *v);
