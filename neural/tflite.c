#include "neural/tflite.h"

#include <stdlib.h>
#include <string.h>

// A file being read. Whatever lies outside it reads as 0 and sets `bad`.
struct reader {
    const uint8_t *bytes;
    size_t count;
    const char *name;
    bool bad;
    size_t values; // of constants so far
};

// A vector in the file: where its elements begin, and how many there are. Empty: not there.
struct vector {
    size_t at;
    uint32_t count;
};

static uint32_t read_number(struct reader *reader, size_t at, size_t bytes)
{
    uint32_t value = 0;
    if (at > reader->count || reader->count - at < bytes) {
        reader->bad = true;
        return 0;
    }
    for (size_t i = 0; i < bytes; i++)
        value |= (uint32_t)reader->bytes[at + i] << (8 * i);
    return value;
}

static uint32_t read_u32(struct reader *reader, size_t at) { return read_number(reader, at, 4); }

// Where field number `field` of the table at `table` lies; 0: it has its default.
static size_t find_field(struct reader *reader, size_t table, int field)
{
    if (!table)
        return 0;
    const int64_t vtable = (int64_t)table - (int32_t)read_u32(reader, table);
    if (vtable < 0 || (uint64_t)vtable >= reader->count) {
        reader->bad = true;
        return 0;
    }
    const uint32_t slot = 4 + 2 * (uint32_t)field;
    if (slot + 2 > read_number(reader, (size_t)vtable, 2))
        return 0;
    const uint32_t offset = read_number(reader, (size_t)vtable + slot, 2);
    return offset ? table + offset : 0;
}

// What the offset at `at` points to.
static size_t follow_offset(struct reader *reader, size_t at)
{
    const size_t to = at + read_u32(reader, at);
    if (to >= reader->count) {
        reader->bad = true;
        return 0;
    }
    return to;
}

static size_t find_table(struct reader *reader, size_t table, int field)
{
    const size_t at = find_field(reader, table, field);
    return at ? follow_offset(reader, at) : 0;
}

static struct vector find_vector(struct reader *reader, size_t table, int field, size_t element_bytes)
{
    const size_t at = find_table(reader, table, field);
    if (!at)
        return (struct vector){0};
    const struct vector v = {at + 4, read_u32(reader, at)};
    if (v.at > reader->count || v.count > (reader->count - v.at) / element_bytes) {
        reader->bad = true;
        return (struct vector){0};
    }
    return v;
}

static int read_int(struct reader *reader, size_t table, int field, int by_default)
{
    const size_t at = find_field(reader, table, field);
    return at ? (int)(int32_t)read_u32(reader, at) : by_default;
}

static int read_byte(struct reader *reader, size_t table, int field, int by_default)
{
    const size_t at = find_field(reader, table, field);
    return at ? (int8_t)read_number(reader, at, 1) : by_default;
}

static enum status fail_unusable_network(const struct reader *reader, const char *what)
{
    return fail(ERR_FORMAT, "%s is no network that can be run here: %s", reader->name, what);
}

// ---------------------------------------------------------------- constants

static float float_from_half(uint16_t half)
{
    const uint32_t sign = (uint32_t)(half & 0x8000) << 16, exponent = (half >> 10) & 31, fraction = half & 1023;
    if (!exponent) { // zero and what is below 2^-14
        const float value = (float)fraction * 0x1p-24f;
        return sign ? -value : value;
    }
    const uint32_t bits = sign | (exponent == 31 ? 0x7f800000u : (exponent + 112) << 23) | fraction << 13;
    float value;
    memcpy(&value, &bits, sizeof value);
    return value;
}

enum { FLOAT32 = 0, FLOAT16 = 1, INT32 = 2 };

// The stored values as floats, a new array. NULL: no memory.
static float *expand_floats(struct reader *reader, struct vector data, int type, size_t count)
{
    float *values = malloc(sizeof *values * (count ? count : 1));
    for (size_t i = 0; values && i < count; i++) {
        if (type == FLOAT16) {
            values[i] = float_from_half((uint16_t)read_number(reader, data.at + 2 * i, 2));
        } else {
            const uint32_t bits = read_u32(reader, data.at + 4 * i);
            memcpy(&values[i], &bits, sizeof bits);
        }
    }
    return values;
}

// Block sparsity as TensorFlow Lite stores it: levels, outermost first, each dense or compressed (CSR). The last levels
// are a block's own dimensions.
enum { MAX_LEVELS = 8 };

struct level {
    bool compressed;
    int size;                        // of a dense one
    struct vector segments, indices; // of a compressed one
    int segment_bytes, index_bytes;
    int axis, scale; // what one step means in the tensor: so many elements along that axis
};

struct sparsity {
    struct reader *reader;
    const struct tflite_tensor *tensor;
    const float *stored;
    size_t stored_count;
    float *dense;
    struct level level[MAX_LEVELS];
    int level_count;
    uint64_t steps; // so far; a hostile file could repeat itself level by level
};

static int element_bytes(int type)
{
    switch (type) {
    case 1: return 4;
    case 2: return 2;
    case 3: return 1;
    default: return 0;
    }
}

static struct vector read_indices(struct reader *reader, size_t metadata, int type_field, int *bytes)
{
    *bytes = element_bytes(read_byte(reader, metadata, type_field, 0));
    if (!*bytes) {
        reader->bad = true;
        return (struct vector){0};
    }
    return find_vector(reader, find_table(reader, metadata, type_field + 1), 0, (size_t)*bytes);
}

static uint32_t index_at(struct reader *reader, struct vector vector, int bytes, uint64_t i)
{
    if (i >= vector.count) {
        reader->bad = true;
        return 0;
    }
    return read_number(reader, vector.at + (size_t)i * (size_t)bytes, (size_t)bytes);
}

static enum status read_levels(struct sparsity *sparsity, size_t table)
{
    struct reader *r = sparsity->reader;
    const struct vector order = find_vector(r, table, 0, 4), blocks = find_vector(r, table, 1, 4);
    const struct vector metadata = find_vector(r, table, 2, 4);
    const int dimensions = sparsity->tensor->dimensions;
    if (order.count != metadata.count || metadata.count > MAX_LEVELS ||
        metadata.count != (uint32_t)dimensions + blocks.count)
        return fail_unusable_network(r, "its sparsity is not as it should be");
    sparsity->level_count = (int)metadata.count;
    int block_size[TFLITE_MAX_DIMENSIONS] = {1, 1, 1, 1}, axis_of_block[MAX_LEVELS] = {0};
    for (uint32_t i = 0; i < metadata.count; i++) {
        struct level *l = &sparsity->level[i];
        const size_t m = follow_offset(r, metadata.at + 4 * (size_t)i);
        l->compressed = read_byte(r, m, 0, 0) == 1;
        l->size = read_int(r, m, 1, 0);
        if (l->compressed) {
            l->segments = read_indices(r, m, 2, &l->segment_bytes);
            l->indices = read_indices(r, m, 4, &l->index_bytes);
        }
    }
    for (uint32_t b = 0; b < blocks.count; b++) {
        const uint32_t axis = read_u32(r, blocks.at + 4 * (size_t)b);
        const int size = sparsity->level[dimensions + (int)b].size;
        if (axis >= (uint32_t)dimensions || size < 1 || size > 64)
            return fail_unusable_network(r, "its blocks are not as they should be");
        axis_of_block[b] = (int)axis;
        block_size[axis] = size;
    }
    for (uint32_t i = 0; i < order.count; i++) {
        const uint32_t o = read_u32(r, order.at + 4 * (size_t)i);
        if (o >= metadata.count)
            return fail_unusable_network(r, "its sparsity is not as it should be");
        const bool inside_block = o >= (uint32_t)dimensions;
        sparsity->level[i].axis = inside_block ? axis_of_block[o - (uint32_t)dimensions] : (int)o;
        sparsity->level[i].scale = inside_block ? 1 : block_size[o];
        if (!sparsity->level[i].compressed &&
            (sparsity->level[i].size < 0 || sparsity->level[i].size > TFLITE_MAX_VALUES))
            return fail_unusable_network(r, "its sparsity is not as it should be");
    }
    return r->bad ? fail_unusable_network(r, "it is damaged") : OK;
}

// Puts what level `depth` and those below it hold into the dense array. position: which element of this level; at:
// where in the tensor the levels above it are.
static void fill_dense(struct sparsity *sparsity, int depth, uint64_t position, const int at[TFLITE_MAX_DIMENSIONS])
{
    struct reader *r = sparsity->reader;
    if (r->bad)
        return;
    if (depth == sparsity->level_count) {
        size_t to = 0;
        for (int d = 0; d < sparsity->tensor->dimensions; d++) {
            if (at[d] < 0 || at[d] >= sparsity->tensor->size[d]) {
                r->bad = true;
                return;
            }
            to = to * (size_t)sparsity->tensor->size[d] + (size_t)at[d];
        }
        if (position >= sparsity->stored_count)
            r->bad = true;
        else
            sparsity->dense[to] = sparsity->stored[position];
        return;
    }
    const struct level *l = &sparsity->level[depth];
    uint64_t first = position * (uint64_t)l->size, count = (uint64_t)l->size;
    if (l->compressed) {
        first = index_at(r, l->segments, l->segment_bytes, position);
        const uint64_t end = index_at(r, l->segments, l->segment_bytes, position + 1);
        if (end < first || end > l->indices.count) {
            r->bad = true;
            return;
        }
        count = end - first;
    } else if (first + count > TFLITE_MAX_VALUES) {
        r->bad = true;
        return;
    }
    for (uint64_t i = 0; i < count && !r->bad; i++) {
        if (++sparsity->steps > (uint64_t)MAX_LEVELS * (sparsity->stored_count + 1)) {
            r->bad = true;
            return;
        }
        int inner[TFLITE_MAX_DIMENSIONS];
        memcpy(inner, at, sizeof inner);
        const uint64_t step = l->compressed ? index_at(r, l->indices, l->index_bytes, first + i) : i;
        const int64_t place = inner[l->axis] + (int64_t)step * l->scale;
        if (place >= sparsity->tensor->size[l->axis]) {
            r->bad = true; // also what keeps the recursion within the tensor's own size
            return;
        }
        inner[l->axis] = (int)place;
        fill_dense(sparsity, depth + 1, first + i, inner);
    }
}

static enum status expand_sparse(struct reader *reader, struct tflite_tensor *tensor, size_t table, size_t stored_count)
{
    static const int origin[TFLITE_MAX_DIMENSIONS] = {0};
    struct sparsity s = {.reader = reader, .tensor = tensor, .stored = tensor->values, .stored_count = stored_count};
    enum status status = read_levels(&s, table);
    if (status != OK)
        return status;
    if (!(s.dense = calloc(tensor->count ? tensor->count : 1, sizeof *s.dense)))
        return fail(ERR_MEMORY, "no memory for the network %s", reader->name);
    fill_dense(&s, 0, 0, origin);
    free(tensor->values);
    tensor->values = s.dense;
    return reader->bad ? fail_unusable_network(reader, "its sparsity is damaged") : OK;
}

static enum status read_constant(struct reader *reader, struct tflite_tensor *tensor, struct vector data, int type,
                                 size_t sparsity)
{
    if (type == INT32) {
        tensor->integer_count = data.count / 4;
        if (!(tensor->integers = malloc(4 * (tensor->integer_count ? tensor->integer_count : 1))))
            return fail(ERR_MEMORY, "no memory for the network %s", reader->name);
        for (size_t i = 0; i < tensor->integer_count; i++)
            tensor->integers[i] = (int32_t)read_u32(reader, data.at + 4 * i);
        return OK;
    }
    if (type != FLOAT32 && type != FLOAT16)
        return fail_unusable_network(reader, "it is quantised");
    const size_t stored = data.count / (type == FLOAT16 ? 2 : 4);
    reader->values += stored + tensor->count;
    if (reader->values > TFLITE_MAX_VALUES)
        return fail_unusable_network(reader, "it is too large");
    if (!sparsity && stored != tensor->count)
        return fail_unusable_network(reader, "a constant has not the size it says");
    if (!(tensor->values = expand_floats(reader, data, type, stored)))
        return fail(ERR_MEMORY, "no memory for the network %s", reader->name);
    return sparsity ? expand_sparse(reader, tensor, sparsity, stored) : OK;
}

static enum status read_tensor(struct reader *reader, size_t table, struct vector buffers, struct tflite_tensor *tensor)
{
    const struct vector shape = find_vector(reader, table, 0, 4);
    if (shape.count > TFLITE_MAX_DIMENSIONS)
        return fail_unusable_network(reader, "a tensor has too many dimensions");
    tensor->dimensions = (int)shape.count;
    tensor->count = 1;
    for (uint32_t i = 0; i < shape.count; i++) {
        tensor->size[i] = (int)(int32_t)read_u32(reader, shape.at + 4 * (size_t)i);
        if (tensor->size[i] < 1 || (size_t)tensor->size[i] > TFLITE_MAX_VALUES / tensor->count)
            return fail_unusable_network(reader, "a tensor is empty or too large");
        tensor->count *= (size_t)tensor->size[i];
    }
    const uint32_t buffer = (uint32_t)read_int(reader, table, 2, 0);
    if (buffer >= buffers.count)
        return fail_unusable_network(reader, "a tensor's buffer is not there");
    const struct vector data = find_vector(reader, follow_offset(reader, buffers.at + 4 * (size_t)buffer), 0, 1);
    return data.count
               ? read_constant(reader, tensor, data, read_byte(reader, table, 1, 0), find_table(reader, table, 6))
               : OK;
}

// ---------------------------------------------------------------- operators

static void read_options(struct reader *reader, size_t options, struct tflite_operator *operator)
{
    switch (operator->kind) {
    case TFLITE_CONV_2D:
    case TFLITE_DEPTHWISE_CONV_2D:
        operator->valid_padding = read_byte(reader, options, 0, 0) == 1;
        operator->stride_x = read_int(reader, options, 1, 0);
        operator->stride_y = read_int(reader, options, 2, 0);
        operator->activation =(enum tflite_activation)
            read_byte(reader, options, operator->kind == TFLITE_CONV_2D ? 3 : 4, 0);
        // Dilation, fields 4 and 5 or 5 and 6, is 1 unless it says otherwise.
        for (int i = 0; i < 2; i++)
            if (read_int(reader, options, (operator->kind == TFLITE_CONV_2D ? 4 : 5) + i, 1) != 1)
                reader->bad = true;
        break;
    case TFLITE_MAX_POOL_2D:
        operator->valid_padding = read_byte(reader, options, 0, 0) == 1;
        operator->stride_x = read_int(reader, options, 1, 0);
        operator->stride_y = read_int(reader, options, 2, 0);
        operator->filter_x = read_int(reader, options, 3, 0);
        operator->filter_y = read_int(reader, options, 4, 0);
        operator->activation =(enum tflite_activation) read_byte(reader, options, 5, 0);
        break;
    case TFLITE_ADD: operator->activation =(enum tflite_activation) read_byte(reader, options, 0, 0); break;
    case TFLITE_CONCATENATION: operator->axis = read_int(reader, options, 0, 0); break;
    case TFLITE_RESIZE_BILINEAR:
        operator->half_pixel_centers = read_byte(reader, options, 3, 0) == 1;
        if (read_byte(reader, options, 2, 0)) // corners on corners
            reader->bad = true;
        break;
    case TFLITE_DEPTH_TO_SPACE: operator->block = read_int(reader, options, 0, 0); break;
    default: break;
    }
}

static bool is_known(int kind)
{
    switch (kind) {
    case TFLITE_ADD:
    case TFLITE_CONCATENATION:
    case TFLITE_CONV_2D:
    case TFLITE_DEPTHWISE_CONV_2D:
    case TFLITE_DEPTH_TO_SPACE:
    case TFLITE_DEQUANTIZE:
    case TFLITE_LOGISTIC:
    case TFLITE_MAX_POOL_2D:
    case TFLITE_RESHAPE:
    case TFLITE_RESIZE_BILINEAR:
    case TFLITE_PAD:
    case TFLITE_DENSIFY: return true;
    default: return false;
    }
}

static enum status read_operator(struct reader *reader, size_t table, struct vector codes,
                                 const struct tflite_model *model, struct tflite_operator *operator)
{
    const uint32_t code = (uint32_t)read_int(reader, table, 0, 0);
    if (code >= codes.count)
        return fail_unusable_network(reader, "an operator's kind is not there");
    const size_t kind_table = follow_offset(reader, codes.at + 4 * (size_t)code);
    const int old_kind = read_byte(reader, kind_table, 0, 0), new_kind = read_int(reader, kind_table, 3, 0);
    const int kind = old_kind > new_kind ? old_kind : new_kind; // old files have the first field alone
    if (!is_known(kind))
        return fail(ERR_FORMAT, "%s is no network that can be run here: it has an operator of kind %d", reader->name,
                    kind);
    *operator=(struct tflite_operator){.kind = (enum tflite_kind)kind};
    const struct vector inputs = find_vector(reader, table, 1, 4), outputs = find_vector(reader, table, 2, 4);
    if (!inputs.count || inputs.count > TFLITE_MAX_INPUTS || outputs.count != 1)
        return fail_unusable_network(reader, "an operator has too few or too many inputs or outputs");
    operator->input_count =(int) inputs.count;
    for (uint32_t i = 0; i < inputs.count; i++) {
        operator->input[i] =(int)(int32_t) read_u32(reader, inputs.at + 4 * (size_t)i);
        if (operator->input[i]<(i ? -1 : 0) || operator->input[i] >= model->tensor_count)
            return fail_unusable_network(reader, "an operator's input is not there");
    }
    operator->output =(int)(int32_t) read_u32(reader, outputs.at);
    if (operator->output<0 || operator->output >= model->tensor_count)
        return fail_unusable_network(reader, "an operator's output is not there");
    read_options(reader, find_table(reader, table, 4), operator);
    return reader->bad ? fail_unusable_network(reader, "an operator is damaged or of a kind that is not supported")
                       : OK;
}

// A constant that only changes its form has been expanded when it was read: its values move on to the output. False: it
// is to be run.
static bool fold_constant(struct tflite_model *model, const struct tflite_operator *operator)
{
    struct tflite_tensor *from = &model->tensors[operator->input[0]], *to = &model->tensors[operator->output];
    if ((operator->kind != TFLITE_DEQUANTIZE && operator->kind != TFLITE_DENSIFY) || !from->values || to->values ||
        from->count != to->count)
        return false;
    to->values = from->values;
    from->values = NULL;
    return true;
}

static enum status read_operators(struct reader *reader, size_t graph, struct vector codes, struct tflite_model *model)
{
    const struct vector operators = find_vector(reader, graph, 3, 4);
    if (!operators.count || operators.count > TFLITE_MAX_TABLE)
        return fail_unusable_network(reader, "it has no operators, or too many");
    if (!(model->operators = calloc(operators.count, sizeof *model->operators)))
        return fail(ERR_MEMORY, "no memory for the network %s", reader->name);
    for (uint32_t i = 0; i < operators.count; i++) {
        struct tflite_operator o;
        enum status status =
            read_operator(reader, follow_offset(reader, operators.at + 4 * (size_t)i), codes, model, &o);
        if (status != OK)
            return status;
        if (fold_constant(model, &o))
            continue;
        if (o.kind == TFLITE_DEQUANTIZE || o.kind == TFLITE_DENSIFY)
            return fail_unusable_network(reader, "it expands what is no constant");
        model->operators[model->operator_count++] = o;
    }
    return OK;
}

static enum status read_tensors(struct reader *reader, size_t graph, struct vector buffers, struct tflite_model *model)
{
    const struct vector tensors = find_vector(reader, graph, 0, 4);
    if (!tensors.count || tensors.count > TFLITE_MAX_TABLE)
        return fail_unusable_network(reader, "it has no tensors, or too many");
    if (!(model->tensors = calloc(tensors.count, sizeof *model->tensors)))
        return fail(ERR_MEMORY, "no memory for the network %s", reader->name);
    model->tensor_count = (int)tensors.count;
    enum status status = OK;
    for (uint32_t i = 0; status == OK && i < tensors.count; i++)
        status = read_tensor(reader, follow_offset(reader, tensors.at + 4 * (size_t)i), buffers, &model->tensors[i]);
    return status;
}

static enum status read_ends(struct reader *reader, size_t graph, struct tflite_model *model)
{
    const struct vector inputs = find_vector(reader, graph, 1, 4), outputs = find_vector(reader, graph, 2, 4);
    if (inputs.count != 1 || !outputs.count || outputs.count > TFLITE_MAX_OUTPUTS)
        return fail_unusable_network(reader, "it has not one input, or no outputs");
    model->input = (int)(int32_t)read_u32(reader, inputs.at);
    model->output_count = (int)outputs.count;
    bool inside = model->input >= 0 && model->input < model->tensor_count;
    for (uint32_t i = 0; i < outputs.count; i++) {
        model->output[i] = (int)(int32_t)read_u32(reader, outputs.at + 4 * (size_t)i);
        inside = inside && model->output[i] >= 0 && model->output[i] < model->tensor_count;
    }
    return inside ? OK : fail_unusable_network(reader, "its input or output is not there");
}

enum status tflite_read(struct tflite_model *out, const char *name, const uint8_t *bytes, size_t count)
{
    *out = (struct tflite_model){0};
    struct reader r = {.bytes = bytes, .count = count, .name = name};
    if (count < 8 || memcmp(bytes + 4, "TFL3", 4))
        return fail_unusable_network(&r, "it is no TensorFlow Lite file");
    const size_t root = follow_offset(&r, 0);
    const struct vector codes = find_vector(&r, root, 1, 4), graphs = find_vector(&r, root, 2, 4);
    const struct vector buffers = find_vector(&r, root, 4, 4);
    if (graphs.count != 1 || buffers.count > TFLITE_MAX_TABLE)
        return fail_unusable_network(&r, "it has not one graph");
    const size_t graph = follow_offset(&r, graphs.at);
    enum status status = read_tensors(&r, graph, buffers, out);
    if (status == OK)
        status = read_operators(&r, graph, codes, out);
    if (status == OK)
        status = read_ends(&r, graph, out);
    if (status == OK && r.bad)
        status = fail_unusable_network(&r, "it is damaged");
    if (status != OK)
        tflite_free(out);
    return status;
}

void tflite_free(struct tflite_model *model)
{
    for (int i = 0; i < model->tensor_count; i++) {
        free(model->tensors[i].values);
        free(model->tensors[i].integers);
    }
    free(model->tensors);
    free(model->operators);
    *model = (struct tflite_model){0};
}
