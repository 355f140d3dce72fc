// Draws the person as cylinders with recorded frames' colours: the 2014 method's, open and with one
// frame for all of them, or rounded ones with a frame for each part. One thread.
#pragma once
#include "capture/recording/recording.h"
#include "platform/gpu.h"
#include "reenact/retrieval/frame_selection.h"

struct cylinder_painter;

// gpu and take must outlive it. max_bytes: of textures; one is always kept. The viewer's lens is yet to be set.
// ERR_INPUT: a joint of the take is not finite. ERR_DEVICE, ERR_MEMORY.
MUST_CHECK enum status cylinder_painter_open(struct cylinder_painter **out, struct gpu *gpu, struct take *take,
                                             size_t max_bytes);
void cylinder_painter_close(struct cylinder_painter **c); // NULL is fine
void cylinder_painter_set_lens(struct cylinder_painter *c, const struct lens *view);

// The frame most like the skeleton, which is in the viewer camera's axes, as a whole. As select_whole.
MUST_CHECK enum status cylinder_painter_select(const struct cylinder_painter *c, const struct skeleton *in_viewer,
                                               struct selection *out);

struct cylinder_view {
    const struct selection *whole;    // open cylinders with this frame's colours; NULL: rounded ones
    int64_t shown;                    // frame: colours are so much older or newer
    const struct skeleton *in_viewer; // viewer camera's axes
    struct gpu_target *actor;
    struct gpu_target *source; // where each pixel is from, as painter_read_source has it; NULL: not asked for
};
// parts: how many are drawn. As take_read; ERR_DEVICE.
MUST_CHECK enum status cylinder_painter_draw(struct cylinder_painter *c, const struct cylinder_view *view, int *parts);
