// Scratch memory shared by the depth codec (depth_codec.c) and the mask codec (mask_codec.c).
#pragma once
#include "platform/files/compress.h"
#include "recording/depth_codec.h"

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
MUST_CHECK enum status depth_coder_grow(uint8_t **bytes, size_t *capacity, size_t wanted);
