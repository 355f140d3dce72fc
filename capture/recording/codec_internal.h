// The working memory that the codes of depth and mask share.
#pragma once
#include "capture/recording/depth_codec.h"
#include "platform/compress.h"

struct rans_coder;

struct depth_coder {
    struct compressor *compressor;
    struct rans_coder *range;
    uint8_t *out, *head; // the code, and what is compressed into it
    size_t out_capacity, head_capacity;
    uint8_t *rows; // four rows of levels, 16 bits each
    size_t rows_capacity;
    int8_t slopes[2 * 65536 + 1];
    uint8_t seen[65536];
    uint16_t level_of[65536], depth_of[65536];
};

MUST_CHECK enum status depth_coder_grow(uint8_t **bytes, size_t *capacity, size_t wanted);
