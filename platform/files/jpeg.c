#include "platform/files/jpeg.h"

#include "base/pixels.h"

#include <stdlib.h>
#include <string.h>
#include <turbojpeg.h>

// ---------------------------------------------------------------- jpeg metadata

// The markers of ITU-T T.81, annex B, and of JFIF 1.02.

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

static void put_bytes(struct reader *reader, const uint8_t *bytes, size_t count)
{
    memcpy(reader->out + reader->used, bytes, count);
    reader->used += count;
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
static void put_segment(struct reader *reader, uint8_t marker, const uint8_t *data, size_t count)
{
    static const char jfif[] = "JFIF";
    enum { JFIF_BYTES = 14 }; // up to the thumbnail, the last two its width and height
    uint8_t head[4 + JFIF_BYTES] = {0xff, marker, 0, 2 + JFIF_BYTES};
    if (marker == MARKER_APP0) {
        if (!begins_with(data, count, jfif, sizeof jfif) || count < JFIF_BYTES)
            return;
        memcpy(head + 4, data, JFIF_BYTES - 2);
        put_bytes(reader, head, sizeof head);
        return;
    }
    if (!is_needed(marker, data, count))
        return;
    head[2] = (uint8_t)((count + 2) >> 8);
    head[3] = (uint8_t)((count + 2) & 0xff);
    put_bytes(reader, head, 4);
    put_bytes(reader, data, count);
}

// Coded pixels: to the next marker that is not part of them.
static void put_pixels(struct reader *reader)
{
    const size_t first = reader->at;
    while (reader->at < reader->count) {
        const uint8_t *mark = memchr(reader->bytes + reader->at, 0xff, reader->count - reader->at);
        reader->at = mark ? (size_t)(mark - reader->bytes) : reader->count;
        if (reader->count - reader->at < 2) {
            reader->at = reader->count;
            break;
        }
        const uint8_t next = reader->bytes[reader->at + 1];
        if (next && next != 0xff && !is_restart(next))
            break;
        reader->at += next == 0xff ? 1 : 2;
    }
    put_bytes(reader, reader->bytes + first, reader->at - first);
}

// One marker with what belongs to it. NOTHING: it was the last.
static enum status copy_segment(struct reader *reader)
{
    static const uint8_t end[] = {0xff, MARKER_EOI};
    if (reader->bytes[reader->at] != 0xff)
        return fail(ERR_CORRUPT, "a JPEG picture is damaged: a marker is missing");
    while (reader->at < reader->count && reader->bytes[reader->at] == 0xff)
        reader->at++;
    if (reader->at == reader->count)
        return NOTHING;
    const uint8_t marker = reader->bytes[reader->at++];
    if (marker == MARKER_EOI) {
        put_bytes(reader, end, sizeof end);
        return NOTHING;
    }
    if (reader->count - reader->at < 2)
        return NOTHING; // cut short
    const size_t length = (size_t)reader->bytes[reader->at] << 8 | reader->bytes[reader->at + 1];
    if (length < 2)
        return fail(ERR_CORRUPT, "a JPEG picture is damaged: a marker's length is impossible");
    if (length > reader->count - reader->at)
        return NOTHING; // cut short
    put_segment(reader, marker, reader->bytes + reader->at + 2, length - 2);
    reader->at += length;
    if (marker == MARKER_SOS)
        put_pixels(reader);
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
    put_bytes(&r, start, sizeof start);
    enum status status = OK;
    while (status == OK && r.at < r.count)
        status = copy_segment(&r);
    if (status < 0) {
        free(r.out);
        return status;
    }
    *out = r.out;
    *out_count = r.used;
    return OK;
}

// ---------------------------------------------------------------- jpeg

// A lack of memory is no damage. libjpeg-turbo says which only in words.
static enum status decode_failed(tjhandle handle)
{
    const char *why = tjGetErrorStr2(handle);
    if (strstr(why, "emory"))
        return fail(ERR_MEMORY, "no memory to decode a picture");
    return fail(ERR_CORRUPT, "a JPEG picture is damaged (%s)", why);
}

// Of four inks: no colours that a screen has without the printer's profile.
static enum status check_colorspace(int colorspace)
{
    return colorspace == TJCS_CMYK || colorspace == TJCS_YCCK
               ? fail(ERR_INPUT, "a JPEG picture is in CMYK, for a printer; save it in RGB")
               : OK;
}

enum status jpeg_size(const uint8_t *bytes, size_t count, int *width, int *height)
{
    tjhandle handle = tjInitDecompress();
    if (!handle)
        return fail(ERR_MEMORY, "no memory to decode a picture");
    int subsampling, colorspace;
    enum status status = OK;
    *width = *height = 0; // stays so, without an error, when the data end before the image begins
    if (tjDecompressHeader3(handle, bytes, (unsigned long)count, width, height, &subsampling, &colorspace))
        status = decode_failed(handle);
    else if (colorspace == TJCS_CMYK || colorspace == TJCS_YCCK)
        status = fail(ERR_INPUT, "a JPEG picture has a printer's colours (CMYK); save it with a screen's (RGB)");
    else if (*width < 1 || *height < 1)
        status = fail(ERR_CORRUPT, "a JPEG picture is damaged: it ends before its picture begins");
    else if (!image_size_is_usable(*width, *height))
        status =
            fail(ERR_INPUT, "a JPEG picture has %d x %d pixels; at most %d a side and %d million in all can be used",
                 *width, *height, IMAGE_SIDE_MAX, IMAGE_PIXELS_MAX / 1000000);
    else
        status = check_colorspace(colorspace);
    tjDestroy(handle);
    return status;
}

enum status jpeg_decode(const uint8_t *bytes, size_t count, uint8_t *rgb, int width, int height)
{
    tjhandle handle = tjInitDecompress();
    if (!handle)
        return fail(ERR_MEMORY, "no memory to decode a picture");
    int w = 0, h = 0, subsampling, colorspace;
    enum status status = OK;
    // A warning ("premature end of file") means missing pixels: an error here.
    if (tjDecompressHeader3(handle, bytes, (unsigned long)count, &w, &h, &subsampling, &colorspace))
        status = decode_failed(handle);
    else if (colorspace == TJCS_CMYK || colorspace == TJCS_YCCK)
        status = fail(ERR_INPUT, "a JPEG picture has a printer's colours (CMYK); save it with a screen's (RGB)");
    else if (w != width || h != height)
        status =
            fail(ERR_CORRUPT, "a JPEG picture has %d x %d pixels where %d x %d were expected", w, h, width, height);
    else if ((status = check_colorspace(colorspace)) != OK)
        ; // said
    else if (tjDecompress2(handle, bytes, (unsigned long)count, rgb, width, 0, height, TJPF_RGB,
                           TJFLAG_ACCURATEDCT | TJFLAG_LIMITSCANS))
        status = decode_failed(handle);
    tjDestroy(handle);
    return status;
}

enum status jpeg_encode(const uint8_t *rgb, int width, int height, int quality, uint8_t **bytes, size_t *count)
{
    tjhandle handle = tjInitCompress();
    if (!handle)
        return fail(ERR_MEMORY, "no memory to encode a picture");
    unsigned char *coded = NULL;
    unsigned long size = 0;
    enum status status = OK;
    if (tjCompress2(handle, rgb, width, 0, height, TJPF_RGB, &coded, &size, TJSAMP_420, quality, TJFLAG_ACCURATEDCT)) {
        status = fail(ERR_MEMORY, "a picture could not be encoded as JPEG (%s)", tjGetErrorStr2(handle));
    } else if (!(*bytes = malloc(size))) {
        status = fail(ERR_MEMORY, "no memory for an encoded picture of %lu bytes", size);
    } else {
        memcpy(*bytes, coded, size);
        *count = size;
    }
    tjFree(coded);
    tjDestroy(handle);
    return status;
}
