// General lossless compression of memory (zstd). The same bytes in, level and
// version give the same bytes out. One handle, one thread.
#pragma once
#include "base/status.h"

struct compressor; // working memory, kept between calls

MUST_CHECK enum status compressor_open(struct compressor **out); // ERR_MEMORY
void compressor_close(struct compressor **c);                    // NULL is fine; sets *c = NULL

// The most that `count` bytes can become.
size_t compress_bound(size_t count);

// level: zstd's, -7 (fast) .. 19 (small). `capacity` must be at least compress_bound(count). ERR_MEMORY.
MUST_CHECK enum status compress_bytes(struct compressor *c, int level, const void *bytes, size_t count, void *out,
                                      size_t capacity, size_t *out_count);

// Fills exactly out[out_count]. Safe on any bytes. ERR_CORRUPT: damaged, or of another size. ERR_MEMORY.
MUST_CHECK enum status decompress_bytes(struct compressor *c, const void *bytes, size_t count, void *out,
                                        size_t out_count);
