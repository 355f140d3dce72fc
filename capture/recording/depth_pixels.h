// The pixels of a depth image to and from the entropy coder: prediction and contexts (depth_codec.h; docs/format.md
// specifies both). The same code (depth_rows.inl, depth_encode.inl, depth_decode.inl) is compiled for levels of 16
// bits, eight of which a vector register holds, and of 32 bits. Internal to the depth codec.
#pragma once
#include "capture/recording/codec_internal.h"

enum {
    HOLE = 0,           // the level of depth 0, whether it occurs or not
    HOLE_CONTEXTS = 63, // + a bit each for left, above, above right being holes: 64..70
    FLAT_MISS = 71,
    FLAT_RUN = 72,
    DEPTH_CONTEXTS = 73,
    DEPTH_NARROW_LEVELS = 1 << 14, // at most so many: twice a difference then fits 16 bits
};

struct depth_size {
    int width, height;
};

struct depth_layout {
    int width, height;
    int noise;  // the slope between neighbours, in levels, up to which it counts as none
    int levels; // 0: a level is the depth itself
};

// Pushes all numbers of an image to c->range, which was begun. ERR_MEMORY.
MUST_CHECK enum status depth_encode_narrow(struct depth_coder *c, const uint16_t *depth, const struct depth_layout *l);
MUST_CHECK enum status depth_encode_wide(struct depth_coder *c, const uint16_t *depth, const struct depth_layout *l);

// Pulls them from c->range, which was started. NOTHING: the code is damaged. ERR_MEMORY.
MUST_CHECK enum status depth_decode_narrow(struct depth_coder *c, const struct depth_layout *l, uint16_t *depth);
MUST_CHECK enum status depth_decode_wide(struct depth_coder *c, const struct depth_layout *l, uint16_t *depth);
