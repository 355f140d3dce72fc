#include "platform/files/checksum.h"

#include <zlib.h>

uint32_t crc32_of(uint32_t crc, const void *bytes, size_t count)
{
    return count ? (uint32_t)crc32_z(crc, bytes, count) : crc; // of NULL zlib returns what a CRC begins with
}
