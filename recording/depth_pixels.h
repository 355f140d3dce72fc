// The pixels of a depth image to and from the entropy coder: prediction and contexts (depth_codec.h; docs/format.md
// specifies both). The same code (depth_rows.inl, depth_encode.inl, depth_decode.inl) is compiled for levels of 16
// bits, eight of which a vector register holds, and of 32 bits. Internal to the depth codec.
#pragma once
#include "platform/files/compress.h"
#include "recording/depth_codec.h"

#include <stdlib.h>

// ---------------------------------------------------------------- scratch memory

struct rans_coder;

// The first byte of a depth image's code. Earlier versions wrote ONE_STATE and TWO_STATES.
enum { DEPTH_RAW = 0, DEPTH_ONE_STATE = 1, DEPTH_TWO_STATES = 2, DEPTH_BLOCKS = 3 };
enum { DEPTH_HEADER = 5 + 1 + 4 * 4 }; // of the coded ones

struct depth_coder {
    struct compressor *compressor;
    struct rans_coder *rans;
    uint8_t *out, *head; // the encoded bytes, and the uncompressed header that goes into them
    size_t out_capacity, head_capacity;
    uint8_t *rows; // of struct rows (depth_rows.inl)
    size_t rows_capacity;
    uint8_t seen[65536]; // which depths occur
    uint16_t level_of[65536], depth_of[65536];
    // Decoding: of a difference of levels + 65535 its quantised slope, as an index (depth_decode.inl); [1]: behind a
    // hole.
    uint8_t slopes[2][2 * 65535 + 1];
    int slopes_noise; // by which they were made; -1: by none
};

// Grows a buffer to at least `wanted` bytes. ERR_MEMORY: it is unchanged.
MUST_CHECK static inline enum status depth_coder_grow(uint8_t **bytes, size_t *capacity, size_t wanted)
{
    if (wanted <= *capacity)
        return OK;
    uint8_t *grown = realloc(*bytes, wanted);
    if (!grown)
        return fail(ERR_MEMORY, "no memory for %zu bytes of an image", wanted);
    *bytes = grown;
    *capacity = wanted;
    return OK;
}

// ---------------------------------------------------------------- pixels

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
