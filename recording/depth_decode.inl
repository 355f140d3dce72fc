// Decoding of a depth image's pixels. Two rows are decoded together, the lower one at least LAG blocks behind the upper
// one, on which it depends: what one pixel waits for is then done beside the other's.

enum { LAG = 2 };

// A pixel's context is looked up by an index, the sum of one from the row above and one from the pixel to the left: of
// slopes 0..124; of holes above 125 + 5 (their bits / 2 - 1) + 0..4; behind a hole LEFT_HOLE more. The left pixel gives
// its slope + 2.
enum { INDEX_STRAIGHT = 60, INDEX_HOLES = 120, LEFT_HOLE = 140, INDICES = 2 * LEFT_HOLE };

// Where the decoding of a stream has come to: the even or the odd rows.
struct cursor {
    struct rans_reader reader;
    struct row *row, *above;
    int y, block; // the next
    bool knows;   // the block's kind has been decoded
};

struct pixel_decoder {
    struct row *rows;
    struct cursor cursor[RANS_STREAMS];
    const struct rans_context *contexts, *context_of[INDICES];
    uint8_t mirrored[INDICES];         // of each context: 0, or RANS_PLAIN if residuals are negated
    int8_t residual[2 * RANS_PLAIN];   // of the numbers that are symbols; mirrored
    const uint8_t *slopes[2];          // of a difference of fills, behind a pixel or a hole
    int width, height, levels, blocks; // blocks: of a row
    LEVEL noise;
    bool damaged;
};

static void set_context(struct pixel_decoder *decoder, int index)
{
    const int left = index >= LEFT_HOLE, within = index - left * LEFT_HOLE, slopes = within - INDEX_STRAIGHT - 2;
    const int above = within < 125 ? 0 : (within - INDEX_HOLES) / 5; // holes
    const bool straight = !left && !above;
    decoder->context_of[index] = decoder->contexts + (straight ? abs(slopes) : HOLE_CONTEXTS + left + 2 * above);
    decoder->mirrored[index] = straight && slopes < 0 ? RANS_PLAIN : 0;
}

static int residual_of(uint32_t number, bool mirrored)
{
    const int residual = unfold(number - 1);
    return mirrored ? -residual : residual;
}

// Of each difference of fills, -DIFFERENCE_MAX and up, its slope (depth_rows.inl's slopes_of) + 2.
enum { DIFFERENCE_MAX = UINT16_MAX };
static void set_slopes(struct depth_coder *coder, int noise)
{
    const int edge = 3 * noise + 1, ends[] = {-edge - 1, -noise - 1, noise, edge, DIFFERENCE_MAX}; // of slopes -2 .. 2
    for (int hole = 0; hole < 2; hole++)
        for (int slope = 0, from = -DIFFERENCE_MAX; slope < 5; from = ends[slope++] + 1)
            memset(coder->slopes[hole] + DIFFERENCE_MAX + from, slope + hole * LEFT_HOLE, (size_t)(ends[slope] + 1 - from));
    coder->slopes_noise = noise;
}

static void decoder_begin(struct pixel_decoder *decoder, struct depth_coder *coder)
{
    decoder->contexts = coder->rans->context;
    for (uint32_t n = 1; n < RANS_PLAIN; n++)
        for (int mirrored = 0; mirrored < 2; mirrored++)
            decoder->residual[mirrored * RANS_PLAIN + (int)n] = (int8_t)residual_of(n, mirrored);
    for (int i = 0; i < INDICES; i++)
        set_context(decoder, i);
    if (coder->slopes_noise != decoder->noise)
        set_slopes(coder, decoder->noise);
    for (int hole = 0; hole < 2; hole++)
        decoder->slopes[hole] = coder->slopes[hole] + DIFFERENCE_MAX;
}

struct left_pixel {
    ptrdiff_t fill; // as wide as an address: it is part of an index
    const uint8_t *slopes;
};

static inline __attribute__((always_inline)) void decode_pixel(const struct pixel_decoder *decoder, struct row *row,
                                                               const struct row *above, ptrdiff_t x,
                                                               struct rans_reader *from, struct left_pixel *left)
{
    const ptrdiff_t b = above->filled[x], c = above->filled[x - 1];
    const size_t index = (unsigned)row->index[x] + left->slopes[c - left->fill];
    const ptrdiff_t predicted = depth_predict(left->fill, b, c);
    const struct rans_context *context = decoder->context_of[index];
    size_t symbol = rans_look(context, from);
    LEVEL level;
    if (symbol - 1 < RANS_PLAIN - 1) { // by far the most
        rans_take(context, from, symbol);
        left->fill = (predicted + decoder->residual[decoder->mirrored[index] + symbol]) & LEVEL_MASK;
        left->slopes = decoder->slopes[0];
        level = (LEVEL)left->fill;
    } else {
        if (symbol >= RANS_SYMBOLS)
            symbol = rans_search(context, from);
        rans_take(context, from, symbol);
        const uint32_t number = symbol < RANS_PLAIN ? (uint32_t)symbol : rans_pull_large(from, (uint32_t)symbol);
        left->fill = symbol ? (predicted + residual_of(number, decoder->mirrored[index])) & LEVEL_MASK : predicted;
        left->slopes = decoder->slopes[!symbol];
        level = symbol ? (LEVEL)left->fill : HOLE;
    }
    row->level[x] = level;
    row->filled[x] = (LEVEL)left->fill;
}

static inline struct left_pixel left_of(const struct pixel_decoder *decoder, const struct row *row, int x)
{
    return (struct left_pixel){row->filled[x - 1], decoder->slopes[row->level[x - 1] == HOLE]};
}

static inline void look_above(const struct pixel_decoder *decoder, struct row *row, const struct row *above, int x)
{
    for (const int end = x + BLOCK; x < end; x += LANES) {
        const lanes holes = holes_above(above, x); // 2 or 4 or both
        const lanes straight = slopes_above(above, x, decoder->noise) + INDEX_STRAIGHT;
        store(row->index + x, select_lanes(holes == 0, straight, holes + holes + (holes >> 1) + INDEX_HOLES));
    }
}

// All pixels of a block are as predicted.
static void predict_block(struct row *row, const struct row *above, int x, int count)
{
    LEVEL fill = row->filled[x - 1];
    if (above->filled[x - 1] == fill && all_are(above->filled + x, BLOCK, fill)) {
        fill_all(row->filled + x, fill);
        fill_all(row->level + x, fill);
        return;
    }
    for (const int end = x + count; x < end; x++) {
        fill = (LEVEL)depth_predict(fill, above->filled[x], above->filled[x - 1]);
        row->level[x] = row->filled[x] = fill;
    }
}

// The cursor's next block.
static void decode_block(const struct pixel_decoder *decoder, struct cursor *at)
{
    struct row *row = at->row;
    const int x = 1 + at->block * BLOCK, count = decoder->width - x + 1 < BLOCK ? decoder->width - x + 1 : BLOCK;
    const enum block_kind kind = row->kind[at->block++];
    at->knows = false;
    if (kind == BLOCK_CODED) {
        struct rans_reader from = at->reader;
        struct left_pixel left = left_of(decoder, row, x);
        look_above(decoder, row, at->above, x);
        for (int i = 0; i < count; i++)
            decode_pixel(decoder, row, at->above, x + i, &from, &left);
        at->reader = from;
    } else if (kind == BLOCK_PREDICTED) {
        predict_block(row, at->above, x, count);
    } else {
        fill_all(row->filled + x, row->filled[x - 1]);
        fill_all(row->level + x, HOLE);
    }
}

static inline __attribute__((always_inline)) void decode_kind(struct pixel_decoder *decoder, struct cursor *at,
                                                              struct rans_reader *from)
{
    const size_t kind = rans_pull_symbol(&decoder->contexts[kind_context(at->row, at->above, at->block)], from);
    decoder->damaged |= kind >= BLOCK_KINDS;
    at->row->kind[at->block] = kind < BLOCK_KINDS ? (uint8_t)kind : BLOCK_CODED;
    at->knows = true;
}

// The next blocks of both cursors, which are whole and coded; and what kinds those after them are.
static void decode_two_blocks(struct pixel_decoder *decoder)
{
    struct cursor *cursor = &decoder->cursor[0], *b = &decoder->cursor[1];
    struct rans_reader from_a = cursor->reader, from_b = b->reader;
    struct row *row_a = cursor->row, *row_b = b->row;
    const struct row *above_a = cursor->above, *above_b = b->above;
    const int x_a = 1 + cursor->block++ * BLOCK, x_b = 1 + b->block++ * BLOCK;
    struct left_pixel left_a = left_of(decoder, row_a, x_a), left_b = left_of(decoder, row_b, x_b);
    look_above(decoder, row_a, above_a, x_a);
    look_above(decoder, row_b, above_b, x_b);
    for (int i = 0; i < BLOCK; i++) {
        decode_pixel(decoder, row_a, above_a, x_a + i, &from_a, &left_a);
        decode_pixel(decoder, row_b, above_b, x_b + i, &from_b, &left_b);
    }
    cursor->knows = b->knows = false;
    if (cursor->block < decoder->blocks)
        decode_kind(decoder, cursor, &from_a);
    if (b->block < decoder->blocks)
        decode_kind(decoder, b, &from_b);
    cursor->reader = from_a;
    b->reader = from_b;
}

// One that is no level comes from a damaged code.
static bool are_levels(const struct row *row, int width, int levels)
{
    const lanes largest = (lanes){0} + (LEVEL)(levels - 1);
    lanes beyond = {0};
    int x = 1;
    for (; x + LANES <= width + 1; x += LANES)
        beyond |= load(row->level + x) > largest;
    for (; x <= width; x++)
        beyond |= (lanes){0} + row->level[x] > largest;
    return no_bits(beyond);
}

static void begin_row(struct pixel_decoder *decoder, struct cursor *at, int y)
{
    at->y = y;
    at->block = 0;
    at->knows = false;
    at->row = row_at(decoder->rows, y);
    at->above = row_at(decoder->rows, y - 1);
}

static void end_row(struct pixel_decoder *decoder, struct cursor *at, const uint16_t *depth_of, uint16_t *depth)
{
    set_right(at->row, decoder->width);
    decoder->damaged |= !are_levels(at->row, decoder->width, decoder->levels) || !rans_is_within(&at->reader);
    depth += (ptrdiff_t)at->y * decoder->width;
    const LEVEL *level = at->row->level + 1;
#pragma GCC unroll 8
    for (int x = 0; x < decoder->width; x++)
        depth[x] = depth_of[level[x]];
    begin_row(decoder, at, at->y + RANS_STREAMS);
}

// Whether the row above, in which `other` may be, has come far enough for the next block. Makes that known.
static inline bool is_ready(struct pixel_decoder *decoder, struct cursor *at, const struct cursor *other)
{
    if (at->y >= decoder->height || (other->y < at->y && other->block < at->block + LAG))
        return false;
    if (at->block == 0)
        set_left(at->row, at->above);
    if (!at->knows)
        decode_kind(decoder, at, &at->reader);
    return true;
}

static inline bool is_coded(const struct pixel_decoder *decoder, const struct cursor *at)
{
    return at->row->kind[at->block] == BLOCK_CODED && (at->block + 1) * BLOCK <= decoder->width;
}

// Blocks that are not coded are cheap: at one, that cursor goes ahead, so that nearly all coded blocks meet one of the
// other cursor's.
static inline void decode_next(struct pixel_decoder *decoder)
{
    struct cursor *cursor = &decoder->cursor[0], *b = &decoder->cursor[1];
    const bool ready_a = is_ready(decoder, cursor, b), ready_b = is_ready(decoder, b, cursor);
    if (ready_a && ready_b && is_coded(decoder, cursor) && is_coded(decoder, b))
        decode_two_blocks(decoder);
    else
        decode_block(decoder, ready_a && (!ready_b || !is_coded(decoder, cursor)) ? cursor : b);
}

enum status DEPTH_DECODE(struct depth_coder *c, const struct depth_layout *l, uint16_t *depth)
{
    struct pixel_decoder d = {.width = l->width,
                              .height = l->height,
                              .levels = l->levels ? l->levels : 65536,
                              .blocks = depth_row_blocks(l->width),
                              .noise = (LEVEL)l->noise};
    enum status status = rows_begin(c, &d.rows, l->width);
    if (status != OK)
        return status;
    decoder_begin(&d, c);
    struct cursor *a = &d.cursor[0], *b = &d.cursor[1];
    for (int i = 0; i < RANS_STREAMS; i++) {
        d.cursor[i].reader = c->rans->reader[i];
        begin_row(&d, &d.cursor[i], i);
    }
    while (!d.damaged && (a->y < l->height || b->y < l->height)) {
        decode_next(&d);
        if (a->block == d.blocks)
            end_row(&d, a, c->depth_of, depth);
        if (b->block == d.blocks)
            end_row(&d, b, c->depth_of, depth);
    }
    c->rans->reader[0] = a->reader;
    c->rans->reader[1] = b->reader;
    return !d.damaged && rans_is_done(c->rans) ? OK : NOTHING;
}
