// CRC-32 (polynomial 0x04c11db7, as in PNG and gzip), by zlib.
#pragma once
#include <stddef.h>
#include <stdint.h>

// Of what `crc` is of, followed by these bytes; 0: of nothing before. Any thread may call.
uint32_t crc32_of(uint32_t crc, const void *bytes, size_t count);
