// Encoding of a depth image's pixels.

// Compilers make one instruction of each of these, which they do not of a selection by a comparison.
static inline lanes smaller_lanes(lanes a, lanes b)
{
    lanes out;
    for (int i = 0; i < LANES; i++)
        out[i] = a[i] < b[i] ? a[i] : b[i];
    return out;
}

static inline lanes larger_lanes(lanes a, lanes b)
{
    lanes out;
    for (int i = 0; i < LANES; i++)
        out[i] = a[i] > b[i] ? a[i] : b[i];
    return out;
}

// The median of a, b and a + b - c.
static inline lanes predict_lanes(lanes a, lanes b, lanes c)
{
    const lanes plane = a - c + b; // in this order it does not overflow
    return larger_lanes(smaller_lanes(a, b), smaller_lanes(larger_lanes(a, b), plane));
}

// The pixels of a block as they are coded.
struct coded_block {
    LEVEL context[BLOCK], number[BLOCK];
    bool plain; // no number has bits that are not in its symbol
};

// The fills left of the pixels from x on, the first of their block. Where that has no holes they are its levels, which
// have been in memory for long: the fills have just been stored, and a load across two stores would wait for both.
static inline lanes first_fills_left(const struct row *row, int x, bool has_holes)
{
    if (has_holes)
        return load(row->filled + x - 1);
    lanes left = load(row->level + x - 1);
    left[0] = row->filled[x - 1];
    return left;
}

// Contexts and numbers of the pixels from x on, from their levels and fills. has_holes: any of them is one.
static inline void code_block(const struct row *row, const struct row *above, int x, LEVEL noise, bool has_holes,
                              struct coded_block *to)
{
    lanes large = (lanes){0};
    for (int i = 0; i < BLOCK; i += LANES, x += LANES) {
        const lanes level = load(row->level + x), left = load(row->level + x - 1);
        const lanes b = load(above->filled + x), c = load(above->filled + x - 1);
        const lanes a = !i ? first_fills_left(row, x, has_holes) : has_holes ? load(row->filled + x - 1) : left;
        const lanes holes = holes_above(above, x) | ((left == HOLE) & 1), whole = holes == 0;
        const lanes index = slopes_above(above, x, noise) + slopes_of(c - a, noise);
        const lanes below = (index < 0) & whole; // mirrored: the residual is negated
        const lanes residual = ((level - predict_lanes(a, b, c)) ^ below) - below;
        const lanes number = (((residual + residual) ^ (residual < 0)) + 1) & (level != HOLE);
        store(to->context + i, select_lanes(whole, (index ^ below) - below, holes + HOLE_CONTEXTS));
        store(to->number + i, number);
        large |= (number >= RANS_PLAIN) | (number < 0);
    }
    to->plain = no_bits(large);
}

// Fills the block's holes; each depends on the pixel before it. False: it has none.
static inline bool fill_block(struct row *row, const struct row *above, int x)
{
    lanes holes = (lanes){0};
    for (int i = 0; i < BLOCK; i += LANES) {
        const lanes level = load(row->level + x + i);
        holes |= level == HOLE;
        store(row->filled + x + i, level);
    }
    if (no_bits(holes))
        return false;
    for (const int end = x + BLOCK; x < end; x++)
        if (row->level[x] == HOLE)
            row->filled[x] = (LEVEL)depth_predict(row->filled[x - 1], above->filled[x], above->filled[x - 1]);
    return true;
}

static inline void push_block(struct rans_numbers *to, const struct coded_block *block, int count)
{
    const uint32_t all = sizeof(LEVEL) == 2 ? UINT16_MAX : UINT32_MAX; // a number is unsigned
    if (block->plain) {
        for (int i = 0; i < BLOCK; i++)
            to->codes[to->count + (size_t)i] = (uint16_t)(block->context[i] * RANS_SYMBOLS + block->number[i]);
        to->count += (size_t)count;
    } else {
        for (int i = 0; i < count; i++)
            rans_push(to, block->context[i], (uint32_t)block->number[i] & all);
    }
}

// Of each block its kind and, if it is coded, its pixels.
static void encode_row(struct rans_numbers *to, struct row *row, struct row *above, int width, LEVEL noise)
{
    struct coded_block block;
    set_left(row, above);
    for (int k = 0, x = 1; x <= width; k++, x += BLOCK) {
        const int count = width - x + 1 < BLOCK ? width - x + 1 : BLOCK;
        enum block_kind kind = BLOCK_HOLES;
        if (all_are(row->level + x, count, HOLE)) {
            fill_all(row->filled + x, row->filled[x - 1]);
        } else {
            const bool has_holes = fill_block(row, above, x);
            code_block(row, above, x, noise, has_holes, &block);
            kind = all_are(block.number, count, 1) ? BLOCK_PREDICTED : BLOCK_CODED;
        }
        rans_push(to, kind_context(row, above, k), (uint32_t)kind);
        if (kind == BLOCK_CODED)
            push_block(to, &block, count);
        row->kind[k] = (uint8_t)kind;
    }
    set_right(row, width);
}

enum status DEPTH_ENCODE(struct depth_coder *c, const uint16_t *depth, const struct depth_layout *l)
{
    struct row *rows;
    enum status status = rows_begin(c, &rows, l->width);
    if (status != OK)
        return status;
    for (int y = 0; y < l->height; y++) {
        struct row *row = row_at(rows, y), *above = row_at(rows, y - 1);
        const uint16_t *from = depth + (size_t)y * (size_t)l->width;
        for (int x = 0; x < l->width; x++)
            row->level[x + 1] = (LEVEL)c->level_of[from[x]];
        encode_row(&c->rans->numbers[y & 1], row, above, l->width, (LEVEL)l->noise);
    }
    return OK;
}
