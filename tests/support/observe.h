// One frame of a take, labelled for a test.
#pragma once
#include "reenact/observation/depth_frame.h"

// *out was opened for the take. NOTHING: the frame lacks depth or skeleton. ERR_CORRUPT, ERR_IO, ERR_MEMORY.
static inline enum status observe_frame(struct depth_frame *out, struct take *take, int64_t frame)
{
    const struct take_entry *e = take_entry(take, frame);
    struct take_images images;
    if (!e->has_depth || !e->has_skeleton)
        return NOTHING;
    const enum status status = take_read(take, frame, TAKE_DEPTH | TAKE_MASK, &images);
    if (status != OK)
        return status;
    const struct skeleton joints = inpaint_skeleton(take, frame);
    depth_frame_label(out, &images, &joints);
    return OK;
}
