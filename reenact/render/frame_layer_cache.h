// What the frames that are shown saw of the person themselves (frame_layer.h), as textures,
// kept within a bound. One thread.
#pragma once
#include "platform/gpu.h"
#include "reenact/frame/frame_layer.h"

struct shown_frames;

// gpu, take and rays must outlive it. max_bytes: of textures; one frame is always kept. ERR_MEMORY.
MUST_CHECK enum status shown_frames_open(struct shown_frames **out, struct gpu *gpu, struct take *take,
                                         const struct source_rays *rays, size_t max_bytes);
void shown_frames_close(struct shown_frames **f);

// As loaded_frame has it.
struct shown_frame {
    struct gpu_texture *color, *depth;
    struct adjustment adjustment;
    float (*shift)[3];
    struct loaded_point *points;
    bool *own;
};

// Loads the frame where it is not kept. *out: borrowed until the next call. As take_read; ERR_DEVICE.
MUST_CHECK enum status shown_frames_of(struct shown_frames *f, const struct likeness *likeness, int64_t frame,
                                       const struct shown_frame **out);

// A frame that somebody else loaded. Its contents go over and *loaded is zeroed, on failure too. ERR_DEVICE,
// ERR_MEMORY.
MUST_CHECK enum status shown_frames_give(struct shown_frames *f, struct loaded_frame *loaded);

bool shown_frames_keeps(const struct shown_frames *f, int64_t frame);

// Of those that are kept, the one nearest in time to `frame` and at most that far from it; -1: there is none.
int64_t shown_frames_near(const struct shown_frames *f, int64_t frame, int64_t within_ns);

// For another likeness.
void shown_frames_forget(struct shown_frames *f);
