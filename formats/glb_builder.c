#include "formats/glb_builder.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

_Static_assert(__BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__, "glTF's numbers are little-endian");

enum { ALIGN = 4 };

static size_t component_bytes(enum glb_component component)
{
    if (component == GLB_U8)
        return 1;
    return component == GLB_U16 ? 2 : 4;
}

void glb_open(struct glb *glb)
{
    *glb = (struct glb){.root = json_new_object()};
    struct json *asset = json_add_object(glb->root, "asset");
    json_add_string(asset, "version", "2.0");
    json_add_string(asset, "generator", "Reenact");
    glb->views = json_add_array(glb->root, "bufferViews");
    glb->accessors = json_add_array(glb->root, "accessors");
}

void glb_close(struct glb *glb)
{
    json_free(&glb->root);
    free(glb->bytes);
    *glb = (struct glb){0};
}

int glb_add_view(struct glb *glb, const void *bytes, size_t count, enum glb_target target)
{
    const size_t begin = (glb->count + ALIGN - 1) / ALIGN * ALIGN, wanted = begin + count;
    if (wanted > glb->capacity && !glb->failed) {
        const size_t capacity = 2 * wanted;
        uint8_t *grown = realloc(glb->bytes, capacity);
        glb->failed = !grown;
        if (grown) {
            glb->bytes = grown;
            glb->capacity = capacity;
        }
    }
    if (glb->failed)
        return 0;
    memset(glb->bytes + glb->count, 0, begin - glb->count);
    memcpy(glb->bytes + begin, bytes, count);
    glb->count = wanted;
    struct json *view = json_add_object(glb->views, NULL);
    json_add_number(view, "buffer", 0);
    json_add_number(view, "byteOffset", (double)begin);
    json_add_number(view, "byteLength", (double)count);
    if (target)
        json_add_number(view, "target", target);
    return glb->view_count++;
}

static void add_bounds(struct json *accessor, const float *values, int width, int count)
{
    struct json *low = json_add_array(accessor, "min"), *high = json_add_array(accessor, "max");
    for (int k = 0; k < width; k++) {
        float min = values[k], max = values[k];
        for (int i = 1; i < count; i++) {
            min = fminf(min, values[i * width + k]);
            max = fmaxf(max, values[i * width + k]);
        }
        json_push_number(low, (double)min);
        json_push_number(high, (double)max);
    }
}

int glb_add_accessor(struct glb *glb, const void *numbers, const struct glb_layout *layout)
{
    static const char *const types[] = {[1] = "SCALAR", [2] = "VEC2", [3] = "VEC3", [4] = "VEC4", [16] = "MAT4"};
    const size_t bytes = component_bytes(layout->component) * (size_t)layout->width * (size_t)layout->count;
    const int view = glb_add_view(glb, numbers, bytes, layout->target);
    struct json *accessor = json_add_object(glb->accessors, NULL);
    json_add_number(accessor, "bufferView", view);
    json_add_number(accessor, "componentType", layout->component);
    json_add_number(accessor, "count", layout->count);
    json_add_string(accessor, "type", types[layout->width]);
    if (layout->bounds)
        add_bounds(accessor, numbers, layout->width, layout->count);
    return glb->accessor_count++;
}

static uint8_t *put_u32(uint8_t *at, size_t value)
{
    for (int i = 0; i < 4; i++)
        *at++ = (uint8_t)(value >> 8 * i);
    return at;
}

// A chunk's length, type and bytes, filled up to a multiple of four.
static uint8_t *put_chunk(uint8_t *at, const char type[4], const void *bytes, size_t count, int fill)
{
    const size_t padded = (count + ALIGN - 1) / ALIGN * ALIGN;
    at = put_u32(at, padded);
    memcpy(at, type, 4);
    memcpy(at + 4, bytes, count);
    memset(at + 4 + count, fill, padded - count);
    return at + 4 + padded;
}

enum status glb_print(const struct glb *glb, uint8_t **bytes, size_t *count)
{
    enum { HEADER = 12, CHUNK = 8 + ALIGN };
    struct json *buffer = json_add_object(json_add_array(glb->root, "buffers"), NULL);
    json_add_number(buffer, "byteLength", (double)glb->count);
    char *text = glb->failed ? NULL : json_print(glb->root);
    uint8_t *file = text ? malloc(HEADER + 2 * CHUNK + strlen(text) + glb->count) : NULL;
    if (!file) {
        free(text);
        return fail(ERR_MEMORY, "no memory for a glTF file");
    }
    memcpy(file, "glTF", 4);
    put_u32(file + 4, 2);
    uint8_t *at = put_chunk(file + HEADER, "JSON", text, strlen(text), ' ');
    at = put_chunk(at, "BIN\0", glb->bytes, glb->count, 0);
    put_u32(file + 8, (size_t)(at - file));
    free(text);
    *bytes = file;
    *count = (size_t)(at - file);
    return OK;
}
