// Draws the person as cylinders with recorded frames' colours: the 2014 method's, open and with one
// frame for all of them, or rounded ones with a frame for each part. One thread.
#pragma once
#include "capture/recording/recording.h"
#include "platform/gpu.h"
#include "reenact/retrieval/frame_selection.h"

struct cylinder_renderer;

// gpu and take must outlive it. max_bytes: of textures; one is always kept. The viewer's lens is yet to be set.
// ERR_INPUT: a joint of the take is not finite. ERR_DEVICE, ERR_MEMORY.
MUST_CHECK enum status cylinder_renderer_open(struct cylinder_renderer **out, struct gpu *gpu, struct take *take,
                                              size_t max_bytes);
void cylinder_renderer_close(struct cylinder_renderer **c); // NULL is fine
void cylinder_renderer_set_lens(struct cylinder_renderer *c, const struct lens *view);

// The frame most like the skeleton, which is in the viewer camera's axes, as a whole. As frame_selector_find_body.
MUST_CHECK enum status cylinder_renderer_select(const struct cylinder_renderer *c, const struct skeleton *in_viewer,
                                                struct frame_selection *out);

struct cylinder_view {
    const struct frame_selection *whole; // open cylinders with this frame's colours; NULL: rounded ones
    int64_t shown;                       // frame: colours are so much older or newer
    const struct skeleton *in_viewer;    // viewer camera's axes
    struct gpu_target *actor;
    struct gpu_target *source; // where each pixel is from, as renderer_read_source has it; NULL: not asked for
};
// parts: how many are drawn. As take_read; ERR_DEVICE.
MUST_CHECK enum status cylinder_renderer_draw(struct cylinder_renderer *c, const struct cylinder_view *view,
                                              int *parts);
