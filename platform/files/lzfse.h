// LZFSE, Apple's lossless compression, decoded: what Record3D stores depth in. Pure; any thread may call.
//
// A stream is a row of blocks, each with a mark of four letters (the format as published with Apple's reference
// implementation, github.com/lzfse/lzfse):
//   bvx-   bytes as they are
//   bvx2   LZ77 triplets (literals, match length, distance) and the literals themselves, both by finite state entropy
//          coding (tANS, Duda 2013), read from the end to the beginning; the frequencies in a variable-length code
//   bvxn   LZVN: LZ77 by bytes, for short inputs
//   bvx$   the end
// bvx1, bvx2 with plain frequencies, is written by no encoder and refused.
#pragma once
#include "base/status.h"

#include <stddef.h>
#include <stdint.h>

// Fills exactly out[out_count]. Safe on any input. ERR_CORRUPT: damaged, or of another size; `out` is then undefined.
// ERR_MEMORY.
MUST_CHECK enum status lzfse_decode(const uint8_t *bytes, size_t count, uint8_t *out, size_t out_count);

// How many bytes the first block says that it holds: all of a short stream, and a lower bound of a long one. 0: no
// stream.
size_t lzfse_first_size(const uint8_t *bytes, size_t count);
