#include "neural/network.h"

#include "base/clamp.h"
#include "base/memory.h"
#include "base/portable_math.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { CHANNELS = 16, PIXELS = 4 }; // of one block of a matrix product

struct network {
    struct tflite_model model;
    float **values;  // of each tensor that is computed; NULL of constants and of what is not needed
    float **weights; // of each operator that is a matrix product, in blocks of CHANNELS: the bias, then block by block
                     // the weights, k rising
    float *patches;  // scratch of convolutions
    size_t computed; // values of all tensors together
};

struct range {
    float low, high; // what an activation clamps to
};

static struct range range_of(enum tflite_activation activation)
{
    return (struct range){activation == TFLITE_NO_ACTIVATION ? -HUGE_VALF : 0,
                          activation == TFLITE_RELU6 ? 6 : HUGE_VALF};
}

static float clamp(float x, struct range r) { return clamp_float(x, r.low, r.high); }

// out[pixel][channel] = bias[channel] + the sum over k of in[pixel][k] weights[k][channel], k rising.
struct product {
    int pixels, channels, depth;      // depth: how many k
    const float *in, *weights, *bias; // weights and bias in whole blocks of CHANNELS
    struct range range;
    float *out;
};

// One depthwise convolution: weights[row][column][channel].
struct depthwise {
    int channels, width, height, out_width, out_height, across, down, stride_x, stride_y, pad_x, pad_y;
    ptrdiff_t row_stride, weight_stride; // from row to row of the image, of the weights
    const float *in, *weights, *bias;
    struct range range;
    float *out;
};

// The rows and columns of the filter that lie inside the image at one pixel.
struct taps {
    ptrdiff_t offset; // of its first row and column in the image's values; of those outside it may be negative
    int first_row, end_row, first_column, end_column;
};

static float depthwise_channel(const struct depthwise *d, const struct taps *t, int c)
{
    float sum = d->bias[c];
    for (int j = t->first_row; j < t->end_row; j++)
        for (int i = t->first_column; i < t->end_column; i++)
            sum += d->in[t->offset + (ptrdiff_t)j * d->row_stride + (ptrdiff_t)i * d->channels + c] *
                   d->weights[(ptrdiff_t)j * d->weight_stride + (ptrdiff_t)i * d->channels + c];
    return clamp(sum, d->range);
}

#define KERNEL(name) name##_4
#define LANES        4
#define ATTRIBUTE
#include "neural/network_kernels.inl"
#if defined(__x86_64__)
#define KERNEL(name) name##_8
#define LANES        8
#define ATTRIBUTE    __attribute__((target("avx2")))
#include "neural/network_kernels.inl"
static bool has_wide_vectors(void) { return __builtin_cpu_supports("avx2"); }
#endif

static void multiply(const struct product *p)
{
    void (*block)(const struct product *, int, int) = product_block_4;
#if defined(__x86_64__)
    if (has_wide_vectors())
        block = product_block_8;
#endif
    for (int c = 0; c < p->channels; c += CHANNELS)
        for (int i = 0; i < p->pixels; i += PIXELS)
            block(p, c, i);
}

static int at_least(int a, int b) { return a > b ? a : b; }
static int at_most(int a, int b) { return a < b ? a : b; }

static void convolve_depthwise(const struct depthwise *d)
{
    void (*pixel)(const struct depthwise *, const struct taps *, float *) = depthwise_pixel_4;
#if defined(__x86_64__)
    if (has_wide_vectors())
        pixel = depthwise_pixel_8;
#endif
    float *out = d->out;
    for (int y = 0; y < d->out_height; y++)
        for (int x = 0; x < d->out_width; x++, out += d->channels) {
            const int top = y * d->stride_y - d->pad_y, left = x * d->stride_x - d->pad_x;
            const struct taps taps = {
                .offset = top * d->row_stride + (ptrdiff_t)left * d->channels,
                .first_row = at_least(0, -top),
                .end_row = at_most(d->down, d->height - top),
                .first_column = at_least(0, -left),
                .end_column = at_most(d->across, d->width - left),
            };
            pixel(d, &taps, out);
        }
}

// ---------------------------------------------------------------- operators

static const struct tflite_tensor *tensor(const struct network *n, int i) { return &n->model.tensors[i]; }

// How many channels whole blocks have.
static size_t packed_channels(int channels) { return ((size_t)channels + CHANNELS - 1) / CHANNELS * CHANNELS; }

// A tensor's values, whether constant or computed.
static const float *values_of(const struct network *n, int i)
{
    return tensor(n, i)->values ? tensor(n, i)->values : n->values[i];
}

// How far "same" padding reaches before the first row or column: half of what is missing, rounded down.
static int pad_before(const struct tflite_operator *o, int in, int out, int filter, int stride)
{
    const int missing = (out - 1) * stride + filter - in;
    return o->valid_padding || missing < 0 ? 0 : missing / 2;
}

static void gather_patches(const struct tflite_operator *o, const struct tflite_tensor *in, const float *values,
                           const struct tflite_tensor *filter, const struct tflite_tensor *out, float *patch)
{
    const int height = in->size[1], width = in->size[2], channels = in->size[3];
    const int down = filter->size[1], across = filter->size[2];
    const int pad_y = pad_before(o, height, out->size[1], down, o->stride_y);
    const int pad_x = pad_before(o, width, out->size[2], across, o->stride_x);
    for (int i = 0; i < out->size[1] * out->size[2] * down * across; i++, patch += channels) {
        const int tap = i % (down * across), at = i / (down * across);
        const int x = at % out->size[2] * o->stride_x - pad_x + tap % across;
        const int y = at / out->size[2] * o->stride_y - pad_y + tap / across;
        if (x < 0 || y < 0 || x >= width || y >= height)
            memset(patch, 0, sizeof *patch * (size_t)channels);
        else
            memcpy(patch, values + ((size_t)y * (size_t)width + (size_t)x) * (size_t)channels,
                   sizeof *patch * (size_t)channels);
    }
}

static void run_convolution(struct network *n, int which)
{
    const struct tflite_operator *o = &n->model.operators[which];
    const struct tflite_tensor *in = tensor(n, o->input[0]), *filter = tensor(n, o->input[1]);
    const struct tflite_tensor *out = tensor(n, o->output);
    const float *values = values_of(n, o->input[0]);
    const bool pointwise = filter->size[1] == 1 && filter->size[2] == 1 && o->stride_x == 1 && o->stride_y == 1;
    if (!pointwise)
        gather_patches(o, in, values, filter, out, n->patches);
    multiply(&(struct product){
        .pixels = out->size[1] * out->size[2],
        .channels = out->size[3],
        .depth = filter->size[1] * filter->size[2] * filter->size[3],
        .in = pointwise ? values : n->patches,
        .weights = n->weights[which] + packed_channels(out->size[3]),
        .bias = n->weights[which],
        .range = range_of(o->activation),
        .out = n->values[o->output],
    });
}

static void run_depthwise(struct network *n, const struct tflite_operator *o)
{
    const struct tflite_tensor *in = tensor(n, o->input[0]), *filter = tensor(n, o->input[1]);
    const struct tflite_tensor *out = tensor(n, o->output);
    convolve_depthwise(&(struct depthwise){
        .channels = in->size[3],
        .width = in->size[2],
        .height = in->size[1],
        .out_width = out->size[2],
        .out_height = out->size[1],
        .across = filter->size[2],
        .down = filter->size[1],
        .stride_x = o->stride_x,
        .stride_y = o->stride_y,
        .pad_x = pad_before(o, in->size[2], out->size[2], filter->size[2], o->stride_x),
        .pad_y = pad_before(o, in->size[1], out->size[1], filter->size[1], o->stride_y),
        .row_stride = (ptrdiff_t)in->size[2] * in->size[3],
        .weight_stride = (ptrdiff_t)filter->size[2] * in->size[3],
        .in = values_of(n, o->input[0]),
        .weights = filter->values,
        .bias = tensor(n, o->input[2])->values,
        .range = range_of(o->activation),
        .out = n->values[o->output],
    });
}

static void run_max_pool(struct network *n, const struct tflite_operator *o)
{
    const struct tflite_tensor *in = tensor(n, o->input[0]), *out = tensor(n, o->output);
    const float *values = values_of(n, o->input[0]);
    const int channels = in->size[3], pad_y = pad_before(o, in->size[1], out->size[1], o->filter_y, o->stride_y);
    const int pad_x = pad_before(o, in->size[2], out->size[2], o->filter_x, o->stride_x);
    float *to = n->values[o->output];
    for (int i = 0; i < out->size[1] * out->size[2] * channels; i++) {
        const int c = i % channels, x = i / channels % out->size[2], y = i / channels / out->size[2];
        float most = -HUGE_VALF;
        for (int tap = 0; tap < o->filter_x * o->filter_y; tap++) {
            const int u = x * o->stride_x - pad_x + tap % o->filter_x, v = y * o->stride_y - pad_y + tap / o->filter_x;
            if (u >= 0 && v >= 0 && u < in->size[2] && v < in->size[1]) {
                const float value =
                    values[((size_t)v * (size_t)in->size[2] + (size_t)u) * (size_t)channels + (size_t)c];
                most = value > most ? value : most;
            }
        }
        to[i] = clamp(most, range_of(o->activation));
    }
}

// Between which two elements, and how far from the first, output `i` of a bilinear resize lies.
struct between {
    int first, second;
    float share;
};

static struct between between_of(int i, int in, int out, bool half_pixel_centers)
{
    const float scale = (float)in / (float)out;
    float at = half_pixel_centers ? ((float)i + 0.5f) * scale - 0.5f : (float)i * scale;
    at = at < 0 ? 0 : at;
    const int first = (int)at < in - 1 ? (int)at : in - 1;
    return (struct between){first, first + 1 < in ? first + 1 : first, at - (float)first};
}

static void run_resize(struct network *n, const struct tflite_operator *o)
{
    const struct tflite_tensor *in = tensor(n, o->input[0]), *out = tensor(n, o->output);
    const float *values = values_of(n, o->input[0]);
    const size_t channels = (size_t)in->size[3], width = (size_t)in->size[2];
    float *to = n->values[o->output];
    for (int y = 0; y < out->size[1]; y++) {
        const struct between v = between_of(y, in->size[1], out->size[1], o->half_pixel_centers);
        for (int x = 0; x < out->size[2]; x++, to += channels) {
            const struct between u = between_of(x, in->size[2], out->size[2], o->half_pixel_centers);
            const float *a = values + ((size_t)v.first * width + (size_t)u.first) * channels;
            const float *b = values + ((size_t)v.first * width + (size_t)u.second) * channels;
            const float *c = values + ((size_t)v.second * width + (size_t)u.first) * channels;
            const float *d = values + ((size_t)v.second * width + (size_t)u.second) * channels;
            const float share[] = {(1 - v.share) * (1 - u.share), (1 - v.share) * u.share, v.share * (1 - u.share),
                                   v.share * u.share};
            for (size_t k = 0; k < channels; k++)
                to[k] = a[k] * share[0] + b[k] * share[1] + c[k] * share[2] + d[k] * share[3];
        }
    }
}

static void run_pad(struct network *n, const struct tflite_operator *o)
{
    const struct tflite_tensor *in = tensor(n, o->input[0]), *out = tensor(n, o->output);
    const int32_t *before = tensor(n, o->input[1])->integers; // before and after, of each dimension
    const float *values = values_of(n, o->input[0]);
    float *to = n->values[o->output];
    memset(to, 0, sizeof *to * out->count);
    for (int y = 0; y < in->size[1]; y++)
        for (int x = 0; x < in->size[2]; x++, values += in->size[3])
            memcpy(
                to + ((size_t)(y + before[2]) * (size_t)out->size[2] + (size_t)(x + before[4])) * (size_t)out->size[3] +
                    before[6],
                values, sizeof *to * (size_t)in->size[3]);
}

static void run_depth_to_space(struct network *n, const struct tflite_operator *o)
{
    const struct tflite_tensor *in = tensor(n, o->input[0]), *out = tensor(n, o->output);
    const float *values = values_of(n, o->input[0]);
    float *to = n->values[o->output];
    const int block = o->block, channels = out->size[3];
    for (int y = 0; y < out->size[1]; y++)
        for (int x = 0; x < out->size[2]; x++, to += channels)
            memcpy(to,
                   values + ((size_t)(y / block) * (size_t)in->size[2] + (size_t)(x / block)) * (size_t)in->size[3] +
                       (size_t)((y % block * block + x % block) * channels),
                   sizeof *to * (size_t)channels);
}

static void run_concatenation(struct network *n, const struct tflite_operator *o)
{
    const struct tflite_tensor *out = tensor(n, o->output);
    const int axis = o->axis < 0 ? o->axis + out->dimensions : o->axis;
    float *to = n->values[o->output];
    size_t outer = 1;
    for (int d = 0; d < axis; d++)
        outer *= (size_t)out->size[d];
    for (size_t i = 0; i < outer; i++)
        for (int k = 0; k < o->input_count; k++) {
            const size_t each = tensor(n, o->input[k])->count / outer;
            memcpy(to, values_of(n, o->input[k]) + i * each, sizeof *to * each);
            to += each;
        }
}

static void run_add(struct network *n, const struct tflite_operator *o)
{
    const float *a = values_of(n, o->input[0]), *b = values_of(n, o->input[1]);
    const struct range range = range_of(o->activation);
    float *to = n->values[o->output];
    for (size_t i = 0; i < tensor(n, o->output)->count; i++)
        to[i] = clamp(a[i] + b[i], range);
}

static void run_logistic(struct network *n, const struct tflite_operator *o)
{
    const float *values = values_of(n, o->input[0]);
    for (size_t i = 0; i < tensor(n, o->output)->count; i++)
        n->values[o->output][i] = (float)(1 / (1 + portable_exp(-(double)values[i])));
}

void network_run(struct network *n)
{
    for (int i = 0; i < n->model.operator_count; i++) {
        const struct tflite_operator *o = &n->model.operators[i];
        switch (o->kind) {
        case TFLITE_CONV_2D: run_convolution(n, i); break;
        case TFLITE_DEPTHWISE_CONV_2D: run_depthwise(n, o); break;
        case TFLITE_MAX_POOL_2D: run_max_pool(n, o); break;
        case TFLITE_RESIZE_BILINEAR: run_resize(n, o); break;
        case TFLITE_PAD: run_pad(n, o); break;
        case TFLITE_DEPTH_TO_SPACE: run_depth_to_space(n, o); break;
        case TFLITE_CONCATENATION: run_concatenation(n, o); break;
        case TFLITE_ADD: run_add(n, o); break;
        case TFLITE_LOGISTIC: run_logistic(n, o); break;
        case TFLITE_RESHAPE:
            memcpy(n->values[o->output], values_of(n, o->input[0]), sizeof(float) * tensor(n, o->output)->count);
            break;
        case TFLITE_DEQUANTIZE:
        case TFLITE_DENSIFY: break; // folded when it was read
        }
    }
}

// ---------------------------------------------------------------- checking

static bool is_image(const struct tflite_tensor *t) { return t->dimensions == 4 && t->size[0] == 1; }

// What a convolution or pool makes of `in` elements.
static int out_size(const struct tflite_operator *o, int in, int filter, int stride)
{
    if (stride < 1 || filter < 1 || stride > 64 || filter > 64)
        return -1;
    return o->valid_padding ? (in - filter + stride) / stride : (in + stride - 1) / stride;
}

static bool same_shape(const struct tflite_tensor *a, const struct tflite_tensor *b)
{
    return a->dimensions == b->dimensions && !memcmp(a->size, b->size, sizeof a->size[0] * (size_t)a->dimensions);
}

static bool window_fits(const struct tflite_operator *o, const struct tflite_tensor *in,
                        const struct tflite_tensor *out, int across, int down)
{
    return is_image(in) && is_image(out) && out->size[1] == out_size(o, in->size[1], down, o->stride_y) &&
           out->size[2] == out_size(o, in->size[2], across, o->stride_x);
}

static bool weights_fit(const struct network *n, const struct tflite_operator *o)
{
    if (o->input_count < 2 || o->input[1] < 0)
        return false;
    const struct tflite_tensor *in = tensor(n, o->input[0]), *out = tensor(n, o->output);
    const struct tflite_tensor *filter = tensor(n, o->input[1]);
    const bool depthwise = o->kind == TFLITE_DEPTHWISE_CONV_2D;
    if (!filter->values || filter->dimensions != 4 || !window_fits(o, in, out, filter->size[2], filter->size[1]))
        return false;
    if (o->input_count > 2 && o->input[2] >= 0) {
        const struct tflite_tensor *bias = tensor(n, o->input[2]);
        if (!bias->values || bias->count != (size_t)out->size[3])
            return false;
    } else if (depthwise) {
        return false; // none of the networks is without
    }
    return depthwise ? filter->size[0] == 1 && filter->size[3] == in->size[3] && out->size[3] == in->size[3]
                     : filter->size[0] == out->size[3] && filter->size[3] == in->size[3];
}

static bool padding_fits(const struct network *n, const struct tflite_operator *o)
{
    const struct tflite_tensor *in = tensor(n, o->input[0]), *out = tensor(n, o->output);
    if (o->input_count != 2 || o->input[1] < 0 || !is_image(in) || !is_image(out))
        return false;
    const struct tflite_tensor *amounts = tensor(n, o->input[1]);
    bool fits = amounts->integers && amounts->integer_count == 8;
    for (int d = 0; fits && d < 4; d++) {
        const int32_t before = amounts->integers[2 * d], after = amounts->integers[2 * d + 1];
        fits =
            before >= 0 && after >= 0 && before < 1024 && after < 1024 && out->size[d] == in->size[d] + before + after;
    }
    return fits;
}

static bool concatenation_fits(const struct network *n, const struct tflite_operator *o)
{
    const struct tflite_tensor *out = tensor(n, o->output);
    const int axis = o->axis < 0 ? o->axis + out->dimensions : o->axis;
    int together = 0;
    if (axis < 0 || axis >= out->dimensions)
        return false;
    for (int k = 0; k < o->input_count; k++) {
        if (o->input[k] < 0 || tensor(n, o->input[k])->dimensions != out->dimensions)
            return false;
        for (int d = 0; d < out->dimensions; d++)
            if (d != axis && tensor(n, o->input[k])->size[d] != out->size[d])
                return false;
        together += tensor(n, o->input[k])->size[axis];
    }
    return together == out->size[axis];
}

static bool shapes_fit(const struct network *n, const struct tflite_operator *o)
{
    const struct tflite_tensor *in = tensor(n, o->input[0]), *out = tensor(n, o->output);
    switch (o->kind) {
    case TFLITE_CONV_2D:
    case TFLITE_DEPTHWISE_CONV_2D: return weights_fit(n, o);
    case TFLITE_MAX_POOL_2D: return window_fits(o, in, out, o->filter_x, o->filter_y) && in->size[3] == out->size[3];
    case TFLITE_RESIZE_BILINEAR: return is_image(in) && is_image(out) && in->size[3] == out->size[3];
    case TFLITE_PAD: return padding_fits(n, o);
    case TFLITE_DEPTH_TO_SPACE:
        return o->block >= 1 && o->block <= 64 && is_image(in) && is_image(out) &&
               in->size[3] == out->size[3] * o->block * o->block && out->size[1] == in->size[1] * o->block &&
               out->size[2] == in->size[2] * o->block;
    case TFLITE_CONCATENATION: return concatenation_fits(n, o);
    case TFLITE_ADD:
        return o->input_count == 2 && o->input[1] >= 0 && same_shape(in, out) &&
               same_shape(tensor(n, o->input[1]), out);
    case TFLITE_LOGISTIC:
    case TFLITE_RESHAPE: return in->count == out->count;
    case TFLITE_DEQUANTIZE:
    case TFLITE_DENSIFY: return false;
    }
    return false;
}

// Only inputs that hold values, each operator's own output once.
static bool order_fits(const struct network *n, const struct tflite_operator *o, const bool *ready)
{
    for (int k = 0; k < o->input_count; k++) {
        const int i = o->input[k];
        const bool amounts = o->kind != TFLITE_ADD && o->kind != TFLITE_CONCATENATION && k > 0;
        if (i >= 0 && !amounts && !ready[i] && !tensor(n, i)->values)
            return false;
    }
    return !ready[o->output] && !tensor(n, o->output)->values && o->output != n->model.input;
}

// ---------------------------------------------------------------- opening

// Leaves out the operators that no wanted output needs.
static bool keep_needed(struct tflite_model *m, unsigned outputs)
{
    bool *needed = calloc((size_t)m->tensor_count, sizeof *needed);
    if (!needed)
        return false;
    for (int i = 0; i < m->output_count; i++)
        if (outputs >> i & 1)
            needed[m->output[i]] = true;
    int kept = m->operator_count;
    for (int i = m->operator_count - 1; i >= 0; i--) {
        const struct tflite_operator *o = &m->operators[i];
        if (!needed[o->output])
            continue;
        for (int k = 0; k < o->input_count; k++)
            if (o->input[k] >= 0)
                needed[o->input[k]] = true;
        m->operators[--kept] = *o;
    }
    m->operator_count -= kept;
    memmove(m->operators, m->operators + kept, sizeof *m->operators * (size_t)m->operator_count);
    free(needed);
    return true;
}

// The bias (NULL: 0) and a convolution's weights, [channel][k] in the file, as struct product wants them.
static float *pack_weights(const struct tflite_tensor *filter, const float *bias)
{
    const size_t channels = (size_t)filter->size[0], depth = filter->count / channels;
    const size_t padded = packed_channels(filter->size[0]), count = padded * (depth + 1);
    float *packed = alloc_cache_aligned(sizeof *packed * count);
    if (!packed)
        return NULL;
    memset(packed, 0, sizeof *packed * count);
    if (bias)
        memcpy(packed, bias, sizeof *packed * channels);
    for (size_t c = 0; c < channels; c++)
        for (size_t k = 0; k < depth; k++)
            packed[padded + c / CHANNELS * CHANNELS * depth + k * CHANNELS + c % CHANNELS] =
                filter->values[c * depth + k];
    return packed;
}

static enum status prepare_operator(struct network *n, int which, bool *ready, size_t *patch_values)
{
    const struct tflite_operator *o = &n->model.operators[which];
    if (!order_fits(n, o, ready) || !shapes_fit(n, o))
        return ERR_FORMAT;
    ready[o->output] = true;
    const struct tflite_tensor *out = tensor(n, o->output);
    if ((n->computed += out->count) > TFLITE_MOST_VALUES)
        return ERR_FORMAT;
    if (!(n->values[o->output] = malloc(sizeof(float) * out->count)))
        return ERR_MEMORY;
    if (o->kind != TFLITE_CONV_2D)
        return OK;
    const struct tflite_tensor *filter = tensor(n, o->input[1]);
    const size_t patches = (size_t)out->size[1] * (size_t)out->size[2] * (filter->count / (size_t)filter->size[0]);
    if (patches > TFLITE_MOST_VALUES)
        return ERR_FORMAT;
    *patch_values = patches > *patch_values ? patches : *patch_values;
    const bool has_bias = o->input_count > 2 && o->input[2] >= 0;
    n->weights[which] = pack_weights(filter, has_bias ? tensor(n, o->input[2])->values : NULL);
    return n->weights[which] ? OK : ERR_MEMORY;
}

static enum status prepare(struct network *n, unsigned outputs)
{
    const struct tflite_model *m = &n->model;
    bool *ready = calloc((size_t)m->tensor_count, sizeof *ready);
    size_t patch_values = 1;
    n->values = calloc((size_t)m->tensor_count, sizeof *n->values);
    n->weights = calloc((size_t)m->operator_count + 1, sizeof *n->weights);
    enum status status = ready && n->values && n->weights ? OK : ERR_MEMORY;
    if (status == OK && tensor(n, m->input)->values)
        status = ERR_FORMAT;
    if (status == OK && !(n->values[m->input] = calloc(tensor(n, m->input)->count, sizeof(float))))
        status = ERR_MEMORY;
    if (status == OK)
        ready[m->input] = true;
    for (int i = 0; status == OK && i < m->operator_count; i++)
        status = prepare_operator(n, i, ready, &patch_values);
    for (int i = 0; status == OK && i < m->output_count; i++)
        if (outputs >> i & 1 && !ready[m->output[i]])
            status = ERR_FORMAT;
    if (status == OK && !(n->patches = alloc_cache_aligned(sizeof(float) * patch_values)))
        status = ERR_MEMORY;
    free(ready);
    return status;
}

enum status network_open(struct network **out, const char *name, struct tflite_model *model, unsigned outputs)
{
    struct network *n = *out = calloc(1, sizeof *n);
    if (!n) {
        tflite_free(model);
        return fail(ERR_MEMORY, "no memory for the network %s", name);
    }
    n->model = *model;
    *model = (struct tflite_model){0};
    enum status status = keep_needed(&n->model, outputs) ? prepare(n, outputs) : ERR_MEMORY;
    if (status == OK)
        return OK;
    network_close(out);
    return status == ERR_MEMORY ? fail(status, "no memory for the network %s", name)
                                : fail(status, "%s is no network that can be run here: its shapes do not fit", name);
}

void network_close(struct network **out)
{
    struct network *n = *out;
    if (!n)
        return;
    for (int i = 0; n->values && i < n->model.tensor_count; i++)
        free(n->values[i]);
    for (int i = 0; n->weights && i < n->model.operator_count; i++)
        free(n->weights[i]);
    free(n->values);
    free(n->weights);
    free(n->patches);
    tflite_free(&n->model);
    free(n);
    *out = NULL;
}

float *network_input(struct network *n, size_t *count)
{
    *count = tensor(n, n->model.input)->count;
    return n->values[n->model.input];
}

const float *network_output(const struct network *n, int i, size_t *count)
{
    assert(i >= 0 && i < n->model.output_count && n->values[n->model.output[i]]);
    *count = tensor(n, n->model.output[i])->count;
    return n->values[n->model.output[i]];
}
