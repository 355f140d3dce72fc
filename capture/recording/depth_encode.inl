// Encoding of a depth image's pixels.

// What is being coded, from one row to the next.
struct pixel_encoder {
    struct rans_coder range; // a copy, which nothing else points to
    struct rans_position run_position;
    uint32_t run;
    bool in_run;
};

// A block of pixels as they will be coded if they are not flat; and which are.
struct coded_block {
    LEVEL context[BLOCK], number[BLOCK], flat[BLOCK];
    bool simple; // no flat pixel ends a run, and no number has bits that are not coded
    bool any_flat;
};

static inline lanes select_lanes(lanes where, lanes one, lanes other) { return (one & where) | (other & ~where); }

static inline lanes predict_lanes(lanes a, lanes b, lanes c)
{
    const lanes less = a < b, low = select_lanes(less, a, b), high = select_lanes(less, b, a);
    const lanes plane = a - c + b; // in this order it does not overflow
    return select_lanes(plane < low, low, select_lanes(plane > high, high, plane));
}

// Contexts and numbers of the pixels from x on, from their levels and fills.
static void code_block(struct rows *r, int x, struct coded_block *to)
{
    lanes special = (lanes){0}, any_flat = special;
    for (int i = 0; i < BLOCK; i += LANES, x += LANES) {
        const lanes level = load(r->level + x), left = load(r->level + x - 1);
        const lanes a = load(r->filled + x - 1), b = load(r->filled_above + x), c = load(r->filled_above + x - 1);
        const lanes holes = holes_above(r, x) | ((left == HOLE) & 1), whole = holes == 0;
        const lanes index = slopes_above(r, x) + slopes_of(c - a, r->noise);
        const lanes below = (index < 0) & whole; // mirrored: the residual is negated
        const lanes residual = ((level - predict_lanes(a, b, c)) ^ below) - below;
        const lanes number = (((residual + residual) ^ (residual < 0)) + 1) & (level != HOLE);
        const lanes flat = even_at(r, x) & (left == load(r->level_above + x));
        store(to->context + i, select_lanes(whole, (index ^ below) - below, holes + HOLE_CONTEXTS));
        store(to->number + i, number);
        store(to->flat + i, flat);
        special |= (flat & (level != left)) | (~flat & ((number >= RANS_PLAIN) | (number < 0)));
        any_flat |= flat;
    }
    to->simple = no_bits(special);
    to->any_flat = !no_bits(any_flat);
}

// All pixels of the block are flat and have the level to their left.
static inline bool is_run(struct rows *r, int x)
{
    lanes run = even_at(r, x) & (load(r->level + x - 1) == load(r->level_above + x)) &
                (load(r->level + x) == load(r->level + x - 1));
    for (int i = LANES; i < BLOCK; i += LANES)
        run &= even_at(r, x + i) & (load(r->level + x + i) == load(r->level_above + x + i)) &
               (load(r->level + x + i) == load(r->level + x + i - 1));
    return all_bits(run);
}

// Fills the block's holes; each depends on the pixel before it.
static void fill_block(struct rows *r, int x)
{
    lanes holes = (lanes){0};
    for (int i = 0; i < BLOCK; i += LANES) {
        const lanes level = load(r->level + x + i);
        holes |= level == HOLE;
        store(r->filled + x + i, level);
    }
    if (no_bits(holes))
        return;
    for (const int end = x + BLOCK; x < end; x++) {
        const LEVEL *above = r->level_above + x;
        if (r->level[x] != HOLE)
            continue;
        const bool run = !(r->level[x - 1] | above[-1] | above[0] | above[1]); // of holes
        r->filled[x] = run ? r->filled[x - 1]
                           : (LEVEL)predict(r->filled[x - 1], r->filled_above[x], r->filled_above[x - 1]);
    }
}

static inline void begin_run(struct pixel_encoder *e)
{
    if (e->in_run)
        return;
    e->in_run = true;
    e->run = 0;
    e->run_position = rans_reserve(&e->range);
}

static inline void encode_flat(struct pixel_encoder *e, struct rows *r, int x)
{
    begin_run(e);
    if (r->level[x] == r->level[x - 1]) {
        e->run++;
        return;
    }
    const int predicted = predict(r->filled[x - 1], r->filled_above[x], r->filled_above[x - 1]);
    rans_fill(&e->range, e->run_position, FLAT_RUN, e->run);
    e->in_run = false;
    rans_push(&e->range, FLAT_MISS, r->level[x] == HOLE ? 0 : 1 + fold(r->level[x] - predicted));
}

// Pixels that are not flat are pushed, those of a run counted, without a branch: it would be badly predicted.
static void push_simple(struct pixel_encoder *e, int count, const struct coded_block *block)
{
    uint16_t *to = e->range.codes + e->range.count;
    uint32_t flat = 0, pushed = 0;
    for (int i = 0; i < count; i++) {
        to[pushed] = (uint16_t)(block->context[i] * RANS_SYMBOLS + block->number[i]);
        pushed += 1 + (uint32_t)block->flat[i]; // 1, or 0
        flat -= (uint32_t)block->flat[i];
    }
    e->range.count += pushed;
    e->run += flat;
}

static void push_block(struct pixel_encoder *e, struct rows *r, int x, int count, const struct coded_block *block)
{
    const uint32_t all = sizeof(LEVEL) == 2 ? UINT16_MAX : UINT32_MAX; // a number is unsigned
    if (block->simple && (e->in_run || !block->any_flat)) {
        push_simple(e, count, block);
        return;
    }
    for (int i = 0; i < count; i++)
        if (block->flat[i])
            encode_flat(e, r, x + i);
        else
            rans_push(&e->range, block->context[i], (uint32_t)block->number[i] & all);
}

static void encode_row(struct pixel_encoder *e, struct rows *r, int width)
{
    struct coded_block block;
    for (int x = 1; x <= width; x += BLOCK) {
        const int count = width - x + 1 < BLOCK ? width - x + 1 : BLOCK;
        if (count == BLOCK && is_run(r, x)) {
            begin_run(e);
            e->run += BLOCK;
            for (int i = 0; i < BLOCK; i++)
                r->filled[x + i] = r->filled[x - 1];
            continue;
        }
        fill_block(r, x);
        code_block(r, x, &block);
        push_block(e, r, x, count, &block);
    }
}

enum status DEPTH_ENCODE(struct depth_coder *c, const uint16_t *depth, const struct depth_layout *l)
{
    struct rows *r;
    enum status status = rows_begin(c, &r, l);
    if (status != OK)
        return status;
    struct pixel_encoder e = {.range = *c->range};
    for (int y = 0; y < l->height; y++) {
        rows_next(r, l->width);
        const uint16_t *from = depth + (size_t)y * (size_t)l->width;
        for (int x = 0; x < l->width; x++)
            r->level[x + 1] = (LEVEL)c->level_of[from[x]];
        encode_row(&e, r, l->width);
    }
    if (e.in_run)
        rans_fill(&e.range, e.run_position, FLAT_RUN, e.run);
    *c->range = e.range;
    return OK;
}
