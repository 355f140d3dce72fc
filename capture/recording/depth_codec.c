#include "capture/recording/depth_codec.h"

#include "capture/recording/bytes.h"
#include "platform/compress.h"

#include <stdlib.h>

struct depth_coder {
    struct compressor *compressor;
    uint8_t *plain, *coded; // the bytes before and after compression
    size_t plain_capacity, coded_capacity;
};

enum { LEVEL = 1, HEADER = 5 };

enum status depth_coder_open(struct depth_coder **out)
{
    struct depth_coder *c = calloc(1, sizeof *c);
    *out = NULL;
    if (!c)
        return fail(ERR_MEMORY, "no memory for the depth coder");
    enum status status = compressor_open(&c->compressor);
    if (status != OK)
        free(c);
    else
        *out = c;
    return status;
}

void depth_coder_close(struct depth_coder **c)
{
    if (!*c)
        return;
    compressor_close(&(*c)->compressor);
    free((*c)->plain);
    free((*c)->coded);
    free(*c);
    *c = NULL;
}

static enum status grow(uint8_t **bytes, size_t *capacity, size_t wanted)
{
    if (wanted <= *capacity)
        return OK;
    uint8_t *grown = realloc(*bytes, wanted);
    if (!grown)
        return fail(ERR_MEMORY, "no memory for %zu bytes of a picture", wanted);
    *bytes = grown;
    *capacity = wanted;
    return OK;
}

static enum status pack(struct depth_coder *c, uint8_t method, int width, int height, size_t plain,
                        const uint8_t **bytes, size_t *count)
{
    size_t bound = compress_bound(plain), packed;
    enum status status = grow(&c->coded, &c->coded_capacity, HEADER + bound);
    if (status == OK)
        status = compress_bytes(c->compressor, LEVEL, c->plain, plain, c->coded + HEADER, bound, &packed);
    if (status != OK)
        return status;
    put_u16(put_u16(put_u8(c->coded, method), (uint16_t)width), (uint16_t)height);
    *bytes = c->coded;
    *count = HEADER + packed;
    return OK;
}

static enum status unpack(struct depth_coder *c, uint8_t method, int width, int height, const uint8_t *bytes,
                          size_t count, size_t plain)
{
    if (count < HEADER || bytes[0] != method)
        return fail(ERR_CORRUPT, "a picture's code is damaged");
    const uint8_t *at = bytes + 1;
    int w = get_u16(&at), h = get_u16(&at);
    if (w != width || h != height)
        return fail(ERR_CORRUPT, "a picture has %d x %d pixels where %d x %d were expected", w, h, width, height);
    enum status status = grow(&c->plain, &c->plain_capacity, plain);
    return status == OK ? decompress_bytes(c->compressor, at, count - HEADER, c->plain, plain) : status;
}

enum status depth_encode(struct depth_coder *c, const uint16_t *depth, int width, int height, const uint8_t **bytes,
                         size_t *count)
{
    size_t n = (size_t)width * (size_t)height;
    enum status status = grow(&c->plain, &c->plain_capacity, 2 * n);
    if (status != OK)
        return status;
    uint16_t left = 0;
    for (size_t i = 0; i < n; left = depth[i++]) {
        uint16_t d = (uint16_t)(depth[i] - left);
        uint16_t z = (uint16_t)(d << 1 ^ -(d >> 15));
        c->plain[i] = (uint8_t)z;
        c->plain[n + i] = (uint8_t)(z >> 8);
    }
    return pack(c, 0, width, height, 2 * n, bytes, count);
}

enum status depth_decode(struct depth_coder *c, const uint8_t *bytes, size_t count, uint16_t *depth, int width,
                         int height)
{
    size_t n = (size_t)width * (size_t)height;
    enum status status = unpack(c, 0, width, height, bytes, count, 2 * n);
    if (status != OK)
        return status;
    uint16_t left = 0;
    for (size_t i = 0; i < n; i++) {
        uint16_t z = (uint16_t)(c->plain[i] | c->plain[n + i] << 8);
        left = depth[i] = (uint16_t)(left + (z >> 1 ^ -(z & 1)));
    }
    return OK;
}

enum status mask_encode(struct depth_coder *c, const uint8_t *mask, int width, int height, const uint8_t **bytes,
                        size_t *count)
{
    size_t n = (size_t)width * (size_t)height, packed = (n + 7) / 8;
    enum status status = grow(&c->plain, &c->plain_capacity, packed);
    if (status != OK)
        return status;
    memset(c->plain, 0, packed);
    for (size_t i = 0; i < n; i++)
        if (mask[i])
            c->plain[i / 8] |= (uint8_t)(1 << i % 8);
    return pack(c, 1, width, height, packed, bytes, count);
}

enum status mask_decode(struct depth_coder *c, const uint8_t *bytes, size_t count, uint8_t *mask, int width,
                        int height)
{
    size_t n = (size_t)width * (size_t)height;
    enum status status = unpack(c, 1, width, height, bytes, count, (n + 7) / 8);
    for (size_t i = 0; status == OK && i < n; i++)
        mask[i] = c->plain[i / 8] >> i % 8 & 1;
    return status;
}
