// The pixels of a depth image to and from the entropy coder: prediction and contexts (depth_codec.h; docs/format.md
// specifies both). The same code (depth_rows.inl, depth_encode.inl, depth_decode.inl) is compiled for levels of 16
// bits, eight of which a vector register holds, and of 32 bits. Internal to the depth codec.
#pragma once
#include "recording/codec_internal.h"

enum {
    DEPTH_BLOCK = 16,    // pixels of a row that are coded together
    HOLE = 0,            // the level of depth 0, whether it occurs or not
    HOLE_CONTEXTS = 63,  // + a bit each for left, above, above right being holes: 64..70
    BLOCK_CONTEXTS = 71, // of the kinds of blocks: + 9 left + 3 above + above right: 71..97
    DEPTH_CONTEXTS = 98,
    DEPTH_NARROW_LEVELS = 1 << 14, // at most so many: twice a difference then fits 16 bits
};

// A block: up to DEPTH_BLOCK pixels of a row.
enum block_kind {
    BLOCK_CODED,     // pixel by pixel
    BLOCK_PREDICTED, // no pixel is a hole, and all are as predicted
    BLOCK_HOLES,     // all pixels are holes
    BLOCK_KINDS,
};

// Behind the head: two parts, the first of first_count bytes.
struct depth_code {
    const uint8_t *bytes;
    size_t count, first_count;
};

struct depth_size {
    int width, height;
};

struct depth_layout {
    int width, height;
    int noise;  // the slope between neighbours, in levels, up to which it counts as none
    int levels; // 0: a level is the depth itself
};

// Pushes all numbers of an image to c->rans, which was begun: those of even rows to stream 0, of odd rows to stream 1.
// ERR_MEMORY.
MUST_CHECK enum status depth_encode_narrow(struct depth_coder *c, const uint16_t *depth, const struct depth_layout *l);
MUST_CHECK enum status depth_encode_wide(struct depth_coder *c, const uint16_t *depth, const struct depth_layout *l);

// Pulls them from c->rans, which was started. NOTHING: the code is damaged. ERR_MEMORY.
MUST_CHECK enum status depth_decode_narrow(struct depth_coder *c, const struct depth_layout *l, uint16_t *depth);
MUST_CHECK enum status depth_decode_wide(struct depth_coder *c, const struct depth_layout *l, uint16_t *depth);

static inline int depth_row_blocks(int width) { return (width + DEPTH_BLOCK - 1) / DEPTH_BLOCK; }
static inline size_t depth_row_numbers(int width) { return (size_t)(depth_row_blocks(width) + width); }

// The median of a, b and a + b - c.
static inline ptrdiff_t depth_predict(ptrdiff_t a, ptrdiff_t b, ptrdiff_t c)
{
    const ptrdiff_t low = a < b ? a : b, high = a < b ? b : a, plane = a + b - c;
    return plane < low ? low : plane > high ? high : plane;
}
