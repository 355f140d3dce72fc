// The inner loops of neural/network.c, in vectors of LANES floats; included once for each width. KERNEL(name) names this
// width's functions, ATTRIBUTE chooses the instructions. Each channel has its own sum, taken in the same order whatever the
// width, so the width changes no bit.

typedef float KERNEL(lanes) __attribute__((vector_size(4 * LANES), aligned(4), may_alias));
typedef int32_t KERNEL(mask) __attribute__((vector_size(4 * LANES)));

// As clamp() below, NaN included.
ATTRIBUTE static inline KERNEL(lanes) KERNEL(clamp)(KERNEL(lanes) x, struct range r)
{
    const KERNEL(lanes) low = r.low - (KERNEL(lanes)){0}, high = r.high - (KERNEL(lanes)){0};
    const KERNEL(mask) below = x < low, above = x > high;
    const KERNEL(mask) kept = (KERNEL(mask))x & ~(below | above);
    return (KERNEL(lanes))(kept | (below & (KERNEL(mask))low) | (above & ~below & (KERNEL(mask))high));
}

// PIXELS pixels by CHANNELS channels from (pixel, channel) on.
ATTRIBUTE static void KERNEL(product_block)(const struct product *p, int channel, int pixel)
{
    enum { VECTORS = CHANNELS / LANES };
    const KERNEL(lanes) *weights = (const void *)(p->weights + (size_t)channel * (size_t)p->depth);
    const KERNEL(lanes) *bias = (const void *)(p->bias + channel);
    const int pixels = p->pixels - pixel < PIXELS ? p->pixels - pixel : PIXELS;
    const float *in[PIXELS];
    KERNEL(lanes) sum[PIXELS][VECTORS];
    for (int i = 0; i < PIXELS; i++) {
        in[i] = p->in + (size_t)(pixel + (i < pixels ? i : 0)) * (size_t)p->depth;
        for (int v = 0; v < VECTORS; v++)
            sum[i][v] = bias[v];
    }
    for (int k = 0; k < p->depth; k++, weights += VECTORS) {
#pragma GCC unroll 4
        for (int v = 0; v < VECTORS; v++) {
#pragma GCC unroll 4
            for (int i = 0; i < PIXELS; i++)
                sum[i][v] += in[i][k] * weights[v];
        }
    }
    const int channels = p->channels - channel < CHANNELS ? p->channels - channel : CHANNELS;
    for (int i = 0; i < pixels; i++) {
        float *out = p->out + (size_t)(pixel + i) * (size_t)p->channels + (size_t)channel;
        for (int v = 0; v < VECTORS; v++)
            sum[i][v] = KERNEL(clamp)(sum[i][v], p->range);
        memcpy(out, sum[i], sizeof *out * (size_t)channels);
    }
}

// `vectors` vectors of channels from c on, of one pixel.
ATTRIBUTE static inline __attribute__((always_inline)) void
KERNEL(depthwise_channels)(const struct depthwise *d, const struct taps *t, int c, int vectors, float *out)
{
    KERNEL(lanes) sum[4];
    for (int v = 0; v < vectors; v++)
        sum[v] = ((const KERNEL(lanes) *)(const void *)(d->bias + c))[v];
    for (int j = t->first_row; j < t->end_row; j++) {
        const ptrdiff_t in = t->offset + (ptrdiff_t)j * d->row_stride + c, w = (ptrdiff_t)j * d->weight_stride + c;
        for (int i = t->first_column; i < t->end_column; i++) {
            const KERNEL(lanes) *a = (const void *)(d->in + in + (ptrdiff_t)i * d->channels);
            const KERNEL(lanes) *b = (const void *)(d->weights + w + (ptrdiff_t)i * d->channels);
            for (int v = 0; v < vectors; v++)
                sum[v] += a[v] * b[v];
        }
    }
    for (int v = 0; v < vectors; v++)
        ((KERNEL(lanes) *)(void *)(out + c))[v] = KERNEL(clamp)(sum[v], d->range);
}

ATTRIBUTE static void KERNEL(depthwise_pixel)(const struct depthwise *d, const struct taps *t, float *out)
{
    int c = 0;
    for (; c + 4 * LANES <= d->channels; c += 4 * LANES)
        KERNEL(depthwise_channels)(d, t, c, 4, out);
    for (; c + LANES <= d->channels; c += LANES)
        KERNEL(depthwise_channels)(d, t, c, 1, out);
    for (; c < d->channels; c++)
        out[c] = depthwise_channel(d, t, c);
}

#undef KERNEL
#undef LANES
#undef ATTRIBUTE
