// Scratch memory shared by the depth codec (depth_codec.c) and the mask codec (mask_codec.c).
#pragma once
#include "capture/recording/depth_codec.h"
#include "platform/compress.h"

struct rans_coder;

// The first byte of a depth image's code.
enum { DEPTH_RAW = 0, DEPTH_ONE_STATE = 1, DEPTH_TWO_STATES = 2 };
enum { DEPTH_HEADER = 5 + 1 + 4 * 4 }; // of the coded ones

struct depth_coder {
    struct compressor *compressor;
    struct rans_coder *range;
    uint8_t *out, *head; // the encoded bytes, and the uncompressed header that goes into them
    size_t out_capacity, head_capacity;
    uint8_t *rows; // of struct rows (depth_rows.inl)
    size_t rows_capacity;
    uint8_t seen[65536]; // which depths occur
    uint16_t level_of[65536], depth_of[65536];
};

// Grows a buffer to at least `wanted` bytes. ERR_MEMORY: it is unchanged.
MUST_CHECK enum status depth_coder_grow(uint8_t **bytes, size_t *capacity, size_t wanted);
