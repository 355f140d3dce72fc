// Lossless coding of depth images and masks, each image by itself. Depth: the median predictor of LOCO-I (Weinberger,
// Seroussi and Sapiro 2000) over ranks of the depths that occur, and rANS (Duda 2013) with contexts; masks: run lengths
// and zstd. docs/format.md describes both to the byte. Decoding is safe on any bytes. One coder, one thread;
// deterministic.
#pragma once
#include "base/status.h"

struct depth_coder; // scratch memory kept between images: 1.5 MB and at most 24 bytes a pixel

MUST_CHECK enum status depth_coder_open(struct depth_coder **out); // ERR_MEMORY: *out is then NULL
void depth_coder_close(struct depth_coder **coder);                // NULL is fine; sets *coder = NULL

// An image has 1..16384 pixels a side and any uint16_t values. *bytes belongs to the coder and is valid until its next
// call. ERR_MEMORY: *bytes and *count are then undefined, and the coder can be used again.
MUST_CHECK enum status depth_encode(struct depth_coder *coder, const uint16_t *depth, int width, int height,
                                    const uint8_t **bytes, size_t *count);
// ERR_CORRUPT: damaged, truncated or of another size. ERR_MEMORY. On failure depth[] is undefined.
MUST_CHECK enum status depth_decode(struct depth_coder *coder, const uint8_t *bytes, size_t count, uint16_t *depth,
                                    int width, int height);

// The same for masks: one byte a pixel; any value but 0 is stored as 1.
MUST_CHECK enum status mask_encode(struct depth_coder *coder, const uint8_t *mask, int width, int height,
                                   const uint8_t **bytes, size_t *count);
MUST_CHECK enum status mask_decode(struct depth_coder *coder, const uint8_t *bytes, size_t count, uint8_t *mask,
                                   int width, int height);
