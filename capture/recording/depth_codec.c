// A Kinect-like sensor gives a few hundred distinct depths, so each pixel is replaced by the rank of its depth among
// those of the image (its level), predicted from the levels left, above and above left (the median predictor of
// LOCO-I), and the residual is entropy-coded (rans_coder.h) with a context quantised from the slopes about the pixel.
// Where all four neighbours are equal, a run length is coded instead, up to the first pixel that differs.
#include "capture/recording/depth_codec.h"

#include "capture/recording/little_endian.h"
#include "capture/recording/codec_internal.h"
#include "capture/recording/rans_coder.h"

#include <stdlib.h>

enum {
    RAW = 0, // 16 bits a pixel
    CODED = 1,
    HEADER = 5 + 1 + 4 * 4, // of CODED
    HOLE_CONTEXTS = 63,     // + a bit each for left, above, above right being holes: 64..70
    FLAT_MISS = 71,
    FLAT_RUN = 72,
    CONTEXTS = 73,
    HOLE = 0, // the level of depth 0, whether it occurs or not
};

enum status depth_coder_open(struct depth_coder **out)
{
    struct depth_coder *c = calloc(1, sizeof *c);
    *out = NULL;
    if (!c)
        return fail(ERR_MEMORY, "no memory for the depth coder");
    enum status status = compressor_open(&c->compressor);
    if (status == OK)
        status = rans_open(&c->range, CONTEXTS);
    if (status == OK)
        *out = c;
    else
        depth_coder_close(&c);
    return status;
}

void depth_coder_close(struct depth_coder **c)
{
    if (!*c)
        return;
    compressor_close(&(*c)->compressor);
    rans_close(&(*c)->range);
    free((*c)->out);
    free((*c)->head);
    free((*c)->rows);
    free(*c);
    *c = NULL;
}

enum status depth_coder_grow(uint8_t **bytes, size_t *capacity, size_t wanted)
{
    if (wanted <= *capacity)
        return OK;
    uint8_t *grown = realloc(*bytes, wanted);
    if (!grown)
        return fail(ERR_MEMORY, "no memory for %zu bytes of an image", wanted);
    *bytes = grown;
    *capacity = wanted;
    return OK;
}

// ------------------------------------------------------------- levels

// Finds the distinct depths. Returns the number of levels (level 0 is always depth 0), or 0 if a level is the depth
// itself, because the sensor uses nearly all values.
static int find_levels(struct depth_coder *c, const uint16_t *depth, size_t n)
{
    memset(c->seen, 0, sizeof c->seen);
    for (size_t i = 0; i < n; i++)
        c->seen[depth[i]] = 1;
    int levels = 1, most = 0;
    c->level_of[0] = HOLE;
    c->depth_of[0] = 0;
    for (int d = 1; d < 65536; d++)
        if (c->seen[d]) {
            c->level_of[d] = (uint16_t)levels;
            c->depth_of[levels++] = (uint16_t)d;
            most = d;
        }
    if (4 * levels <= most)
        return levels;
    for (int d = 0; d < 65536; d++)
        c->level_of[d] = c->depth_of[d] = (uint16_t)d;
    return 0;
}

// The slope between neighbours, in levels, up to which it is taken for noise: half the mean step between neighbours.
static int measure_noise(struct depth_coder *c, const uint16_t *depth, int width, int height)
{
    enum { EDGE = 64 }; // larger steps are edges; chosen by hand
    int64_t sum = 0, count = 0;
    for (int y = 0; y < height; y += 4) {
        const uint16_t *row = depth + (size_t)y * (size_t)width;
        for (int x = 1; x < width; x++) {
            int step = abs(c->level_of[row[x]] - c->level_of[row[x - 1]]);
            if (row[x] && row[x - 1] && step < EDGE) {
                sum += step;
                count++;
            }
        }
    }
    return count ? (int)(sum / (2 * count)) : 0;
}

// ------------------------------------------------------------- the neighbourhood

// Levels as coded, and with each hole filled by its prediction, for the current row and the one above. [0] is left of
// the image, [width + 1] right of it. Above the first row is a row of holes.
struct rows {
    uint16_t *level, *level_above, *filled, *filled_above;
};

static enum status rows_begin(struct depth_coder *c, struct rows *r, int width)
{
    size_t length = (size_t)width + 2;
    enum status status = depth_coder_grow(&c->rows, &c->rows_capacity, 4 * length * sizeof(uint16_t));
    if (status != OK)
        return status;
    memset(c->rows, 0, 4 * length * sizeof(uint16_t));
    uint16_t *first = (uint16_t *)(void *)c->rows; // aligned: fresh from realloc
    *r = (struct rows){first, first + length, first + 2 * length, first + 3 * length};
    return OK;
}

static void rows_next(struct rows *r, int width)
{
    struct rows old = *r;
    *r = (struct rows){old.level_above, old.level, old.filled_above, old.filled};
    r->level[0] = r->level_above[0] = r->level_above[1];
    r->filled[0] = r->filled_above[0] = r->filled_above[1];
    r->level_above[width + 1] = r->level_above[width];
    r->filled_above[width + 1] = r->filled_above[width];
}

// The neighbours of a pixel: a left of it, c b d above it from left to right (LOCO-I's names).
struct neighbors {
    int a, b, c, d;
};

// All four are equal.
static inline bool is_flat(struct neighbors level)
{
    return !((level.a ^ level.b) | (level.b ^ level.c) | (level.c ^ level.d));
}

static inline int predict(struct neighbors filled)
{
    int low = filled.a < filled.b ? filled.a : filled.b, high = filled.a < filled.b ? filled.b : filled.a;
    int plane = filled.a + filled.b - filled.c;
    return plane < low ? low : plane > high ? high : plane;
}

// Table of the quantised slope, -2 .. 2, of each difference of two levels; a table, because branches on it are badly
// predicted. Returns its middle, difference 0.
static const int8_t *make_slopes(struct depth_coder *c, int noise)
{
    const int middle = 65536, edge = 3 * noise + 1;
    int8_t *slopes = c->slopes;
    memset(slopes, -2, sizeof c->slopes);
    memset(slopes + middle - edge, -1, (size_t)(edge - noise));
    memset(slopes + middle - noise, 0, (size_t)(2 * noise + 1));
    memset(slopes + middle + noise + 1, 1, (size_t)(edge - noise));
    memset(slopes + middle + edge + 1, 2, sizeof c->slopes - (size_t)(middle + edge + 1));
    return slopes + middle;
}

// Context of a pixel. ahead: slope from above to above right; behind: from above left to above. *sign -1: the context
// is shared with the mirrored neighbourhood, and the residual is negated.
static inline int context_of(struct neighbors level, int ahead, int behind, int down, int *sign)
{
    int holes = (level.a == HOLE) | (level.b == HOLE) << 1 | (level.d == HOLE) << 2;
    if (holes) {
        *sign = 1;
        return HOLE_CONTEXTS + holes;
    }
    // The sign is unpredictable, so there is no branch: all bits are set below zero.
    int index = 25 * ahead + 5 * behind + down, below = -(index < 0);
    *sign = below | 1;
    return (index ^ below) - below;
}

// ------------------------------------------------------------- encoding

static inline uint32_t fold(int residual) // 0, -1, 1, -2, 2 ... become 0, 1, 2, 3, 4 ...
{
    return residual < 0 ? 2 * (uint32_t)-residual - 1 : 2 * (uint32_t)residual;
}

static inline int unfold(uint32_t folded) { return folded & 1 ? -(int)(folded / 2) - 1 : (int)(folded / 2); }

static void encode_pixels(struct depth_coder *c, struct rows *r, const uint16_t *depth, int width, int height,
                          int noise)
{
    struct rans_coder range = *c->range; // a local copy, which cannot alias the stores below
    size_t run_position = 0;
    uint32_t run = 0;
    bool in_run = false;
    const int8_t *slopes = make_slopes(c, noise);
    for (int y = 0; y < height; y++) {
        rows_next(r, width);
        uint16_t *restrict level = r->level, *restrict filled = r->filled;
        const uint16_t *restrict level_above = r->level_above, *restrict filled_above = r->filled_above;
        for (int x = 0; x < width; x++)
            level[x + 1] = c->level_of[depth[(size_t)y * (size_t)width + (size_t)x]];
        struct neighbors l = {level[0], level_above[1], level_above[0], 0};
        struct neighbors f = {filled[0], filled_above[1], filled_above[0], 0};
        int behind = slopes[f.b - f.c], ahead;
        for (int x = 1; x <= width; x++) {
            const int here = level[x];
            l.d = level_above[x + 1];
            f.d = filled_above[x + 1];
            ahead = slopes[f.d - f.b];
            bool flat = is_flat(l);
            if (flat && !in_run) {
                in_run = true;
                run = 0;
                run_position = rans_reserve(&range);
            }
            if (flat && here == l.a) {
                // Most of an image: on to the last pixel of the run for which nothing changes.
                const int first = x;
                filled[x] = (uint16_t)f.a;
                while (x < width && level[x + 1] == here && level_above[x + 2] == here)
                    filled[++x] = (uint16_t)f.a;
                run += (uint32_t)(x - first + 1);
                f.d = filled_above[x + 1];
                ahead = slopes[f.d - filled_above[x]];
            } else {
                int sign = 1, context = FLAT_MISS, predicted = predict(f);
                if (flat) {
                    rans_fill(&range, run_position, FLAT_RUN, run);
                    in_run = false;
                } else {
                    context = context_of(l, ahead, behind, slopes[f.c - f.a], &sign);
                }
                rans_push(&range, context, here == HOLE ? 0 : 1 + fold(sign * (here - predicted)));
                f.a = here == HOLE ? predicted : here;
            }
            filled[x] = (uint16_t)f.a;
            l = (struct neighbors){here, l.d, l.b, 0};
            f = (struct neighbors){f.a, f.d, filled_above[x], 0};
            behind = ahead;
        }
    }
    if (in_run)
        rans_fill(&range, run_position, FLAT_RUN, run);
    *c->range = range;
}

static enum status store_raw(struct depth_coder *c, const uint16_t *depth, int width, int height, const uint8_t **bytes,
                             size_t *count)
{
    size_t n = (size_t)width * (size_t)height;
    enum status status = depth_coder_grow(&c->out, &c->out_capacity, 5 + 2 * n);
    if (status != OK)
        return status;
    uint8_t *at = put_u16(put_u16(put_u8(c->out, RAW), (uint16_t)width), (uint16_t)height);
    for (size_t i = 0; i < n; i++)
        at = put_u16(at, depth[i]);
    *bytes = c->out;
    *count = 5 + 2 * n;
    return OK;
}

// The header: palette (each depth as its difference from the one before) and symbol frequencies.
static enum status make_head(struct depth_coder *c, int levels, size_t *head_bytes)
{
    size_t most = 3 * (size_t)levels + rans_frequencies_max(c->range);
    enum status status = depth_coder_grow(&c->head, &c->head_capacity, most);
    if (status != OK)
        return status;
    uint8_t *at = c->head;
    for (int i = 1; i < levels; i++)
        at = put_varint(at, (uint32_t)(c->depth_of[i] - c->depth_of[i - 1]));
    at = rans_put_frequencies(c->range, at);
    *head_bytes = (size_t)(at - c->head);
    return OK;
}

enum status depth_encode(struct depth_coder *c, const uint16_t *depth, int width, int height, const uint8_t **bytes,
                         size_t *count)
{
    assert(width > 0 && height > 0 && width <= 16384 && height <= 16384);
    size_t n = (size_t)width * (size_t)height, head_plain, head_packed, bits, words;
    int levels = find_levels(c, depth, n);
    int noise = levels ? 0 : measure_noise(c, depth, width, height);
    struct rows rows;
    enum status status = rows_begin(c, &rows, width);
    if (status == OK)
        status = rans_begin(c->range, n);
    if (status != OK)
        return status;
    encode_pixels(c, &rows, depth, width, height, noise);
    status = rans_finish(c->range, &bits, &words);
    if (status == OK)
        status = make_head(c, levels, &head_plain);
    if (status != OK)
        return status;
    size_t bound = compress_bound(head_plain);
    if (bits + words + bound >= 2 * n)
        return store_raw(c, depth, width, height, bytes, count);
    status = depth_coder_grow(&c->out, &c->out_capacity, HEADER + bound + bits + words);
    if (status == OK)
        status = compress_bytes(c->compressor, 3, c->head, head_plain, c->out + HEADER, &head_packed);
    if (status != OK)
        return status;
    uint8_t *at = put_u16(put_u16(put_u8(c->out, CODED), (uint16_t)width), (uint16_t)height);
    at = put_u32(put_u8(at, (uint8_t)noise), (uint32_t)levels);
    at = put_u32(put_u32(put_u32(at, (uint32_t)head_plain), (uint32_t)head_packed), (uint32_t)bits);
    at += head_packed;
    rans_copy(c->range, at, at + bits);
    *bytes = c->out;
    *count = HEADER + head_packed + bits + words;
    return OK;
}

// ------------------------------------------------------------- decoding

static enum status damaged(void) { return fail(ERR_CORRUPT, "a depth image's code is damaged"); }

static bool read_head(struct depth_coder *c, const uint8_t *at, const uint8_t *end, uint32_t levels)
{
    for (int d = 0; !levels && d < 65536; d++)
        c->depth_of[d] = (uint16_t)d;
    c->depth_of[0] = 0;
    for (uint32_t i = 1, depth = 0, step; i < levels; i++) {
        if (!get_varint(&at, end, &step) || !step || step > 65535 - depth)
            return false;
        depth += step;
        c->depth_of[i] = (uint16_t)depth;
    }
    return rans_get_frequencies(c->range, at, end);
}

// What the header says of the pixels.
struct coded_image {
    int width, height, noise, levels;
};

static bool decode_pixels(struct depth_coder *c, struct rows *r, const struct coded_image *coded, uint16_t *depth)
{
    const int width = coded->width, height = coded->height;
    struct rans_coder range = *c->range; // a local copy, which cannot alias the stores below
    int64_t run = -1;                    // remaining pixels of the run; -1: not read yet
    uint32_t value;
    const int8_t *slopes = make_slopes(c, coded->noise);
    const int most = coded->levels ? coded->levels : 65536;
    for (int y = 0; y < height; y++) {
        rows_next(r, width);
        uint16_t *restrict level = r->level, *restrict filled = r->filled;
        const uint16_t *restrict level_above = r->level_above, *restrict filled_above = r->filled_above;
        struct neighbors l = {level[0], level_above[1], level_above[0], 0};
        struct neighbors f = {filled[0], filled_above[1], filled_above[0], 0};
        int behind = slopes[f.b - f.c], ahead;
        for (int x = 1; x <= width; x++) {
            l.d = level_above[x + 1];
            f.d = filled_above[x + 1];
            ahead = slopes[f.d - f.b];
            int here = l.a;
            bool flat = is_flat(l);
            if (flat && run < 0) {
                if (!rans_pull(&range, FLAT_RUN, &value))
                    return false;
                run = value;
            }
            if (flat && run > 0) {
                const int first = x, last = run < width - x + 1 ? x + (int)run - 1 : width;
                level[x] = (uint16_t)here;
                filled[x] = (uint16_t)f.a;
                while (x < last && level_above[x + 2] == here) {
                    level[++x] = (uint16_t)here;
                    filled[x] = (uint16_t)f.a;
                }
                run -= x - first + 1;
                f.d = filled_above[x + 1];
                ahead = slopes[f.d - filled_above[x]];
            } else {
                if (flat)
                    run = -1;
                int sign = 1, context = flat ? FLAT_MISS : context_of(l, ahead, behind, slopes[f.c - f.a], &sign);
                int predicted = predict(f);
                if (!rans_pull(&range, context, &value))
                    return false;
                here = value ? predicted + sign * unfold(value - 1) : HOLE;
                if (here < 0 || here >= most || (value && here == HOLE))
                    return false;
                f.a = value ? here : predicted;
            }
            level[x] = (uint16_t)here;
            filled[x] = (uint16_t)f.a;
            l = (struct neighbors){here, l.d, l.b, 0};
            f = (struct neighbors){f.a, f.d, filled_above[x], 0};
            behind = ahead;
        }
        for (int x = 0; x < width; x++)
            depth[(size_t)y * (size_t)width + (size_t)x] = c->depth_of[level[x + 1]];
    }
    *c->range = range;
    return run <= 0 && rans_is_done(&range);
}

static enum status decode_coded(struct depth_coder *c, const uint8_t *at, const uint8_t *end, uint16_t *depth,
                                int width, int height)
{
    if (end - at < HEADER - 5)
        return damaged();
    int noise = *at++;
    uint32_t levels = get_u32(&at), head_plain = get_u32(&at), head_packed = get_u32(&at), bits = get_u32(&at);
    size_t left = (size_t)(end - at);
    if (levels > 65536 || head_plain > 3 * (size_t)levels + rans_frequencies_max(c->range) || head_packed > left ||
        bits > left - head_packed)
        return damaged();
    struct rows rows;
    enum status status = depth_coder_grow(&c->head, &c->head_capacity, head_plain + 1);
    if (status == OK)
        status = rows_begin(c, &rows, width);
    if (status == OK)
        status = decompress_bytes(c->compressor, at, head_packed, c->head, head_plain);
    if (status != OK)
        return status;
    const struct coded_image coded = {width, height, noise, (int)levels};
    const uint8_t *bit = at + head_packed, *word = bit + bits;
    if (!read_head(c, c->head, c->head + head_plain, levels) ||
        !rans_start(c->range, bit, bits, word, (size_t)(end - word)) || !decode_pixels(c, &rows, &coded, depth))
        return damaged();
    return OK;
}

enum status depth_decode(struct depth_coder *c, const uint8_t *bytes, size_t count, uint16_t *depth, int width,
                         int height)
{
    assert(width > 0 && height > 0 && width <= 16384 && height <= 16384);
    if (count < 5)
        return damaged();
    size_t n = (size_t)width * (size_t)height;
    const uint8_t *at = bytes + 1, *end = bytes + count;
    int coded_width = get_u16(&at), coded_height = get_u16(&at);
    if (coded_width != width || coded_height != height)
        return fail(ERR_CORRUPT, "a depth image has %d x %d pixels where %d x %d were expected", coded_width,
                    coded_height, width, height);
    if (bytes[0] == CODED)
        return decode_coded(c, at, end, depth, width, height);
    if (bytes[0] != RAW || count != 5 + 2 * n)
        return damaged();
    for (size_t i = 0; i < n; i++)
        depth[i] = get_u16(&at);
    return OK;
}
