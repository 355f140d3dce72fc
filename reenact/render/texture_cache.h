// Recorded frames as textures on the GPU, made when first needed, within a memory bound;
// the least recently used is evicted first. Results do not depend on the cache's state.
// Besides, the last 12 decoded images are kept in memory. One thread: that of the GPU context.
#pragma once
#include "platform/screen/gpu.h"
#include "reenact/observation/source_texture.h"

struct texture_cache;

// take and gpu must outlive it. max_bytes: of textures; at least one is always kept. ERR_MEMORY; *out is then NULL.
MUST_CHECK enum status texture_cache_open(struct texture_cache **out, struct gpu *gpu, struct take *take,
                                          size_t max_bytes);
void texture_cache_close(struct texture_cache **cache);

struct source_texture {
    const struct gpu_texture *texture; // borrowed until the next call on the cache
    float window[4];                   // left, top, width, height in the frame's pixels
};

// The whole colour image as recorded. NOTHING: the frame has none. Errors of take_read; ERR_DEVICE.
MUST_CHECK enum status texture_cache_whole(struct texture_cache *c, int64_t frame, struct source_texture *out);

// The frame's texture of one part (source_patch_make); of a frame without depth, which
// does not distinguish parts, the whole image. NOTHING: it shows too little of the part.
MUST_CHECK enum status texture_cache_part(struct texture_cache *c, int64_t frame, enum part p,
                                          struct source_texture *out);
