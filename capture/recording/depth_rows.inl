// The neighbourhood of a depth image's pixels; LEVEL is the type of a level. The neighbours of a pixel: a left of it,
// c b d above it from left to right (LOCO-I's names). A pixel has a level and a fill: the level or, for a hole, what
// was predicted. Whole vectors of pixels are computed together; rows are padded, so that the last vector may go beyond
// them.
#include "capture/recording/rans_coder.h"

#include <string.h>

enum { VECTOR_BYTES = 16, LANES = VECTOR_BYTES / (int)sizeof(LEVEL), BLOCK = 16, PAD = 2 * BLOCK };
enum { ROW = 16384 + 2 + PAD }; // the widest image's

typedef LEVEL lanes __attribute__((vector_size(VECTOR_BYTES))); // comparisons give all bits of a lane, or none

static inline lanes load(const LEVEL *from)
{
    lanes v;
    memcpy(&v, from, sizeof v);
    return v;
}
static inline void store(LEVEL *to, lanes v) { memcpy(to, &v, sizeof v); }

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

// The current row and the one above. [0] is left of the image, [width + 1] right of it. Above the first row is a row of
// holes. Arrays of fixed size, so that one register addresses all of them.
struct rows {
    LEVEL level[ROW], filled[ROW], level_above[ROW], filled_above[ROW];
    // For decoding, of each pixel, from the row above:
    LEVEL slopes[ROW]; // 25 slope(d - b) + 5 slope(b - c) of the fills
    LEVEL holes[ROW];  // bits 1 and 2: b and d are holes
    LEVEL even[ROW];   // all bits: the levels of b, c and d are equal
    LEVEL noise;
};

// *out belongs to the coder.
static enum status rows_begin(struct depth_coder *c, struct rows **out, const struct depth_layout *l)
{
    enum status status = depth_coder_grow(&c->rows, &c->rows_capacity, sizeof **out);
    if (status != OK)
        return status;
    struct rows *r = *out = (struct rows *)(void *)c->rows; // aligned: from realloc
    const size_t used = ((size_t)l->width + 2 + PAD) * sizeof(LEVEL);
    memset(r->level, 0, used);
    memset(r->filled, 0, used);
    memset(r->level_above, 0, used);
    memset(r->filled_above, 0, used);
    r->noise = (LEVEL)l->noise;
    return OK;
}

// The current row becomes the one above.
static void rows_next(struct rows *r, int width)
{
    const size_t bytes = (size_t)width * sizeof(LEVEL);
    memcpy(r->level_above + 1, r->level + 1, bytes);
    memcpy(r->filled_above + 1, r->filled + 1, bytes);
    r->level[0] = r->level_above[0] = r->level_above[1];
    r->filled[0] = r->filled_above[0] = r->filled_above[1];
    r->level_above[width + 1] = r->level_above[width];
    r->filled_above[width + 1] = r->filled_above[width];
}

// The quantised slopes of differences of two fills, -2 .. 2: 0 up to `noise`, 1 up to 3 noise + 1.
static inline lanes slopes_of(lanes difference, LEVEL noise)
{
    const LEVEL edge = (LEVEL)(3 * noise + 1), below = (LEVEL)-noise, far_below = (LEVEL)-edge;
    return (difference < below) + (difference < far_below) - (difference > noise) - (difference > edge);
}

static inline int slope_of(int difference, int noise)
{
    const int edge = 3 * noise + 1;
    return (difference > noise) + (difference > edge) - (difference < -noise) - (difference < -edge);
}

static inline lanes even_at(const struct rows *r, int x)
{
    const lanes b = load(r->level_above + x);
    return (b == load(r->level_above + x - 1)) & (b == load(r->level_above + x + 1));
}

static inline lanes slopes_above(const struct rows *r, int x)
{
    const lanes b = load(r->filled_above + x);
    return 25 * slopes_of(load(r->filled_above + x + 1) - b, r->noise) +
           5 * slopes_of(b - load(r->filled_above + x - 1), r->noise);
}

static inline lanes holes_above(const struct rows *r, int x)
{
    return ((load(r->level_above + x) == HOLE) & 2) | ((load(r->level_above + x + 1) == HOLE) & 4);
}

static inline int predict(int a, int b, int c)
{
    const int low = a < b ? a : b, high = a < b ? b : a, plane = a + b - c;
    return plane < low ? low : plane > high ? high : plane;
}

static inline uint32_t fold(int residual) // 0, -1, 1, -2, 2 ... become 0, 1, 2, 3, 4 ...
{
    return ((uint32_t)residual << 1) ^ (uint32_t) - (residual < 0);
}

static inline int unfold(uint32_t folded) { return (int)(folded >> 1) ^ -(int)(folded & 1); }
