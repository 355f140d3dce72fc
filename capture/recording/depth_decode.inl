// Decoding of a depth image's pixels.

// The state of decoding between one row and the next.
struct pixel_decoder {
    int64_t run; // remaining pixels of the run; -1: not read yet
    int width, levels;
};

static void look_above(struct rows *r, int width)
{
    for (int x = 1; x <= width; x += LANES) {
        store(r->slopes + x, slopes_above(r, x));
        store(r->holes + x, holes_above(r, x));
        store(r->even + x, even_at(r, x));
    }
}

// Pixels of a run from x on: as far as the row above stays the same, they are the left pixel's. Returns the last.
static inline int decode_run(struct pixel_decoder *d, struct rows *r, int x, LEVEL here, LEVEL fill)
{
    const int first = x, last = d->run < d->width - x + 1 ? x + (int)d->run - 1 : d->width;
    const lanes here_lanes = (lanes){0} + here, fill_lanes = (lanes){0} + fill;
    r->level[x] = here;
    r->filled[x] = fill;
    while (x + LANES <= last && all_bits(load(r->even + x + 1))) {
        store(r->level + x + 1, here_lanes);
        store(r->filled + x + 1, fill_lanes);
        x += LANES;
    }
    while (x < last && r->even[x + 1]) {
        r->level[++x] = here;
        r->filled[x] = fill;
    }
    d->run -= x - first + 1;
    return x;
}

// states: range->states, a constant.
static inline bool decode_row(struct pixel_decoder *d, struct rans_coder *range, struct rows *r, int states)
{
    struct rans_coder in = *range; // a copy, which nothing else points to
    const int width = d->width, noise = r->noise;
    const unsigned levels = (unsigned)d->levels;
    int here = r->level[0], fill = r->filled[0]; // of the pixel to the left
    uint32_t value;
    for (int x = 1; x <= width; x++) {
        int context = FLAT_MISS, below = 0;
        if (r->even[x] && here == r->level_above[x]) {
            if (d->run < 0) {
                if (!rans_pull(&in, states, FLAT_RUN, &value))
                    return false;
                d->run = value;
            }
            if (d->run > 0) {
                x = decode_run(d, r, x, (LEVEL)here, (LEVEL)fill);
                continue;
            }
            d->run = -1;
        } else {
            const int index = r->slopes[x] + slope_of(r->filled_above[x - 1] - fill, noise);
            const int holes = r->holes[x] | (here == HOLE);
            below = -(index < 0) & -!holes; // no branch: it would be badly predicted
            context = holes ? HOLE_CONTEXTS + holes : (index ^ below) - below;
        }
        const int predicted = predict(fill, r->filled_above[x], r->filled_above[x - 1]);
        if (!rans_pull(&in, states, context, &value))
            return false;
        const int residual = unfold(value - 1);
        here = value ? predicted + ((residual ^ below) - below) : HOLE;
        if ((unsigned)here >= levels || (value && here == HOLE))
            return false;
        fill = value ? here : predicted;
        r->level[x] = (LEVEL)here;
        r->filled[x] = (LEVEL)fill;
    }
    *range = in;
    return true;
}

enum status DEPTH_DECODE(struct depth_coder *c, const struct depth_layout *l, uint16_t *depth)
{
    struct rows *r;
    enum status status = rows_begin(c, &r, l);
    if (status != OK)
        return status;
    struct pixel_decoder d = {-1, l->width, l->levels ? l->levels : 65536};
    for (int y = 0; y < l->height; y++) {
        rows_next(r, l->width);
        look_above(r, l->width);
        if (!(c->range->states > 1 ? decode_row(&d, c->range, r, 2) : decode_row(&d, c->range, r, 1)))
            return NOTHING;
        for (int x = 0; x < l->width; x++)
            depth[(size_t)y * (size_t)l->width + (size_t)x] = c->depth_of[r->level[x + 1]];
    }
    return d.run <= 0 && rans_is_done(c->range) ? OK : NOTHING;
}
