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

static float clamp(float x, struct range range) { return clamp_float(x, range.low, range.high); }

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

static float depthwise_channel(const struct depthwise *depthwise, const struct taps *taps, int c)
{
    float sum = depthwise->bias[c];
    for (int j = taps->first_row; j < taps->end_row; j++)
        for (int i = taps->first_column; i < taps->end_column; i++)
            sum +=
                depthwise
                    ->in[taps->offset + (ptrdiff_t)j * depthwise->row_stride + (ptrdiff_t)i * depthwise->channels + c] *
                depthwise->weights[(ptrdiff_t)j * depthwise->weight_stride + (ptrdiff_t)i * depthwise->channels + c];
    return clamp(sum, depthwise->range);
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

static void multiply_blocks(const struct product *product)
{
    void (*block)(const struct product *, int, int) = product_block_4;
#if defined(__x86_64__)
    if (has_wide_vectors())
        block = product_block_8;
#endif
    for (int c = 0; c < product->channels; c += CHANNELS)
        for (int i = 0; i < product->pixels; i += PIXELS)
            block(product, c, i);
}

static int at_least(int a, int b) { return a > b ? a : b; }
static int at_most(int a, int b) { return a < b ? a : b; }

static void convolve_depthwise(const struct depthwise *depthwise)
{
    void (*pixel)(const struct depthwise *, const struct taps *, float *) = depthwise_pixel_4;
#if defined(__x86_64__)
    if (has_wide_vectors())
        pixel = depthwise_pixel_8;
#endif
    float *out = depthwise->out;
    for (int y = 0; y < depthwise->out_height; y++)
        for (int x = 0; x < depthwise->out_width; x++, out += depthwise->channels) {
            const int top = y * depthwise->stride_y - depthwise->pad_y,
                      left = x * depthwise->stride_x - depthwise->pad_x;
            const struct taps taps = {
                .offset = top * depthwise->row_stride + (ptrdiff_t)left * depthwise->channels,
                .first_row = at_least(0, -top),
                .end_row = at_most(depthwise->down, depthwise->height - top),
                .first_column = at_least(0, -left),
                .end_column = at_most(depthwise->across, depthwise->width - left),
            };
            pixel(depthwise, &taps, out);
        }
}

// ---------------------------------------------------------------- operators

static const struct tflite_tensor *tensor_at(const struct network *network, int i)
{
    return &network->model.tensors[i];
}

// How many channels whole blocks have.
static size_t packed_channels(int channels) { return ((size_t)channels + CHANNELS - 1) / CHANNELS * CHANNELS; }

// A tensor's values, whether constant or computed.
static const float *values_of(const struct network *network, int i)
{
    return tensor_at(network, i)->values ? tensor_at(network, i)->values : network->values[i];
}

// How far "same" padding reaches before the first row or column: half of what is missing, rounded down.
static int pad_before(const struct tflite_operator *operator, int in, int out, int filter, int stride)
{
    const int missing = (out - 1) * stride + filter - in;
    return operator->valid_padding || missing<0 ? 0 : missing / 2;
}

static void gather_patches(const struct tflite_operator *operator, const struct tflite_tensor * in, const float *values,
                           const struct tflite_tensor *filter, const struct tflite_tensor *out, float *patch)
{
    const int height = in->size[1], width = in->size[2], channels = in->size[3];
    const int down = filter->size[1], across = filter->size[2];
    const int pad_y = pad_before(operator, height, out->size[1], down, operator->stride_y);
    const int pad_x = pad_before(operator, width, out->size[2], across, operator->stride_x);
    for (int i = 0; i < out->size[1] * out->size[2] * down * across; i++, patch += channels) {
        const int tap = i % (down * across), at = i / (down * across);
        const int x = at % out->size[2] * operator->stride_x - pad_x + tap % across;
        const int y = at / out->size[2] * operator->stride_y - pad_y + tap / across;
        if (x < 0 || y < 0 || x >= width || y >= height)
            memset(patch, 0, sizeof *patch * (size_t)channels);
        else
            memcpy(patch, values + ((size_t)y * (size_t)width + (size_t)x) * (size_t)channels,
                   sizeof *patch * (size_t)channels);
    }
}

static void run_convolution(struct network *network, int which)
{
    const struct tflite_operator *o = &network->model.operators[which];
    const struct tflite_tensor *in = tensor_at(network, o->input[0]), *filter = tensor_at(network, o->input[1]);
    const struct tflite_tensor *out = tensor_at(network, o->output);
    const float *values = values_of(network, o->input[0]);
    const bool pointwise = filter->size[1] == 1 && filter->size[2] == 1 && o->stride_x == 1 && o->stride_y == 1;
    if (!pointwise)
        gather_patches(o, in, values, filter, out, network->patches);
    multiply_blocks(&(struct product){
        .pixels = out->size[1] * out->size[2],
        .channels = out->size[3],
        .depth = filter->size[1] * filter->size[2] * filter->size[3],
        .in = pointwise ? values : network->patches,
        .weights = network->weights[which] + packed_channels(out->size[3]),
        .bias = network->weights[which],
        .range = range_of(o->activation),
        .out = network->values[o->output],
    });
}

static void run_depthwise(struct network *network, const struct tflite_operator *operator)
{
    const struct tflite_tensor *in = tensor_at(network, operator->input[0]),
                               *filter = tensor_at(network, operator->input[1]);
    const struct tflite_tensor *out = tensor_at(network, operator->output);
    convolve_depthwise(&(struct depthwise){
        .channels = in->size[3],
        .width = in->size[2],
        .height = in->size[1],
        .out_width = out->size[2],
        .out_height = out->size[1],
        .across = filter->size[2],
        .down = filter->size[1],
        .stride_x = operator->stride_x,
        .stride_y = operator->stride_y,
        .pad_x = pad_before(operator, in->size[2], out->size[2], filter->size[2], operator->stride_x),
        .pad_y = pad_before(operator, in->size[1], out->size[1], filter->size[1], operator->stride_y),
        .row_stride = (ptrdiff_t)in->size[2] * in->size[3],
        .weight_stride = (ptrdiff_t)filter->size[2] * in->size[3],
        .in = values_of(network, operator->input[0]),
        .weights = filter->values,
        .bias = tensor_at(network, operator->input[2])->values,
        .range = range_of(operator->activation),
        .out = network->values[operator->output],
    });
}

static void run_max_pool(struct network *network, const struct tflite_operator *operator)
{
    const struct tflite_tensor *in = tensor_at(network, operator->input[0]),
                               *out = tensor_at(network, operator->output);
    const float *values = values_of(network, operator->input[0]);
    const int channels = in->size[3],
              pad_y = pad_before(operator, in->size[1], out->size[1], operator->filter_y, operator->stride_y);
    const int pad_x = pad_before(operator, in->size[2], out->size[2], operator->filter_x, operator->stride_x);
    float *to = network->values[operator->output];
    for (int i = 0; i < out->size[1] * out->size[2] * channels; i++) {
        const int c = i % channels, x = i / channels % out->size[2], y = i / channels / out->size[2];
        float max = -HUGE_VALF;
        for (int tap = 0; tap < operator->filter_x * operator->filter_y; tap++) {
            const int u = x * operator->stride_x - pad_x + tap % operator->filter_x,
                      v = y * operator->stride_y - pad_y + tap / operator->filter_x;
            if (u >= 0 && v >= 0 && u < in->size[2] && v < in->size[1]) {
                const float value =
                    values[((size_t)v * (size_t)in->size[2] + (size_t)u) * (size_t)channels + (size_t)c];
                max = value > max ? value : max;
            }
        }
        to[i] = clamp(max, range_of(operator->activation));
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

static void run_resize(struct network *network, const struct tflite_operator *operator)
{
    const struct tflite_tensor *in = tensor_at(network, operator->input[0]),
                               *out = tensor_at(network, operator->output);
    const float *values = values_of(network, operator->input[0]);
    const size_t channels = (size_t)in->size[3], width = (size_t)in->size[2];
    float *to = network->values[operator->output];
    for (int y = 0; y < out->size[1]; y++) {
        const struct between v = between_of(y, in->size[1], out->size[1], operator->half_pixel_centers);
        for (int x = 0; x < out->size[2]; x++, to += channels) {
            const struct between u = between_of(x, in->size[2], out->size[2], operator->half_pixel_centers);
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

static void run_pad(struct network *network, const struct tflite_operator *operator)
{
    const struct tflite_tensor *in = tensor_at(network, operator->input[0]),
                               *out = tensor_at(network, operator->output);
    const int32_t *before = tensor_at(network, operator->input[1])->integers; // before and after, of each dimension
    const float *values = values_of(network, operator->input[0]);
    float *to = network->values[operator->output];
    memset(to, 0, sizeof *to * out->count);
    for (int y = 0; y < in->size[1]; y++)
        for (int x = 0; x < in->size[2]; x++, values += in->size[3])
            memcpy(
                to + ((size_t)(y + before[2]) * (size_t)out->size[2] + (size_t)(x + before[4])) * (size_t)out->size[3] +
                    before[6],
                values, sizeof *to * (size_t)in->size[3]);
}

static void run_depth_to_space(struct network *network, const struct tflite_operator *operator)
{
    const struct tflite_tensor *in = tensor_at(network, operator->input[0]),
                               *out = tensor_at(network, operator->output);
    const float *values = values_of(network, operator->input[0]);
    float *to = network->values[operator->output];
    const int block = operator->block, channels = out->size[3];
    for (int y = 0; y < out->size[1]; y++)
        for (int x = 0; x < out->size[2]; x++, to += channels)
            memcpy(to,
                   values + ((size_t)(y / block) * (size_t)in->size[2] + (size_t)(x / block)) * (size_t)in->size[3] +
                       (size_t)((y % block * block + x % block) * channels),
                   sizeof *to * (size_t)channels);
}

static void run_concatenation(struct network *network, const struct tflite_operator *operator)
{
    const struct tflite_tensor *out = tensor_at(network, operator->output);
    const int axis = operator->axis<0 ? operator->axis + out->dimensions : operator->axis;
    float *to = network->values[operator->output];
    size_t outer = 1;
    for (int d = 0; d < axis; d++)
        outer *= (size_t)out->size[d];
    for (size_t i = 0; i < outer; i++)
        for (int k = 0; k < operator->input_count; k++) {
            const size_t each = tensor_at(network, operator->input[k])->count / outer;
            memcpy(to, values_of(network, operator->input[k]) + i * each, sizeof *to * each);
            to += each;
        }
}

static void run_add(struct network *network, const struct tflite_operator *operator)
{
    const float *a = values_of(network, operator->input[0]), *b = values_of(network, operator->input[1]);
    const struct range range = range_of(operator->activation);
    float *to = network->values[operator->output];
    for (size_t i = 0; i < tensor_at(network, operator->output)->count; i++)
        to[i] = clamp(a[i] + b[i], range);
}

static void run_logistic(struct network *network, const struct tflite_operator *operator)
{
    const float *values = values_of(network, operator->input[0]);
    for (size_t i = 0; i < tensor_at(network, operator->output)->count; i++)
        network->values[operator->output][i] = (float)(1 / (1 + portable_exp(-(double)values[i])));
}

void network_run(struct network *network)
{
    for (int i = 0; i < network->model.operator_count; i++) {
        const struct tflite_operator *o = &network->model.operators[i];
        switch (o->kind) {
        case TFLITE_CONV_2D: run_convolution(network, i); break;
        case TFLITE_DEPTHWISE_CONV_2D: run_depthwise(network, o); break;
        case TFLITE_MAX_POOL_2D: run_max_pool(network, o); break;
        case TFLITE_RESIZE_BILINEAR: run_resize(network, o); break;
        case TFLITE_PAD: run_pad(network, o); break;
        case TFLITE_DEPTH_TO_SPACE: run_depth_to_space(network, o); break;
        case TFLITE_CONCATENATION: run_concatenation(network, o); break;
        case TFLITE_ADD: run_add(network, o); break;
        case TFLITE_LOGISTIC: run_logistic(network, o); break;
        case TFLITE_RESHAPE:
            memcpy(network->values[o->output], values_of(network, o->input[0]),
                   sizeof(float) * tensor_at(network, o->output)->count);
            break;
        case TFLITE_DEQUANTIZE:
        case TFLITE_DENSIFY: break; // folded when it was read
        }
    }
}

// ---------------------------------------------------------------- checking

static bool is_image(const struct tflite_tensor *tensor) { return tensor->dimensions == 4 && tensor->size[0] == 1; }

// What a convolution or pool makes of `in` elements.
static int out_size(const struct tflite_operator *operator, int in, int filter, int stride)
{
    if (stride < 1 || filter < 1 || stride > 64 || filter > 64)
        return -1;
    return operator->valid_padding ? (in - filter + stride) / stride : (in + stride - 1) / stride;
}

static bool same_shape(const struct tflite_tensor *a, const struct tflite_tensor *b)
{
    return a->dimensions == b->dimensions && !memcmp(a->size, b->size, sizeof a->size[0] * (size_t)a->dimensions);
}

static bool window_fits(const struct tflite_operator *operator, const struct tflite_tensor * in,
                        const struct tflite_tensor *out, int across, int down)
{
    return is_image(in) && is_image(out) && out->size[1] == out_size(operator, in->size[1], down, operator->stride_y) &&
           out->size[2] == out_size(operator, in->size[2], across, operator->stride_x);
}

static bool weights_fit(const struct network *network, const struct tflite_operator *operator)
{
    if (operator->input_count<2 || operator->input[1]<0)
        return false;
    const struct tflite_tensor *in = tensor_at(network, operator->input[0]),
                               *out = tensor_at(network, operator->output);
    const struct tflite_tensor *filter = tensor_at(network, operator->input[1]);
    const bool depthwise = operator->kind == TFLITE_DEPTHWISE_CONV_2D;
    if (!filter->values || filter->dimensions != 4 || !window_fits(operator, in, out, filter->size[2], filter->size[1]))
        return false;
    if (operator->input_count> 2 && operator->input[2] >= 0) {
        const struct tflite_tensor *bias = tensor_at(network, operator->input[2]);
        if (!bias->values || bias->count != (size_t)out->size[3])
            return false;
    } else if (depthwise) {
        return false; // none of the networks is without
    }
    return depthwise ? filter->size[0] == 1 && filter->size[3] == in->size[3] && out->size[3] == in->size[3]
                     : filter->size[0] == out->size[3] && filter->size[3] == in->size[3];
}

static bool padding_fits(const struct network *network, const struct tflite_operator *operator)
{
    const struct tflite_tensor *in = tensor_at(network, operator->input[0]),
                               *out = tensor_at(network, operator->output);
    if (operator->input_count != 2 || operator->input[1]<0 || !is_image(in) || !is_image(out))
        return false;
    const struct tflite_tensor *amounts = tensor_at(network, operator->input[1]);
    bool fits = amounts->integers && amounts->integer_count == 8;
    for (int d = 0; fits && d < 4; d++) {
        const int32_t before = amounts->integers[2 * d], after = amounts->integers[2 * d + 1];
        fits =
            before >= 0 && after >= 0 && before < 1024 && after < 1024 && out->size[d] == in->size[d] + before + after;
    }
    return fits;
}

static bool concatenation_fits(const struct network *network, const struct tflite_operator *operator)
{
    const struct tflite_tensor *out = tensor_at(network, operator->output);
    const int axis = operator->axis<0 ? operator->axis + out->dimensions : operator->axis;
    int together = 0;
    if (axis < 0 || axis >= out->dimensions)
        return false;
    for (int k = 0; k < operator->input_count; k++) {
        if (operator->input[k]<0 || tensor_at(network, operator->input[k])->dimensions != out->dimensions)
            return false;
        for (int d = 0; d < out->dimensions; d++)
            if (d != axis && tensor_at(network, operator->input[k])->size[d] != out->size[d])
                return false;
        together += tensor_at(network, operator->input[k])->size[axis];
    }
    return together == out->size[axis];
}

static bool shapes_fit(const struct network *network, const struct tflite_operator *operator)
{
    const struct tflite_tensor *in = tensor_at(network, operator->input[0]),
                               *out = tensor_at(network, operator->output);
    switch (operator->kind) {
    case TFLITE_CONV_2D:
    case TFLITE_DEPTHWISE_CONV_2D: return weights_fit(network, operator);
    case TFLITE_MAX_POOL_2D:
        return window_fits(operator, in, out, operator->filter_x, operator->filter_y) && in->size[3] == out->size[3];
    case TFLITE_RESIZE_BILINEAR: return is_image(in) && is_image(out) && in->size[3] == out->size[3];
    case TFLITE_PAD: return padding_fits(network, operator);
    case TFLITE_DEPTH_TO_SPACE:
        return operator->block >= 1 && operator->block <= 64 && is_image(in) && is_image(out) &&
               in->size[3] == out->size[3] * operator->block * operator->block && out->size[1] == in->size[1] *
                                             operator->block && out->size[2] == in->size[2] *
                                             operator->block;
    case TFLITE_CONCATENATION: return concatenation_fits(network, operator);
    case TFLITE_ADD:
        return operator->input_count == 2 && operator->input[1] >= 0 && same_shape(in, out) &&
               same_shape(tensor_at(network, operator->input[1]), out);
    case TFLITE_LOGISTIC:
    case TFLITE_RESHAPE: return in->count == out->count;
    case TFLITE_DEQUANTIZE:
    case TFLITE_DENSIFY: return false;
    }
    return false;
}

// Only inputs that hold values, each operator's own output once.
static bool order_fits(const struct network *network, const struct tflite_operator *operator, const bool * ready)
{
    for (int k = 0; k < operator->input_count; k++) {
        const int i = operator->input[k];
        const bool amounts = operator->kind != TFLITE_ADD && operator->kind != TFLITE_CONCATENATION && k> 0;
        if (i >= 0 && !amounts && !ready[i] && !tensor_at(network, i)->values)
            return false;
    }
    return !ready[operator->output] && !tensor_at(network, operator->output)->values && operator->output != network->model.input;
}

// ---------------------------------------------------------------- opening

// Leaves out the operators that no wanted output needs.
static bool keep_needed(struct tflite_model *model, unsigned outputs)
{
    bool *needed = calloc((size_t)model->tensor_count, sizeof *needed);
    if (!needed)
        return false;
    for (int i = 0; i < model->output_count; i++)
        if (outputs >> i & 1)
            needed[model->output[i]] = true;
    int kept = model->operator_count;
    for (int i = model->operator_count - 1; i >= 0; i--) {
        const struct tflite_operator *o = &model->operators[i];
        if (!needed[o->output])
            continue;
        for (int k = 0; k < o->input_count; k++)
            if (o->input[k] >= 0)
                needed[o->input[k]] = true;
        model->operators[--kept] = *o;
    }
    model->operator_count -= kept;
    memmove(model->operators, model->operators + kept, sizeof *model->operators * (size_t)model->operator_count);
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

static enum status prepare_operator(struct network *network, int which, bool *ready, size_t *patch_values)
{
    const struct tflite_operator *o = &network->model.operators[which];
    if (!order_fits(network, o, ready) || !shapes_fit(network, o))
        return ERR_FORMAT;
    ready[o->output] = true;
    const struct tflite_tensor *out = tensor_at(network, o->output);
    if ((network->computed += out->count) > TFLITE_MAX_VALUES)
        return ERR_FORMAT;
    if (!(network->values[o->output] = malloc(sizeof(float) * out->count)))
        return ERR_MEMORY;
    if (o->kind != TFLITE_CONV_2D)
        return OK;
    const struct tflite_tensor *filter = tensor_at(network, o->input[1]);
    const size_t patches = (size_t)out->size[1] * (size_t)out->size[2] * (filter->count / (size_t)filter->size[0]);
    if (patches > TFLITE_MAX_VALUES)
        return ERR_FORMAT;
    *patch_values = patches > *patch_values ? patches : *patch_values;
    const bool has_bias = o->input_count > 2 && o->input[2] >= 0;
    network->weights[which] = pack_weights(filter, has_bias ? tensor_at(network, o->input[2])->values : NULL);
    return network->weights[which] ? OK : ERR_MEMORY;
}

static enum status prepare_network(struct network *network, unsigned outputs)
{
    const struct tflite_model *m = &network->model;
    bool *ready = calloc((size_t)m->tensor_count, sizeof *ready);
    size_t patch_values = 1;
    network->values = calloc((size_t)m->tensor_count, sizeof *network->values);
    network->weights = calloc((size_t)m->operator_count + 1, sizeof *network->weights);
    enum status status = ready && network->values && network->weights ? OK : ERR_MEMORY;
    if (status == OK && tensor_at(network, m->input)->values)
        status = ERR_FORMAT;
    if (status == OK && !(network->values[m->input] = calloc(tensor_at(network, m->input)->count, sizeof(float))))
        status = ERR_MEMORY;
    if (status == OK)
        ready[m->input] = true;
    for (int i = 0; status == OK && i < m->operator_count; i++)
        status = prepare_operator(network, i, ready, &patch_values);
    for (int i = 0; status == OK && i < m->output_count; i++)
        if (outputs >> i & 1 && !ready[m->output[i]])
            status = ERR_FORMAT;
    if (status == OK && !(network->patches = alloc_cache_aligned(sizeof(float) * patch_values)))
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
    enum status status = keep_needed(&n->model, outputs) ? prepare_network(n, outputs) : ERR_MEMORY;
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

float *network_input(struct network *network, size_t *count)
{
    *count = tensor_at(network, network->model.input)->count;
    return network->values[network->model.input];
}

const float *network_output(const struct network *network, int i, size_t *count)
{
    assert(i >= 0 && i < network->model.output_count && network->values[network->model.output[i]]);
    *count = tensor_at(network, network->model.output[i])->count;
    return network->values[network->model.output[i]];
}
