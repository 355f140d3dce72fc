// The mask codec: each pixel is compared with the one above it; the lengths of alternating runs of equal and different
// pixels are stored as varints and compressed with zstd.
#include "recording/codec_internal.h"
#include "recording/little_endian.h"

enum { HEADER = 1 + 2 + 2 + 4, VERSION = 0 };

// The end of a run: the first index in [from, n) at which "differs from the pixel above" is not `differs`; n: none.
static size_t run_end(const uint8_t *mask, size_t from, size_t n, size_t width, bool differs)
{
    for (; from < n; from++) {
        bool above = from >= width && mask[from - width], here = mask[from];
        if ((here != above) != differs)
            break;
    }
    return from;
}

enum status mask_encode(struct depth_coder *c, const uint8_t *mask, int width, int height, const uint8_t **bytes,
                        size_t *count)
{
    assert(width > 0 && height > 0 && width <= 16384 && height <= 16384);
    size_t n = (size_t)width * (size_t)height, used = 0, packed;
    bool differs = false;
    for (size_t from = 0; from < n; differs = !differs) {
        // The buffer doubles, so that a simple mask does not cost the memory of the worst one.
        if (c->head_capacity < used + 5) {
            enum status status = depth_coder_grow(&c->head, &c->head_capacity, 2 * used + 4096);
            if (status != OK)
                return status;
        }
        size_t end = run_end(mask, from, n, (size_t)width, differs);
        used = (size_t)(put_varint(c->head + used, (uint32_t)(end - from)) - c->head);
        from = end;
    }
    size_t bound = compress_bound(used);
    enum status status = depth_coder_grow(&c->out, &c->out_capacity, HEADER + bound);
    if (status == OK)
        status = compress_bytes(c->compressor, 3, c->head, used, c->out + HEADER, &packed);
    if (status != OK)
        return status;
    put_u32(put_u16(put_u16(put_u8(c->out, VERSION), (uint16_t)width), (uint16_t)height), (uint32_t)used);
    *bytes = c->out;
    *count = HEADER + packed;
    return OK;
}

enum status mask_decode(struct depth_coder *c, const uint8_t *bytes, size_t count, uint8_t *mask, int width, int height)
{
    assert(width > 0 && height > 0 && width <= 16384 && height <= 16384);
    size_t n = (size_t)width * (size_t)height, w = (size_t)width;
    const uint8_t *at = bytes + 1;
    if (count < HEADER || bytes[0] != VERSION)
        return fail(ERR_CORRUPT, "a mask's code is damaged");
    int coded_width = get_u16(&at), coded_height = get_u16(&at);
    uint32_t used = get_u32(&at);
    if (coded_width != width || coded_height != height || used > 2 * n + 5)
        return fail(ERR_CORRUPT, "a mask's code is damaged or of another size");
    enum status status = depth_coder_grow(&c->head, &c->head_capacity, used + (size_t)1);
    if (status == OK)
        status = decompress_bytes(c->compressor, at, count - HEADER, c->head, used);
    if (status != OK)
        return status;
    const uint8_t *end = c->head + used;
    at = c->head;
    size_t i = 0;
    for (uint8_t differs = 0; i < n; differs = !differs) {
        uint32_t run;
        if (!get_varint(&at, end, &run) || run > n - i)
            return fail(ERR_CORRUPT, "a mask's code is damaged");
        for (size_t stop = i + run; i < stop; i++)
            mask[i] = (i >= w ? mask[i - w] : 0) ^ differs;
    }
    return at == end ? OK : fail(ERR_CORRUPT, "a mask's code is damaged");
}
