// The same prediction and contexts as depth_rows.inl's, but with run lengths of pixels whose four neighbours are equal
// instead of blocks, and with the states taking turns with the numbers. Made to be simple: nothing writes such images.
#include "recording/depth_earlier.h"

#include "recording/little_endian.h"
#include "recording/rans_coder.h"

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

enum status depth_decode_earlier(struct depth_coder *c, int states, const struct depth_code *code,
                                 const struct depth_layout *l, uint16_t *depth)
{
    const size_t pixels = (size_t)l->width + 2, bytes = 4 * pixels * sizeof(int);
    struct earlier_reader in = {.rans = c->rans, .states = states};
    enum status status = depth_coder_grow(&c->rows, &c->rows_capacity, bytes);
    if (status != OK)
        return status;
    if (!start(&in, code))
        return NOTHING;
    int *rows = (int *)(void *)c->rows; // aligned: from realloc
    memset(rows, 0, bytes);
    struct earlier_rows r = {rows, rows + pixels, rows + 2 * pixels, rows + 3 * pixels};
    int64_t run = -1;
    for (int y = 0; y < l->height; y++) {
        next_row(&r, l->width);
        if (!decode_row(&in, &r, l, &run))
            return NOTHING;
        for (int x = 0; x < l->width; x++)
            *depth++ = c->depth_of[r.level[x + 1]];
    }
    return run <= 0 && is_done(&in) ? OK : NOTHING;
}
