// The neighbourhood of a depth image's pixels; LEVEL is the type of a level. The neighbours of a pixel: a left of it,
// c b d above it from left to right (LOCO-I's names). A pixel has a level and a fill: the level or, for a hole, what
// was predicted. Whole vectors of pixels are computed together; rows are padded, so that the last vector may go beyond
// them.
#include "recording/rans_coder.h"

#include <stdlib.h>
#include <string.h>

enum { VECTOR_BYTES = 16, LANES = VECTOR_BYTES / (int)sizeof(LEVEL), BLOCK = DEPTH_BLOCK, PAD = 2 * BLOCK };
enum { WIDEST = 16384, ROW = WIDEST + 2 + PAD, BLOCKS_MAX = WIDEST / BLOCK };

typedef LEVEL lanes __attribute__((vector_size(VECTOR_BYTES))); // comparisons give all bits of a lane, or none

static inline lanes load(const LEVEL *from)
{
    lanes v;
    memcpy(&v, from, sizeof v);
    return v;
}
static inline void store(LEVEL *to, lanes v) { memcpy(to, &v, sizeof v); }

static inline lanes select_lanes(lanes where, lanes one, lanes other) { return (one & where) | (other & ~where); }

static inline bool all_bits(lanes v)
{
    uint64_t half[2];
    memcpy(half, &v, sizeof half);
    return (half[0] & half[1]) == UINT64_MAX;
}
static inline bool no_bits(lanes v)
{
    uint64_t half[2];
    memcpy(half, &v, sizeof half);
    return !(half[0] | half[1]);
}

static inline bool all_are(const LEVEL *values, int count, LEVEL value)
{
    if (count == BLOCK) {
        lanes same = load(values) == value;
        for (int i = LANES; i < BLOCK; i += LANES)
            same &= load(values + i) == value;
        return all_bits(same);
    }
    for (int i = 0; i < count; i++)
        if (values[i] != value)
            return false;
    return true;
}

static inline void fill_all(LEVEL *values, LEVEL value) // a whole block
{
    for (int i = 0; i < BLOCK; i += LANES)
        store(values + i, (lanes){0} + value);
}

// [0] is left of the image, [width + 1] right of it. Arrays of fixed size, so that one register addresses all of them.
struct row {
    LEVEL level[ROW], filled[ROW];
    LEVEL index[ROW];              // decoding: of each pixel the part of its context's index that the row above gives
    uint8_t kind[BLOCKS_MAX + 1]; // enum block_kind; BLOCK_CODED behind the last
};

// The latest rows, row y in [y % ROWS]. Above the first row is a row of holes.
enum { ROWS = 4 };

static inline struct row *row_at(struct row *rows, int y) { return rows + ((unsigned)y % ROWS); }

// *out belongs to the coder.
static enum status rows_begin(struct depth_coder *coder, struct row **out, int width)
{
    enum status status = depth_coder_grow(&coder->rows, &coder->rows_capacity, ROWS * sizeof **out);
    if (status != OK)
        return status;
    struct row *rows = *out = (struct row *)(void *)coder->rows; // aligned: from realloc
    const size_t used = ((size_t)width + 2 + PAD) * sizeof(LEVEL);
    for (int i = 0; i < ROWS; i++) {
        memset(rows[i].level, 0, used);
        memset(rows[i].filled, 0, used);
        memset(rows[i].kind, BLOCK_CODED, sizeof rows[i].kind);
    }
    return OK;
}

// The left neighbours of a row's first pixel.
static inline void set_left(struct row *row, struct row *above)
{
    row->level[0] = above->level[0] = above->level[1];
    row->filled[0] = above->filled[0] = above->filled[1];
}

// The neighbour above right of the next row's last pixel.
static inline void set_right(struct row *row, int width)
{
    row->level[width + 1] = row->level[width];
    row->filled[width + 1] = row->filled[width];
}

static inline int kind_context(const struct row *row, const struct row *above, int block)
{
    const int left = block ? row->kind[block - 1] : BLOCK_CODED;
    return BLOCK_CONTEXTS + (left * BLOCK_KINDS + above->kind[block]) * BLOCK_KINDS + above->kind[block + 1];
}

// The quantised slopes of differences of two fills, -2 .. 2: 0 up to `noise`, 1 up to 3 noise + 1.
static inline lanes slopes_of(lanes difference, LEVEL noise)
{
    const LEVEL edge = (LEVEL)(3 * noise + 1), below = (LEVEL)-noise, far_below = (LEVEL)-edge;
    return (difference < below) + (difference < far_below) - (difference > noise) - (difference > edge);
}

static inline lanes slopes_above(const struct row *above, int x, LEVEL noise)
{
    const lanes b = load(above->filled + x);
    return 25 * slopes_of(load(above->filled + x + 1) - b, noise) +
           5 * slopes_of(b - load(above->filled + x - 1), noise);
}

static inline lanes holes_above(const struct row *above, int x)
{
    return ((load(above->level + x) == HOLE) & 2) | ((load(above->level + x + 1) == HOLE) & 4);
}

static inline int unfold(uint32_t folded) { return (int)(folded >> 1) ^ -(int)(folded & 1); }
