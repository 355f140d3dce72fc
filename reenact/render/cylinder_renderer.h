// Draws the actor as body cylinders textured from recorded frames (projective texturing,
// [D14] 4.2): open cylinders with one source frame for all parts, as the paper has it, or
// rounded ones with a source frame for each part. One thread: that of the GPU context.
#pragma once
#include "platform/screen/gpu.h"
#include "recording/recording.h"
#include "reenact/retrieval/frame_selection.h"

struct cylinder_renderer;

// gpu and take must outlive it. max_bytes: of textures; at least one is always kept. frames_first: 0, or how many
// frames, evenly over the take, sources are chosen from until a thread has prepared the choice from all of them: 50
// microseconds a frame, half a second for ten minutes. Set the viewer's lens before drawing. ERR_INPUT: a joint of the
// take is not finite. ERR_DEVICE, ERR_MEMORY. After a failure *out is NULL.
MUST_CHECK enum status cylinder_renderer_open(struct cylinder_renderer **out, struct gpu *gpu, struct take *take,
                                              size_t max_bytes, int64_t frames_first);
void cylinder_renderer_close(struct cylinder_renderer **c); // NULL is fine
void cylinder_renderer_set_lens(struct cylinder_renderer *renderer, const struct lens *view);

// The frame whose skeleton is nearest to in_viewer (viewer camera's axes): [D14] eq. 5, frame_selector_find_body.
MUST_CHECK enum status cylinder_renderer_select(struct cylinder_renderer *renderer, const struct skeleton *in_viewer,
                                                struct frame_selection *out);

struct cylinder_view {
    const struct frame_selection *whole; // source frame of open cylinders; NULL: rounded ones, a frame for each part
    int64_t shown;                       // the frame shown; the age of colours counts from it
    const struct skeleton *in_viewer;    // viewer camera's axes
    struct gpu_target *actor;
    struct gpu_target *source; // encoding of renderer_read_source; NULL: not wanted
};
// *parts: number of parts drawn. Errors of take_read; ERR_DEVICE.
MUST_CHECK enum status cylinder_renderer_draw(struct cylinder_renderer *renderer, const struct cylinder_view *view,
                                              int *parts);
