// Depth pictures and person masks in few bytes, exactly as they were. The codes
// are described to the byte in docs/format.md. Each picture stands alone.
// Decoding is safe on any bytes. One coder, one thread; deterministic.
#pragma once
#include "base/status.h"

struct depth_coder; // working memory, kept between pictures

MUST_CHECK enum status depth_coder_open(struct depth_coder **out); // ERR_MEMORY
void depth_coder_close(struct depth_coder **c);                    // NULL is fine; sets *c = NULL

// A picture has 1..16384 pixels a side. Any uint16 is a value like any other.
// *bytes belongs to the coder until its next call. ERR_MEMORY.
MUST_CHECK enum status depth_encode(struct depth_coder *c, const uint16_t *depth, int width, int height,
                                    const uint8_t **bytes, size_t *count);
// ERR_CORRUPT: damaged, cut or of another size; depth[] is then undefined. ERR_MEMORY.
MUST_CHECK enum status depth_decode(struct depth_coder *c, const uint8_t *bytes, size_t count, uint16_t *depth,
                                    int width, int height);

// The same for masks: one byte a pixel; what is not 0 is kept as 1.
MUST_CHECK enum status mask_encode(struct depth_coder *c, const uint8_t *mask, int width, int height,
                                   const uint8_t **bytes, size_t *count);
MUST_CHECK enum status mask_decode(struct depth_coder *c, const uint8_t *bytes, size_t count, uint8_t *mask, int width,
                                   int height);
