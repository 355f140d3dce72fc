#include "tests/support/tflite_file.h"

#include <string.h>

struct writer {
    uint8_t *bytes;
    size_t count;
};

// A field of a table: 1 or 4 bytes of value, or (offset) 4 bytes to be pointed later; width 0: left out.
struct field {
    int width;
    uint32_t value;
};

static void put(struct writer *w, size_t at, uint32_t value, int width)
{
    for (int i = 0; i < width; i++)
        w->bytes[at + (size_t)i] = (uint8_t)(value >> (8 * i));
}

static size_t reserve(struct writer *w, size_t bytes, size_t alignment)
{
    while (w->count % alignment)
        w->bytes[w->count++] = 0;
    assert(w->count + bytes <= TFLITE_FILE_MOST);
    const size_t at = w->count;
    memset(w->bytes + at, 0, bytes);
    w->count += bytes;
    return at;
}

static void point(struct writer *w, size_t from, size_t to) { put(w, from, (uint32_t)(to - from), 4); }

// A vtable and its table; where the table begins. Field i lies at table + 4 + 4 i.
static size_t table(struct writer *w, const struct field *fields, int count)
{
    const size_t vtable = reserve(w, 4 + 2 * (size_t)count, 4), at = reserve(w, 4 + 4 * (size_t)count, 4);
    put(w, vtable, 4 + 2 * (uint32_t)count, 2);
    put(w, vtable + 2, 4 + 4 * (uint32_t)count, 2);
    put(w, at, (uint32_t)(at - vtable), 4);
    for (int i = 0; i < count; i++)
        if (fields[i].width) {
            put(w, vtable + 4 + 2 * (size_t)i, 4 + 4 * (uint32_t)i, 2);
            put(w, at + 4 + 4 * (size_t)i, fields[i].value, fields[i].width);
        }
    return at;
}

static size_t slot(size_t table_at, int field) { return table_at + 4 + 4 * (size_t)field; }

// A vector of 4-byte numbers that `from` points to; where its elements begin.
static size_t vector(struct writer *w, size_t from, const int *values, int count)
{
    const size_t at = reserve(w, 4 + 4 * (size_t)count, 4);
    point(w, from, at);
    put(w, at, (uint32_t)count, 4);
    for (int i = 0; values && i < count; i++)
        put(w, at + 4 + 4 * (size_t)i, (uint32_t)values[i], 4);
    return at + 4;
}

static void index_vector(struct writer *w, size_t metadata, int field, const int32_t *values, int count)
{
    const size_t holder = table(w, (struct field[]){{4, 0}}, 1);
    point(w, slot(metadata, field), holder);
    vector(w, slot(holder, 0), values, count);
}

static void write_sparsity(struct writer *w, size_t from, const struct tflite_file_tensor *t)
{
    const struct field all[] = {{4, 0}, {0, 0}, {4, 0}};
    const size_t at = table(w, all, 3);
    point(w, from, at);
    vector(w, slot(at, 0), (const int[]){0, 1}, 2); // rows, then columns
    const size_t levels = vector(w, slot(at, 2), NULL, 2);
    const size_t rows = table(w, (const struct field[]){{1, 0}, {4, (uint32_t)t->size[0]}}, 2);
    point(w, levels, rows);
    const struct field compressed[] = {{1, 1}, {4, 0}, {1, 1}, {4, 0}, {1, 1}, {4, 0}};
    const size_t columns = table(w, compressed, 6);
    point(w, levels + 4, columns);
    index_vector(w, columns, 3, t->segments, t->segment_count);
    index_vector(w, columns, 5, t->indices, t->index_count);
}

static void write_tensor(struct writer *w, size_t from, const struct tflite_file_tensor *t, int buffer)
{
    const struct field fields[] = {{4, 0}, {1, (uint32_t)t->type},  {4, (uint32_t)buffer}, {0, 0}, {0, 0},
                                   {0, 0}, {t->segments ? 4 : 0, 0}};
    const size_t at = table(w, fields, 7);
    point(w, from, at);
    vector(w, slot(at, 0), t->size, t->dimensions);
    if (t->segments)
        write_sparsity(w, slot(at, 6), t);
}

static void write_operator(struct writer *w, size_t from, const struct tflite_file_operator *o, int code)
{
    const struct field fields[] = {{4, (uint32_t)code}, {4, 0}, {4, 0}, {0, 0}, {4, 0}};
    const size_t at = table(w, fields, 5);
    point(w, from, at);
    vector(w, slot(at, 1), o->inputs, o->input_count);
    vector(w, slot(at, 2), &o->output, 1);
    struct field options[8];
    for (int i = 0; i < 8; i++)
        options[i] = (struct field){o->option[i].width, (uint32_t)o->option[i].value};
    point(w, slot(at, 4), table(w, options, 8));
}

size_t tflite_file_write(const struct tflite_file *f, uint8_t *out)
{
    struct writer w = {out, 0};
    reserve(&w, 8, 4);
    memcpy(out + 4, "TFL3", 4);
    const struct field root[] = {{4, 3}, {4, 0}, {4, 0}, {0, 0}, {4, 0}};
    const size_t model = table(&w, root, 5);
    point(&w, 0, model);
    const size_t codes = vector(&w, slot(model, 1), NULL, f->op_count);
    for (int i = 0; i < f->op_count; i++) {
        const struct field code[] = {{1, (uint32_t)f->op[i].kind}, {0, 0}, {0, 0}, {4, (uint32_t)f->op[i].kind}};
        point(&w, codes + 4 * (size_t)i, table(&w, code, 4));
    }
    const size_t graphs = vector(&w, slot(model, 2), NULL, 1);
    const struct field graph_fields[] = {{4, 0}, {4, 0}, {4, 0}, {4, 0}};
    const size_t graph = table(&w, graph_fields, 4);
    point(&w, graphs, graph);
    const size_t tensors = vector(&w, slot(graph, 0), NULL, f->tensor_count);
    for (int i = 0; i < f->tensor_count; i++)
        write_tensor(&w, tensors + 4 * (size_t)i, &f->tensor[i], i + 1);
    vector(&w, slot(graph, 1), &f->input, 1);
    vector(&w, slot(graph, 2), &f->output, 1);
    const size_t operators = vector(&w, slot(graph, 3), NULL, f->op_count);
    for (int i = 0; i < f->op_count; i++)
        write_operator(&w, operators + 4 * (size_t)i, &f->op[i], i);
    const size_t buffers = vector(&w, slot(model, 4), NULL, f->tensor_count + 1);
    for (int i = 0; i <= f->tensor_count; i++) {
        const struct tflite_file_tensor *t = i ? &f->tensor[i - 1] : NULL;
        const bool has_data = t && t->data;
        const size_t buffer = table(&w, (const struct field[]){{has_data ? 4 : 0, 0}}, 1);
        point(&w, buffers + 4 * (size_t)i, buffer);
        if (has_data) {
            const size_t data = reserve(&w, 4 + t->bytes, 4);
            point(&w, slot(buffer, 0), data);
            put(&w, data, (uint32_t)t->bytes, 4);
            memcpy(out + data + 4, t->data, t->bytes);
        }
    }
    return w.count;
}
