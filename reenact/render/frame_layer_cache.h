// Frame layers (frame_layer.h) on the GPU, within a memory bound. The frames shown last
// are kept; of the others, the one with the nearest resident neighbours is evicted first, so
// that residents spread over the take. One thread: that of the GPU context.
#pragma once
#include "platform/screen/gpu.h"
#include "reenact/frame/frame_layer.h"

struct frame_layer_cache;

// gpu and what source points to must outlive it. max_bytes: of frame layers; one is always kept. ERR_MEMORY.
MUST_CHECK enum status frame_layer_cache_open(struct frame_layer_cache **out, struct gpu *gpu,
                                              const struct frame_source *source, size_t max_bytes);
void frame_layer_cache_close(struct frame_layer_cache **f);

// A struct frame_layer with its images as textures.
struct gpu_frame_layer {
    struct gpu_texture *color, *depth;
    struct bone_corrections corrections;
    float (*shift)[3];
    struct frame_layer_point *points;
    bool *triangle_visible;
};

// Loads the frame unless it is resident. *out: borrowed until the next call. Errors of take_read; ERR_DEVICE.
MUST_CHECK enum status frame_layer_cache_get(struct frame_layer_cache *f, const struct avatar *avatar, int64_t frame,
                                             const struct gpu_frame_layer **out);

// Adds a layer that was loaded elsewhere. Takes over its contents and zeroes *loaded, also on failure. ERR_DEVICE,
// ERR_MEMORY.
MUST_CHECK enum status frame_layer_cache_add(struct frame_layer_cache *f, struct frame_layer *loaded);

// The resident frame nearest in time to `frame`, at most within_ns away; ties: the lowest; -1: none.
int64_t frame_layer_cache_nearest(const struct frame_layer_cache *cache, int64_t frame, int64_t within_ns);

// Drops all layers, as another avatar needs.
void frame_layer_cache_clear(struct frame_layer_cache *cache);
