// General lossless compression of memory (zstd). The same input, level and
// library version give the same output. A handle belongs to one thread at a time.
#pragma once
#include "base/status.h"

#include <stddef.h>
#include <stdint.h>

// ---------------------------------------------------------------- checksum

// CRC-32 (polynomial 0x04c11db7, as in PNG and gzip), by zlib.

// Of what `crc` is of, followed by these bytes; 0: of nothing before. Any thread may call.
uint32_t crc32_of(uint32_t crc, const void *bytes, size_t count);

// ---------------------------------------------------------------- compress

struct compressor; // working memory, kept between calls

MUST_CHECK enum status compressor_open(struct compressor **out); // ERR_MEMORY
void compressor_close(struct compressor **compressor);           // NULL is fine; sets *compressor = NULL

// The largest output for `count` bytes of input.
size_t compress_bound(size_t count);

// level: zstd's, -7 (fast) .. 19 (small). `out` has compress_bound(count) bytes, of which *out_count are used.
// ERR_MEMORY.
MUST_CHECK enum status compress_bytes(struct compressor *compressor, int level, const void *bytes, size_t count,
                                      void *out, size_t *out_count);

// Fills exactly out[out_count]. Safe on any input. ERR_CORRUPT: damaged, or of another size; `out` is then undefined.
// ERR_MEMORY.
MUST_CHECK enum status decompress_bytes(struct compressor *compressor, const void *bytes, size_t count, void *out,
                                        size_t out_count);
