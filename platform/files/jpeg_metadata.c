// The markers of ITU-T T.81, annex B, and of JFIF 1.02.
#include "platform/files/jpeg_metadata.h"

#include <stdlib.h>
#include <string.h>

enum {
    MARKER_SOI = 0xd8,
    MARKER_EOI = 0xd9,
    MARKER_SOS = 0xda,
    MARKER_APP0 = 0xe0,
    MARKER_APP2 = 0xe2,
    MARKER_APP14 = 0xee,
    MARKER_APP15 = 0xef,
    MARKER_COMMENT = 0xfe
};

static bool is_restart(uint8_t marker) { return marker >= 0xd0 && marker <= 0xd7; }

struct reader {
    const uint8_t *bytes;
    size_t count, at;
    uint8_t *out;
    size_t used;
};

static void put(struct reader *r, const uint8_t *bytes, size_t count)
{
    memcpy(r->out + r->used, bytes, count);
    r->used += count;
}

static bool begins_with(const uint8_t *data, size_t count, const char *name, size_t bytes)
{
    return count >= bytes && !memcmp(data, name, bytes);
}

// Whether decoding needs a segment, of another marker than APP0.
static bool is_needed(uint8_t marker, const uint8_t *data, size_t count)
{
    static const char profile[] = "ICC_PROFILE", adobe[] = "Adobe";
    if (marker == MARKER_APP2)
        return begins_with(data, count, profile, sizeof profile);
    if (marker == MARKER_APP14)
        return begins_with(data, count, adobe, sizeof adobe - 1);
    return marker != MARKER_COMMENT && !(marker > MARKER_APP0 && marker <= MARKER_APP15);
}

// The segment's data without its two bytes of length. Puts what decoding needs.
static void put_segment(struct reader *r, uint8_t marker, const uint8_t *data, size_t count)
{
    static const char jfif[] = "JFIF";
    enum { JFIF_BYTES = 14 }; // up to the thumbnail, the last two its width and height
    uint8_t head[4 + JFIF_BYTES] = {0xff, marker, 0, 2 + JFIF_BYTES};
    if (marker == MARKER_APP0) {
        if (!begins_with(data, count, jfif, sizeof jfif) || count < JFIF_BYTES)
            return;
        memcpy(head + 4, data, JFIF_BYTES - 2);
        put(r, head, sizeof head);
        return;
    }
    if (!is_needed(marker, data, count))
        return;
    head[2] = (uint8_t)((count + 2) >> 8);
    head[3] = (uint8_t)((count + 2) & 0xff);
    put(r, head, 4);
    put(r, data, count);
}

// Coded pixels: to the next marker that is not part of them.
static void put_pixels(struct reader *r)
{
    const size_t first = r->at;
    while (r->at < r->count) {
        const uint8_t *mark = memchr(r->bytes + r->at, 0xff, r->count - r->at);
        r->at = mark ? (size_t)(mark - r->bytes) : r->count;
        if (r->count - r->at < 2) {
            r->at = r->count;
            break;
        }
        const uint8_t next = r->bytes[r->at + 1];
        if (next && next != 0xff && !is_restart(next))
            break;
        r->at += next == 0xff ? 1 : 2;
    }
    put(r, r->bytes + first, r->at - first);
}

// One marker with what belongs to it. NOTHING: it was the last.
static enum status step(struct reader *r)
{
    static const uint8_t end[] = {0xff, MARKER_EOI};
    if (r->bytes[r->at] != 0xff)
        return fail(ERR_CORRUPT, "a JPEG picture is damaged: a marker is missing");
    while (r->at < r->count && r->bytes[r->at] == 0xff)
        r->at++;
    if (r->at == r->count)
        return NOTHING;
    const uint8_t marker = r->bytes[r->at++];
    if (marker == MARKER_EOI) {
        put(r, end, sizeof end);
        return NOTHING;
    }
    if (r->count - r->at < 2)
        return NOTHING; // cut short
    const size_t length = (size_t)r->bytes[r->at] << 8 | r->bytes[r->at + 1];
    if (length < 2)
        return fail(ERR_CORRUPT, "a JPEG picture is damaged: a marker's length is impossible");
    if (length > r->count - r->at)
        return NOTHING; // cut short
    put_segment(r, marker, r->bytes + r->at + 2, length - 2);
    r->at += length;
    if (marker == MARKER_SOS)
        put_pixels(r);
    return OK;
}

enum status jpeg_without_metadata(const uint8_t *bytes, size_t count, uint8_t **out, size_t *out_count)
{
    static const uint8_t start[] = {0xff, MARKER_SOI};
    *out = NULL;
    *out_count = 0;
    if (count < 4 || memcmp(bytes, start, sizeof start))
        return fail(ERR_CORRUPT, "a JPEG picture is damaged: it does not begin as one");
    struct reader r = {.bytes = bytes, .count = count, .at = 2, .out = malloc(count + 2)};
    if (!r.out)
        return fail(ERR_MEMORY, "no memory for a picture of %zu bytes", count);
    put(&r, start, sizeof start);
    enum status status = OK;
    while (status == OK && r.at < r.count)
        status = step(&r);
    if (status < 0) {
        free(r.out);
        return status;
    }
    *out = r.out;
    *out_count = r.used;
    return OK;
}
