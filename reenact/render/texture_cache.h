// Recorded frames as textures on the GPU, made when first wanted and kept within
// a bound: the longest unused goes first. What comes out does not depend on what
// was in it.
#pragma once
#include "platform/gpu.h"
#include "reenact/observation/source_texture.h"

struct texture_cache;

// take and gpu must outlive it. max_bytes: of textures; at least one is always kept.
MUST_CHECK enum status texture_cache_open(struct texture_cache **out, struct gpu *gpu, struct take *take,
                                          size_t max_bytes);
void texture_cache_close(struct texture_cache **c);

struct source_texture {
    const struct gpu_texture *texture; // borrowed until the next call on the cache
    float window[4];                   // left, top, width, height in the frame's pixels
};

// The whole frame as recorded. NOTHING: it has no colour. As take_read; ERR_DEVICE.
MUST_CHECK enum status texture_cache_whole(struct texture_cache *c, int64_t frame, struct source_texture *out);

// The frame's picture of one part (source_patch_make); of a frame without depth,
// which cannot tell parts apart, the whole frame. NOTHING: it shows too little of the part.
MUST_CHECK enum status texture_cache_part(struct texture_cache *c, int64_t frame, enum part p,
                                          struct source_texture *out);
