// What the frames that are shown saw of the person themselves (frame_layer.h), as textures,
// kept within a bound. One thread.
#pragma once
#include "platform/gpu.h"
#include "reenact/frame/frame_layer.h"

struct frame_layer_cache;

// gpu and what source points to must outlive it. max_bytes: of textures; one frame is always kept. ERR_MEMORY.
MUST_CHECK enum status frame_layer_cache_open(struct frame_layer_cache **out, struct gpu *gpu,
                                              const struct frame_source *source, size_t max_bytes);
void frame_layer_cache_close(struct frame_layer_cache **f);

// As loaded_frame has it.
struct gpu_frame_layer {
    struct gpu_texture *color, *depth;
    struct bone_corrections corrections;
    float (*shift)[3];
    struct frame_layer_point *points;
    bool *own;
};

// Loads the frame where it is not kept. *out: borrowed until the next call. As take_read; ERR_DEVICE.
MUST_CHECK enum status frame_layer_cache_get(struct frame_layer_cache *f, const struct avatar *avatar, int64_t frame,
                                             const struct gpu_frame_layer **out);

// A frame that somebody else loaded. Its contents go over and *loaded is zeroed, on failure too. ERR_DEVICE,
// ERR_MEMORY.
MUST_CHECK enum status frame_layer_cache_add(struct frame_layer_cache *f, struct frame_layer *loaded);

bool frame_layer_cache_has(const struct frame_layer_cache *f, int64_t frame);

// Of those that are kept, the one nearest in time to `frame` and at most that far from it; -1: there is none.
int64_t frame_layer_cache_nearest(const struct frame_layer_cache *f, int64_t frame, int64_t within_ns);

// For another avatar.
void frame_layer_cache_clear(struct frame_layer_cache *f);
