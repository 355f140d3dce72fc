// Little-endian numbers, packed without gaps, as a recording stores them. Each function advances its pointer.
#pragma once
#include "base/geometry.h"

#include <string.h>

// ---- writing: the caller ensures that the buffer is large enough
static inline uint8_t *put_u8(uint8_t *at, uint8_t value)
{
    *at = value;
    return at + 1;
}
static inline uint8_t *put_u16(uint8_t *at, uint16_t value)
{
    at[0] = (uint8_t)value;
    at[1] = (uint8_t)(value >> 8);
    return at + 2;
}
static inline uint8_t *put_u32(uint8_t *at, uint32_t value)
{
    return put_u16(put_u16(at, (uint16_t)value), (uint16_t)(value >> 16));
}
static inline uint8_t *put_u64(uint8_t *at, uint64_t value)
{
    return put_u32(put_u32(at, (uint32_t)value), (uint32_t)(value >> 32));
}
static inline uint8_t *put_f32(uint8_t *at, float value)
{
    uint32_t bits;
    memcpy(&bits, &value, sizeof bits);
    return put_u32(at, bits);
}
static inline uint8_t *put_f64(uint8_t *at, double value)
{
    uint64_t bits;
    memcpy(&bits, &value, sizeof bits);
    return put_u64(at, bits);
}
// LEB128: 7 bits a byte, low ones first, the top bit set in all but the last; at most 5 bytes.
static inline uint8_t *put_varint(uint8_t *at, uint32_t value)
{
    for (; value > 127; value >>= 7)
        *at++ = (uint8_t)(value | 128);
    *at++ = (uint8_t)value;
    return at;
}

// ---- reading: the caller has checked that the bytes are there
static inline uint16_t get_u16(const uint8_t **at)
{
    const uint8_t *b = *at;
    *at += 2;
    return (uint16_t)(b[0] | b[1] << 8);
}
static inline uint32_t get_u32(const uint8_t **at)
{
    uint32_t low = get_u16(at);
    return low | (uint32_t)get_u16(at) << 16;
}
static inline uint64_t get_u64(const uint8_t **at)
{
    uint64_t low = get_u32(at);
    return low | (uint64_t)get_u32(at) << 32;
}
static inline float get_f32(const uint8_t **at)
{
    uint32_t bits = get_u32(at);
    float value;
    memcpy(&value, &bits, sizeof value);
    return value;
}
static inline double get_f64(const uint8_t **at)
{
    uint64_t bits = get_u64(at);
    double value;
    memcpy(&value, &bits, sizeof value);
    return value;
}
// Checks by itself. False: the bytes end first, or the number has more than 32 bits.
static inline bool get_varint(const uint8_t **at, const uint8_t *end, uint32_t *value)
{
    *value = 0;
    for (int shift = 0; shift < 35 && *at < end; shift += 7) {
        uint8_t byte = *(*at)++;
        if (shift == 28 && byte > 15)
            return false;
        *value |= (uint32_t)(byte & 127) << shift;
        if (byte < 128)
            return true;
    }
    return false;
}
