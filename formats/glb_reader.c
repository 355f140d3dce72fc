#include "formats/glb_reader.h"

#include "platform/files/json.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { HEADER = 12, CHUNK = 8, JSON_CHUNK = 0x4e4f534a, BINARY_CHUNK = 0x004e4942 };

enum { MAX_DEPTH = 16 }; // of nodes

struct file {
    const struct json *root;
    const uint8_t *bytes; // of the binary chunk
    size_t count;
    struct glb_model *out;
    int capacity; // of out->corners
    int visited;  // nodes and primitives
};

static uint32_t u32_at(const uint8_t *p)
{
    return p[0] | (uint32_t)p[1] << 8 | (uint32_t)p[2] << 16 | (uint32_t)p[3] << 24;
}

// A member that is a whole number from 0 to 2^31 - 1; `otherwise` where there is none.
static int64_t whole_number(const struct json *object, const char *name, int64_t otherwise)
{
    double value;
    if (!json_get_number(json_member(object, name), &value))
        return otherwise;
    return value >= 0 && value <= INT32_MAX && value == floor(value) ? (int64_t)value : -1;
}

static const struct json *list_item(const struct file *file, const char *list, int64_t index)
{
    const struct json *array = json_member(file->root, list);
    return index >= 0 && json_is_array(array) ? json_at(array, (int)index) : NULL;
}

// ---------------------------------------------------------------- buffers

struct span {
    const uint8_t *bytes;
    size_t count;
};

static bool view_span(const struct file *file, int64_t view, struct span *out, int64_t *stride)
{
    const struct json *json = list_item(file, "bufferViews", view);
    const int64_t buffer = whole_number(json, "buffer", -1), offset = whole_number(json, "byteOffset", 0),
                  length = whole_number(json, "byteLength", -1);
    *stride = whole_number(json, "byteStride", 0);
    if (!file->bytes || !json || buffer != 0 || offset < 0 || length < 0 || *stride < 0 ||
        (uint64_t)(offset + length) > file->count)
        return false;
    *out = (struct span){file->bytes + offset, (size_t)length};
    return true;
}

struct accessor {
    const uint8_t *bytes;
    int64_t count, stride;
    int component, width; // glTF's number of the component's type; components of an element
};

static int component_bytes(int type)
{
    switch (type) {
    case 5121: return 1; // unsigned
    case 5123: return 2;
    case 5125: return 4;
    case 5126: return 4; // float
    default: return 0;
    }
}

static bool open_accessor(const struct file *file, int64_t index, struct accessor *out)
{
    static const char *const types[] = {"SCALAR", "VEC2", "VEC3", "VEC4"};
    const struct json *json = list_item(file, "accessors", index);
    const char *type = "";
    struct span span;
    int64_t stride;
    if (!json || json_member(json, "sparse") ||
        !view_span(file, whole_number(json, "bufferView", -1), &span, &stride) ||
        !json_get_string(json_member(json, "type"), &type))
        return false;
    *out = (struct accessor){.count = whole_number(json, "count", -1),
                             .component = (int)whole_number(json, "componentType", -1)};
    for (int i = 0; i < 4; i++)
        if (!strcmp(type, types[i]))
            out->width = i + 1;
    const int64_t element = (int64_t)component_bytes(out->component) * out->width,
                  offset = whole_number(json, "byteOffset", 0);
    out->stride = stride ? stride : element;
    if (!element || offset < 0 || out->count < 1 || out->stride < element ||
        (uint64_t)offset + (uint64_t)(out->count - 1) * (uint64_t)out->stride + (uint64_t)element > span.count)
        return false;
    out->bytes = span.bytes + offset;
    return true;
}

static float component_at(const struct accessor *accessor, int64_t index, int k)
{
    const uint8_t *p = accessor->bytes + index * accessor->stride + (int64_t)k * component_bytes(accessor->component);
    const uint32_t bits = accessor->component == 5126 || accessor->component == 5125 ? u32_at(p) : 0;
    float value;
    switch (accessor->component) {
    case 5121: return (float)p[0] / 255;
    case 5123: return (float)(p[0] | p[1] << 8) / 65535;
    case 5126: memcpy(&value, &bits, sizeof value); return value;
    default: return 0;
    }
}

static int64_t index_at(const struct accessor *accessor, int64_t i)
{
    const uint8_t *p = accessor->bytes + i * accessor->stride;
    if (accessor->component == 5121)
        return p[0];
    return accessor->component == 5123 ? p[0] | p[1] << 8 : (int64_t)u32_at(p);
}

// ---------------------------------------------------------------- materials

static enum status read_picture(const struct file *file, const struct json *texture_info, struct image *out)
{
    const struct json *texture = list_item(file, "textures", whole_number(texture_info, "index", -1));
    const struct json *image = list_item(file, "images", whole_number(texture, "source", -1));
    struct span span;
    int64_t stride;
    if (!image || !view_span(file, whole_number(image, "bufferView", -1), &span, &stride))
        return OK; // a picture outside of the file is not fetched
    const enum status status = image_decode(span.bytes, span.count, "the model's picture", out);
    if (status == OK && (out->width > GLB_MAX_TEXTURE || out->height > GLB_MAX_TEXTURE)) {
        free(out->rgb);
        *out = (struct image){0};
        return fail(ERR_INPUT, "the model's picture is larger than %d pixels", (int)GLB_MAX_TEXTURE);
    }
    return status;
}

static enum status read_material(const struct file *file, int64_t index, struct glb_part *part)
{
    const struct json *material = list_item(file, "materials", index),
                      *pbr = json_member(material, "pbrMetallicRoughness");
    const struct json *factor = json_member(pbr, "baseColorFactor");
    double value;
    for (int i = 0; i < 4; i++) {
        part->color[i] = 1;
        if (json_is_array(factor) && i < json_count(factor) && json_get_number(json_at(factor, i), &value))
            part->color[i] = (float)fmin(fmax(value, 0), 1);
    }
    (void)json_get_bool(json_member(material, "doubleSided"), &part->two_sided);
    const struct json *picture = json_member(pbr, "baseColorTexture");
    return picture ? read_picture(file, picture, &part->picture) : OK;
}

// ---------------------------------------------------------------- geometry

struct map { // 3 x 4, columns as glTF orders them
    double m[12];
};

static void apply_map(const struct map *map, const float in[3], double w, float out[3])
{
    for (int r = 0; r < 3; r++)
        out[r] = (float)(map->m[r] * (double)in[0] + map->m[3 + r] * (double)in[1] + map->m[6 + r] * (double)in[2] +
                         w * map->m[9 + r]);
}

static struct map chain_maps(const struct map *a, const struct map *b)
{
    struct map out;
    for (int c = 0; c < 4; c++)
        for (int r = 0; r < 3; r++) {
            double sum = c == 3 ? a->m[9 + r] : 0;
            for (int k = 0; k < 3; k++)
                sum += a->m[3 * k + r] * b->m[3 * c + k];
            out.m[3 * c + r] = sum;
        }
    return out;
}

static bool read_numbers(const struct json *list, int count, double *out)
{
    if (!json_is_array(list) || json_count(list) != count)
        return false;
    for (int i = 0; i < count; i++)
        if (!json_get_number(json_at(list, i), &out[i]))
            return false;
    return true;
}

static struct map node_map(const struct json *node)
{
    double m[16], t[3] = {0, 0, 0}, q[4] = {0, 0, 0, 1}, s[3] = {1, 1, 1};
    struct map out;
    if (read_numbers(json_member(node, "matrix"), 16, m)) {
        for (int c = 0; c < 4; c++)
            for (int r = 0; r < 3; r++)
                out.m[3 * c + r] = m[4 * c + r];
        return out;
    }
    (void)read_numbers(json_member(node, "translation"), 3, t);
    (void)read_numbers(json_member(node, "rotation"), 4, q);
    (void)read_numbers(json_member(node, "scale"), 3, s);
    const double x = q[0], y = q[1], z = q[2], w = q[3];
    const double r[9] = {1 - 2 * (y * y + z * z), 2 * (x * y + w * z),     2 * (x * z - w * y),
                         2 * (x * y - w * z),     1 - 2 * (x * x + z * z), 2 * (y * z + w * x),
                         2 * (x * z + w * y),     2 * (y * z - w * x),     1 - 2 * (x * x + y * y)};
    for (int i = 0; i < 9; i++)
        out.m[i] = r[i] * s[i / 3];
    memcpy(&out.m[9], t, sizeof t);
    return out;
}

static bool add_corner(struct file *file, const struct glb_corner *corner)
{
    struct glb_model *m = file->out;
    if (m->corner_count == file->capacity) {
        const int capacity = file->capacity ? 2 * file->capacity : 1024;
        struct glb_corner *grown = realloc(m->corners, sizeof *grown * (size_t)capacity);
        if (!grown)
            return false;
        m->corners = grown;
        file->capacity = capacity;
    }
    m->corners[m->corner_count++] = *corner;
    return true;
}

static bool normalize_vector(float v[3])
{
    const float length = sqrtf(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
    if (!(length > 1e-20F) || !isfinite(length))
        return false;
    for (int k = 0; k < 3; k++)
        v[k] /= length;
    return true;
}

// The face's own normal for corners without one.
static void face_normal(struct glb_corner corner[3])
{
    float a[3], b[3], n[3];
    for (int k = 0; k < 3; k++)
        a[k] = corner[1].at[k] - corner[0].at[k], b[k] = corner[2].at[k] - corner[0].at[k];
    for (int k = 0; k < 3; k++)
        n[k] = a[(k + 1) % 3] * b[(k + 2) % 3] - a[(k + 2) % 3] * b[(k + 1) % 3];
    const bool good = normalize_vector(n);
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 3 && !normalize_vector(corner[i].normal); k++)
            memcpy(corner[i].normal, good ? n : (float[3]){0, 1, 0}, sizeof n);
}

struct primitive {
    struct accessor at, normal, uv, indices;
    bool has_normal, has_uv, has_indices;
};

static bool open_primitive(const struct file *file, const struct json *json, struct primitive *out)
{
    const struct json *attributes = json_member(json, "attributes");
    *out = (struct primitive){0};
    if (whole_number(json, "mode", 4) != 4 ||
        !open_accessor(file, whole_number(attributes, "POSITION", -1), &out->at) || out->at.width != 3 ||
        out->at.component != 5126)
        return false;
    out->has_normal = open_accessor(file, whole_number(attributes, "NORMAL", -1), &out->normal) &&
                      out->normal.width == 3 && out->normal.component == 5126 && out->normal.count >= out->at.count;
    out->has_uv = open_accessor(file, whole_number(attributes, "TEXCOORD_0", -1), &out->uv) && out->uv.width == 2 &&
                  out->uv.count >= out->at.count;
    out->has_indices = json_member(json, "indices") != NULL;
    return !out->has_indices || (open_accessor(file, whole_number(json, "indices", -1), &out->indices) &&
                                 out->indices.width == 1 && out->indices.component != 5126);
}

static bool read_corner(const struct primitive *primitive, const struct map *to, int64_t vertex,
                        struct glb_corner *corner)
{
    float at[3], normal[3] = {0, 0, 0};
    *corner = (struct glb_corner){0};
    if (vertex < 0 || vertex >= primitive->at.count)
        return false;
    for (int k = 0; k < 3; k++) {
        at[k] = component_at(&primitive->at, vertex, k);
        normal[k] = primitive->has_normal ? component_at(&primitive->normal, vertex, k) : 0;
    }
    for (int k = 0; k < 2; k++) {
        const float uv = primitive->has_uv ? component_at(&primitive->uv, vertex, k) : 0;
        corner->uv[k] = isfinite(uv) ? uv : 0;
    }
    apply_map(to, at, 1, corner->at);
    apply_map(to, normal, 0, corner->normal); // right for uniform scales, which models have
    return isfinite(corner->at[0]) && isfinite(corner->at[1]) && isfinite(corner->at[2]);
}

static enum status count_visit(struct file *file)
{
    return file->visited++ < GLB_MAX_VISITS
               ? OK
               : fail(ERR_INPUT, "the model has more than %d nodes and primitives", (int)GLB_MAX_VISITS);
}

static enum status read_primitive(struct file *file, const struct json *json, const struct map *to)
{
    struct glb_model *m = file->out;
    struct primitive p;
    enum status status = count_visit(file);
    if (status != OK)
        return status;
    if (!open_primitive(file, json, &p))
        return OK; // lines, points, or what is compressed
    const int64_t count = (p.has_indices ? p.indices.count : p.at.count) / 3 * 3;
    if (m->part_count == GLB_MAX_PARTS || m->corner_count + count > 3 * GLB_MAX_TRIANGLES)
        return fail(ERR_INPUT, "the model has more than %d triangles or %d parts", (int)GLB_MAX_TRIANGLES,
                    (int)GLB_MAX_PARTS);
    struct glb_part *part = &m->parts[m->part_count++];
    *part = (struct glb_part){.first = m->corner_count};
    status = read_material(file, whole_number(json, "material", -1), part);
    for (int64_t i = 0; i < count && status == OK; i += 3) {
        struct glb_corner c[3];
        bool good = true;
        for (int k = 0; k < 3; k++)
            good = good && read_corner(&p, to, p.has_indices ? index_at(&p.indices, i + k) : i + k, &c[k]);
        if (!good)
            return fail(ERR_INPUT, "the model has a corner that cannot be");
        face_normal(c);
        for (int k = 0; k < 3; k++)
            if (!add_corner(file, &c[k]))
                return fail(ERR_MEMORY, "no memory for a thing's model");
    }
    part->count = m->corner_count - part->first;
    return status;
}

static enum status read_node(struct file *file, int64_t index, const struct map *parent, int depth)
{
    const struct json *node = list_item(file, "nodes", index);
    if (!node || depth > MAX_DEPTH)
        return fail(ERR_INPUT, "the model's nodes make no tree");
    enum status status = count_visit(file);
    if (status != OK)
        return status;
    const struct map own = node_map(node), to = chain_maps(parent, &own);
    const struct json *mesh = list_item(file, "meshes", whole_number(node, "mesh", -1));
    for (const struct json *json = json_first(json_member(mesh, "primitives")); json && status == OK;
         json = json_next(json))
        status = read_primitive(file, json, &to);
    for (const struct json *c = json_first(json_member(node, "children")); c && status == OK; c = json_next(c)) {
        double child;
        if (json_get_number(c, &child))
            status = read_node(file, child >= 0 && child < GLB_MAX_VISITS ? (int64_t)child : -1, &to, depth + 1);
    }
    return status;
}

static enum status read_scene(struct file *file)
{
    const struct map identity = {{1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0}};
    const struct json *scene = list_item(file, "scenes", whole_number(file->root, "scene", 0));
    enum status status = OK;
    for (const struct json *json = json_first(json_member(scene, "nodes")); json && status == OK;
         json = json_next(json)) {
        double node;
        if (json_get_number(json, &node))
            status = read_node(file, node >= 0 && node < GLB_MAX_VISITS ? (int64_t)node : -1, &identity, 0);
    }
    return status == OK && !file->out->corner_count ? fail(ERR_INPUT, "the model holds no triangles") : status;
}

static void find_bounds(struct glb_model *model)
{
    for (int k = 0; k < 3; k++)
        model->low[k] = model->high[k] = model->corners[0].at[k];
    for (int i = 0; i < model->corner_count; i++)
        for (int k = 0; k < 3; k++) {
            model->low[k] = fminf(model->low[k], model->corners[i].at[k]);
            model->high[k] = fmaxf(model->high[k], model->corners[i].at[k]);
        }
}

enum status glb_read(const uint8_t *bytes, size_t count, struct glb_model *out)
{
    struct json *root = NULL;
    *out = (struct glb_model){0};
    if (count < HEADER + CHUNK || memcmp(bytes, "glTF", 4) != 0 || u32_at(bytes + 4) != 2)
        return fail(ERR_INPUT, "the model is no binary glTF 2.0");
    const size_t text = u32_at(bytes + HEADER), after = HEADER + CHUNK + text;
    if (u32_at(bytes + HEADER + 4) != JSON_CHUNK || text > count - HEADER - CHUNK)
        return fail(ERR_INPUT, "the model's first chunk is broken");
    if (text > GLB_MAX_TEXT_BYTES)
        return fail(ERR_INPUT, "the model's description is longer than %d bytes", (int)GLB_MAX_TEXT_BYTES);
    struct file f = {.out = out};
    if (count - after >= CHUNK && u32_at(bytes + after + 4) == BINARY_CHUNK) {
        f.bytes = bytes + after + CHUNK;
        f.count = u32_at(bytes + after);
        f.count = f.count < count - after - CHUNK ? f.count : count - after - CHUNK;
    }
    enum status status = json_parse((const char *)bytes + HEADER + CHUNK, text, "the model", &root);
    f.root = root;
    if (status == OK)
        status = read_scene(&f);
    json_free(&root);
    if (status == OK)
        find_bounds(out);
    else
        glb_model_free(out);
    return status;
}

void glb_model_free(struct glb_model *model)
{
    for (int i = 0; i < model->part_count; i++)
        free(model->parts[i].picture.rgb);
    free(model->corners);
    *model = (struct glb_model){0};
}
