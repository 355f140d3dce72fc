// A Kinect-like sensor gives a few hundred distinct depths, so each pixel is replaced by the rank of its depth among
// those of the image (its level), predicted from the levels left, above and above left (the median predictor of
// LOCO-I), and the residual is entropy-coded (rans_coder.h) with a context quantised from the slopes about the pixel.
// Blocks of a row that are all holes or all as predicted are coded as one number.
#include "recording/depth_codec.h"

#include "recording/depth_pixels.h"
#include "recording/little_endian.h"
#include "recording/rans_coder.h"

#include <stdlib.h>
#include <string.h>

// ---------------------------------------------------------------- images of earlier versions

// Decoding of the depth images that earlier versions wrote (methods 1 and 2 of docs/format.md). Internal to the depth
// codec.

enum { DEPTH_EARLIER_CONTEXTS = 73 };

enum { FLAT_MISS = 71, FLAT_RUN = 72 }; // contexts

struct earlier_reader {
    const struct rans_coder *rans; // its tables
    const uint8_t *bit, *bit_end, *word, *word_end;
    uint64_t held_bits;
    int held, states;
    uint32_t state[2]; // [0]: of the next number
};

static bool start(struct earlier_reader *in, const struct depth_code *code)
{
    in->bit = code->bytes;
    in->bit_end = in->word = code->bytes + code->first_count;
    in->word_end = code->bytes + code->count;
    const ptrdiff_t words = in->word_end - in->word;
    if (words < 4 * in->states || words % 2)
        return false;
    for (int i = 0; i < in->states; i++)
        in->state[i] = get_u32(&in->word);
    for (int i = 0; i < in->states; i++)
        if (in->state[i] < RANS_LOW || in->state[i] >= (uint32_t)RANS_LOW << 16)
            return false;
    return true;
}

static bool is_done(const struct earlier_reader *in)
{
    return in->bit == in->bit_end && in->word == in->word_end && !in->held_bits && in->state[0] == RANS_LOW &&
           in->state[in->states - 1] == RANS_LOW;
}

static bool pull_bits(struct earlier_reader *in, uint32_t symbol, uint32_t *number)
{
    const int remaining = (int)(symbol - RANS_PLAIN) / 2 + 2;
    for (; in->held < remaining; in->held += 8) {
        if (in->bit == in->bit_end)
            return false;
        in->held_bits |= (uint64_t)*in->bit++ << in->held;
    }
    *number = (2 + (symbol & 1)) << remaining | (uint32_t)(in->held_bits & ((UINT64_C(1) << remaining) - 1));
    in->held_bits >>= remaining;
    in->held -= remaining;
    return true;
}

static bool pull(struct earlier_reader *in, int context, uint32_t *number)
{
    uint32_t state = in->state[0];
    const uint32_t slot = state & (RANS_SUM - 1);
    const struct rans_share *share = in->rans->context[context].shares;
    *number = 0;
    while (slot >= share[1].start) {
        share++;
        ++*number;
    }
    state = share->frequency * (state >> RANS_BITS) + slot - share->start;
    if (state < RANS_LOW) {
        if (in->word == in->word_end)
            return false;
        state = state << 16 | get_u16(&in->word);
    }
    in->state[0] = in->states > 1 ? in->state[1] : state;
    in->state[in->states - 1] = state;
    return *number < RANS_PLAIN || pull_bits(in, *number, number);
}

// Rows of width + 2 pixels, the first left of the image.
struct earlier_rows {
    int *level, *filled, *level_above, *filled_above;
};

static int slope_of(int difference, int noise)
{
    const int edge = 3 * noise + 1;
    return (difference > noise) + (difference > edge) - (difference < -noise) - (difference < -edge);
}

static void set_pixel(struct earlier_rows *rows, int x, int level, int fill)
{
    rows->level[x] = level;
    rows->filled[x] = fill;
}

// run: the remaining pixels of a run; -1: not read yet
static bool decode_row(struct earlier_reader *in, struct earlier_rows *rows, const struct depth_layout *layout,
                       int64_t *run)
{
    const int max = layout->levels ? layout->levels : 65536;
    for (int x = 1; x <= layout->width; x++) {
        const int *above = rows->level_above + x, *fills = rows->filled_above + x;
        const int left = rows->level[x - 1], fill = rows->filled[x - 1];
        int context = FLAT_MISS, sign = 1;
        uint32_t number;
        if (left == above[0] && left == above[-1] && left == above[1]) {
            if (*run < 0) {
                if (!pull(in, FLAT_RUN, &number))
                    return false;
                *run = number;
            }
            if ((*run)-- > 0) {
                set_pixel(rows, x, left, fill);
                continue;
            }
        } else {
            const int holes = (left == HOLE) + 2 * (above[0] == HOLE) + 4 * (above[1] == HOLE);
            const int index = 25 * slope_of(fills[1] - fills[0], layout->noise) +
                              5 * slope_of(fills[0] - fills[-1], layout->noise) +
                              slope_of(fills[-1] - fill, layout->noise);
            sign = index < 0 && !holes ? -1 : 1;
            context = holes ? HOLE_CONTEXTS + holes : sign * index;
        }
        const int predicted = (int)depth_predict(fill, fills[0], fills[-1]);
        if (!pull(in, context, &number))
            return false;
        const int m = (int)number - 1, level = number ? predicted + sign * (m % 2 ? -(m + 1) / 2 : m / 2) : HOLE;
        if (level < 0 || level >= max || (number && level == HOLE))
            return false;
        set_pixel(rows, x, level, number ? level : predicted);
    }
    return true;
}

static void next_row(struct earlier_rows *rows, int width)
{
    const struct earlier_rows old = *rows;
    *rows = (struct earlier_rows){old.level_above, old.filled_above, old.level, old.filled};
    rows->level[0] = rows->level_above[0] = rows->level_above[1];
    rows->filled[0] = rows->filled_above[0] = rows->filled_above[1];
    rows->level_above[width + 1] = rows->level_above[width];
    rows->filled_above[width + 1] = rows->filled_above[width];
}

// The head has been read into c->rans and c->depth_of; the code's first part are the uncoded bits. states: 1 or 2.
// NOTHING: the code is damaged. ERR_MEMORY.
static enum status depth_decode_earlier(struct depth_coder *coder, int states, const struct depth_code *code,
                                        const struct depth_layout *layout, uint16_t *depth)
{
    const size_t pixels = (size_t)layout->width + 2, bytes = 4 * pixels * sizeof(int);
    struct earlier_reader in = {.rans = coder->rans, .states = states};
    enum status status = depth_coder_grow(&coder->rows, &coder->rows_capacity, bytes);
    if (status != OK)
        return status;
    if (!start(&in, code))
        return NOTHING;
    int *rows = (int *)(void *)coder->rows; // aligned: from realloc
    memset(rows, 0, bytes);
    struct earlier_rows r = {rows, rows + pixels, rows + 2 * pixels, rows + 3 * pixels};
    int64_t run = -1;
    for (int y = 0; y < layout->height; y++) {
        next_row(&r, layout->width);
        if (!decode_row(&in, &r, layout, &run))
            return NOTHING;
        for (int x = 0; x < layout->width; x++)
            *depth++ = coder->depth_of[r.level[x + 1]];
    }
    return run <= 0 && is_done(&in) ? OK : NOTHING;
}

// ---------------------------------------------------------------- depth images

enum status depth_coder_open(struct depth_coder **out)
{
    struct depth_coder *c = calloc(1, sizeof *c);
    *out = NULL;
    if (!c)
        return fail(ERR_MEMORY, "no memory for the depth coder");
    c->slopes_noise = -1;
    enum status status = compressor_open(&c->compressor);
    if (status == OK)
        status = rans_open(&c->rans, DEPTH_CONTEXTS);
    if (status == OK)
        *out = c;
    else
        depth_coder_close(&c);
    return status;
}

void depth_coder_close(struct depth_coder **coder)
{
    if (!*coder)
        return;
    compressor_close(&(*coder)->compressor);
    rans_close(&(*coder)->rans);
    free((*coder)->out);
    free((*coder)->head);
    free((*coder)->rows);
    free(*coder);
    *coder = NULL;
}

// ------------------------------------------------------------- levels

// Finds the distinct depths. Returns the number of levels (level 0 is always depth 0), or 0 if a level is the depth
// itself, because the sensor uses nearly all values.
static int find_levels(struct depth_coder *coder, const uint16_t *depth, size_t n, int *largest)
{
    enum { AHEAD = 1024 }; // pixels that are fetched from memory before their turn; chosen by hand
    int levels = 1;
    size_t i = 0;
    memset(coder->seen, 0, sizeof coder->seen);
    for (uint64_t four; i + 4 <= n; i += 4) { // the image is seldom in a near cache, and this is its first use
        memcpy(&four, depth + i, sizeof four);
        __builtin_prefetch(depth + i + AHEAD);
        coder->seen[four & UINT16_MAX] = coder->seen[four >> 16 & UINT16_MAX] = 1;
        coder->seen[four >> 32 & UINT16_MAX] = coder->seen[four >> 48] = 1;
    }
    for (; i < n; i++)
        coder->seen[depth[i]] = 1;
    coder->level_of[0] = HOLE;
    coder->depth_of[0] = 0;
    *largest = 0;
    for (int eight = 0; eight < 65536; eight += 8) {
        uint64_t any;
        memcpy(&any, coder->seen + eight, sizeof any);
        for (int d = eight; any && d < eight + 8; d++)
            if (coder->seen[d] && d) {
                coder->level_of[d] = (uint16_t)levels;
                coder->depth_of[levels++] = (uint16_t)d;
                *largest = d;
            }
    }
    if (4 * levels <= *largest)
        return levels;
    for (int d = 0; d <= *largest; d++)
        coder->level_of[d] = coder->depth_of[d] = (uint16_t)d;
    return 0;
}

// The slope between neighbours, in levels, up to which it is taken for noise: half the mean step between neighbours.
static int measure_noise(struct depth_coder *coder, const uint16_t *depth, int width, int height)
{
    enum { EDGE = 64 }; // larger steps are edges; chosen by hand
    int64_t sum = 0, count = 0;
    for (int y = 0; y < height; y += 4) {
        const uint16_t *row = depth + (size_t)y * (size_t)width;
        for (int x = 1; x < width; x++) {
            int step = abs(coder->level_of[row[x]] - coder->level_of[row[x - 1]]);
            if (row[x] && row[x - 1] && step < EDGE) {
                sum += step;
                count++;
            }
        }
    }
    return count ? (int)(sum / (2 * count)) : 0;
}

// ------------------------------------------------------------- encoding

static enum status store_raw(struct depth_coder *coder, const uint16_t *depth, int width, int height,
                             const uint8_t **bytes, size_t *count)
{
    size_t n = (size_t)width * (size_t)height;
    enum status status = depth_coder_grow(&coder->out, &coder->out_capacity, 5 + 2 * n);
    if (status != OK)
        return status;
    uint8_t *at = put_u16(put_u16(put_u8(coder->out, DEPTH_RAW), (uint16_t)width), (uint16_t)height);
    for (size_t i = 0; i < n; i++)
        at = put_u16(at, depth[i]);
    *bytes = coder->out;
    *count = 5 + 2 * n;
    return OK;
}

// The header: palette (each depth as its difference from the one before) and symbol frequencies.
static enum status make_head(struct depth_coder *coder, int levels, size_t *head_bytes)
{
    size_t max = 3 * (size_t)levels + rans_frequencies_max(DEPTH_CONTEXTS);
    enum status status = depth_coder_grow(&coder->head, &coder->head_capacity, max);
    if (status != OK)
        return status;
    uint8_t *at = coder->head;
    for (int i = 1; i < levels; i++)
        at = put_varint(at, (uint32_t)(coder->depth_of[i] - coder->depth_of[i - 1]));
    at = rans_put_frequencies(coder->rans, at);
    *head_bytes = (size_t)(at - coder->head);
    return OK;
}

enum status depth_encode(struct depth_coder *coder, const uint16_t *depth, int width, int height, const uint8_t **bytes,
                         size_t *count)
{
    assert(width > 0 && height > 0 && width <= 16384 && height <= 16384);
    size_t n = (size_t)width * (size_t)height, head_plain, head_packed, words[RANS_STREAMS];
    int largest, levels = find_levels(coder, depth, n, &largest);
    int noise = levels ? 0 : measure_noise(coder, depth, width, height);
    const struct depth_layout layout = {width, height, noise, levels};
    enum status status = rans_begin(coder->rans, (size_t)(height + 1) / 2 * depth_row_numbers(width));
    if (status == OK)
        status = (levels ? levels : largest + 1) <= DEPTH_NARROW_LEVELS ? depth_encode_narrow(coder, depth, &layout)
                                                                        : depth_encode_wide(coder, depth, &layout);
    if (status == OK)
        status = rans_finish(coder->rans, words);
    if (status == OK)
        status = make_head(coder, levels, &head_plain);
    if (status != OK)
        return status;
    size_t bound = compress_bound(head_plain);
    if (words[0] + words[1] + bound >= 2 * n)
        return store_raw(coder, depth, width, height, bytes, count);
    status = depth_coder_grow(&coder->out, &coder->out_capacity, DEPTH_HEADER + bound + words[0] + words[1]);
    if (status == OK)
        status = compress_bytes(coder->compressor, 3, coder->head, head_plain, coder->out + DEPTH_HEADER, &head_packed);
    if (status != OK)
        return status;
    uint8_t *at = put_u16(put_u16(put_u8(coder->out, DEPTH_BLOCKS), (uint16_t)width), (uint16_t)height);
    at = put_u32(put_u8(at, (uint8_t)noise), (uint32_t)levels);
    at = put_u32(put_u32(put_u32(at, (uint32_t)head_plain), (uint32_t)head_packed), (uint32_t)words[0]);
    rans_copy(coder->rans, at + head_packed);
    *bytes = coder->out;
    *count = DEPTH_HEADER + head_packed + words[0] + words[1];
    return OK;
}

// ------------------------------------------------------------- decoding

static enum status damaged(void) { return fail(ERR_CORRUPT, "a depth image's code is damaged"); }

static bool read_head(struct depth_coder *coder, int contexts, const uint8_t *at, const uint8_t *end, uint32_t levels)
{
    for (int d = 0; !levels && d < 65536; d++)
        coder->depth_of[d] = (uint16_t)d;
    coder->depth_of[0] = 0;
    for (uint32_t i = 1, depth = 0, step; i < levels; i++) {
        if (!get_varint(&at, end, &step) || !step || step > 65535 - depth)
            return false;
        depth += step;
        coder->depth_of[i] = (uint16_t)depth;
    }
    return rans_get_frequencies(coder->rans, contexts, at, end);
}

static enum status decode_pixels(struct depth_coder *coder, int method, const struct depth_code *code,
                                 const struct depth_layout *layout, uint16_t *depth)
{
    if (method != DEPTH_BLOCKS)
        return depth_decode_earlier(coder, method == DEPTH_ONE_STATE ? 1 : 2, code, layout, depth);
    const size_t streams[RANS_STREAMS] = {code->first_count, code->count - code->first_count};
    enum status status =
        rans_start(coder->rans, code->bytes, streams, RANS_NUMBER_BYTES * depth_row_numbers(layout->width));
    if (status != OK)
        return status;
    return layout->levels && layout->levels <= DEPTH_NARROW_LEVELS ? depth_decode_narrow(coder, layout, depth)
                                                                   : depth_decode_wide(coder, layout, depth);
}

// Behind the method and the size.
static enum status decode_coded(struct depth_coder *coder, int method, const uint8_t *at, const uint8_t *end,
                                const struct depth_size *size, uint16_t *depth)
{
    if (end - at < DEPTH_HEADER - 5)
        return damaged();
    const int noise = *at++, contexts = method == DEPTH_BLOCKS ? DEPTH_CONTEXTS : DEPTH_EARLIER_CONTEXTS;
    uint32_t levels = get_u32(&at), head_plain = get_u32(&at), head_packed = get_u32(&at), first = get_u32(&at);
    size_t left = (size_t)(end - at);
    if (levels > 65536 || head_plain > 3 * (size_t)levels + rans_frequencies_max(contexts) || head_packed > left ||
        first > left - head_packed)
        return damaged();
    enum status status = depth_coder_grow(&coder->head, &coder->head_capacity, head_plain + 1);
    if (status == OK)
        status = decompress_bytes(coder->compressor, at, head_packed, coder->head, head_plain);
    if (status != OK)
        return status;
    if (!read_head(coder, contexts, coder->head, coder->head + head_plain, levels))
        return damaged();
    const struct depth_code code = {at + head_packed, left - head_packed, first};
    status = decode_pixels(coder, method, &code, &(struct depth_layout){size->width, size->height, noise, (int)levels},
                           depth);
    return status == NOTHING ? damaged() : status;
}

enum status depth_decode(struct depth_coder *coder, const uint8_t *bytes, size_t count, uint16_t *depth, int width,
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
    if (bytes[0] > DEPTH_RAW && bytes[0] <= DEPTH_BLOCKS)
        return decode_coded(coder, bytes[0], at, end, &(struct depth_size){width, height}, depth);
    if (bytes[0] != DEPTH_RAW || count != 5 + 2 * n)
        return damaged();
    for (size_t i = 0; i < n; i++)
        depth[i] = get_u16(&at);
    return OK;
}

// ---------------------------------------------------------------- masks

// The mask codec: each pixel is compared with the one above it; the lengths of alternating runs of equal and different
// pixels are stored as varints and compressed with zstd.

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

enum status mask_encode(struct depth_coder *coder, const uint8_t *mask, int width, int height, const uint8_t **bytes,
                        size_t *count)
{
    assert(width > 0 && height > 0 && width <= 16384 && height <= 16384);
    size_t n = (size_t)width * (size_t)height, used = 0, packed;
    bool differs = false;
    for (size_t from = 0; from < n; differs = !differs) {
        // The buffer doubles, so that a simple mask does not cost the memory of the worst one.
        if (coder->head_capacity < used + 5) {
            enum status status = depth_coder_grow(&coder->head, &coder->head_capacity, 2 * used + 4096);
            if (status != OK)
                return status;
        }
        size_t end = run_end(mask, from, n, (size_t)width, differs);
        used = (size_t)(put_varint(coder->head + used, (uint32_t)(end - from)) - coder->head);
        from = end;
    }
    size_t bound = compress_bound(used);
    enum status status = depth_coder_grow(&coder->out, &coder->out_capacity, HEADER + bound);
    if (status == OK)
        status = compress_bytes(coder->compressor, 3, coder->head, used, coder->out + HEADER, &packed);
    if (status != OK)
        return status;
    put_u32(put_u16(put_u16(put_u8(coder->out, VERSION), (uint16_t)width), (uint16_t)height), (uint32_t)used);
    *bytes = coder->out;
    *count = HEADER + packed;
    return OK;
}

enum status mask_decode(struct depth_coder *coder, const uint8_t *bytes, size_t count, uint8_t *mask, int width,
                        int height)
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
    enum status status = depth_coder_grow(&coder->head, &coder->head_capacity, used + (size_t)1);
    if (status == OK)
        status = decompress_bytes(coder->compressor, at, count - HEADER, coder->head, used);
    if (status != OK)
        return status;
    const uint8_t *end = coder->head + used;
    at = coder->head;
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
