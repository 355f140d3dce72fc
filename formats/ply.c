#include "formats/ply.h"

#include "platform/files/file.h"

#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

void ply_free(struct ply *ply)
{
    free(ply->points);
    free(ply->triangles);
    *ply = (struct ply){0};
}

// Makes room for one more of `size` bytes each. False: out of memory, or 2^31 of them.
static bool grow_items(void **items, int32_t count, int32_t *capacity, size_t size)
{
    if (count < *capacity)
        return true;
    if (*capacity > INT_MAX / 2)
        return false;
    const int32_t wanted = *capacity ? 2 * *capacity : 1024;
    void *grown = realloc(*items, (size_t)wanted * size);
    if (!grown)
        return false;
    *items = grown;
    *capacity = wanted;
    return true;
}

static enum status no_memory(void) { return fail(ERR_MEMORY, "no memory for so many points"); }

enum status ply_add_point(struct ply *ply, struct vec3 at, const uint8_t rgb[3])
{
    void *points = ply->points;
    const bool fits = grow_items(&points, ply->point_count, &ply->point_capacity, sizeof *ply->points);
    ply->points = points;
    if (!fits)
        return no_memory();
    ply->points[ply->point_count++] =
        (struct ply_point){{(float)at.x, (float)at.y, (float)at.z}, {rgb[0], rgb[1], rgb[2]}};
    return OK;
}

enum status ply_add_triangle(struct ply *ply, int32_t a, int32_t b, int32_t c)
{
    void *triangles = ply->triangles;
    const bool fits = grow_items(&triangles, ply->triangle_count, &ply->triangle_capacity, sizeof *ply->triangles);
    ply->triangles = triangles;
    if (!fits)
        return no_memory();
    memcpy(ply->triangles[ply->triangle_count++], (const int32_t[3]){a, b, c}, 3 * sizeof(int32_t));
    return OK;
}

static uint8_t *put_little_endian(uint8_t *at, const void *value)
{
    uint32_t bits;
    memcpy(&bits, value, sizeof bits);
    for (int i = 0; i < 4; i++)
        *at++ = (uint8_t)(bits >> 8 * i);
    return at;
}

void ply_print(const struct ply *ply, const char *comment, FILE *out)
{
    fprintf(out, "ply\nformat binary_little_endian 1.0\ncomment Reenact; metres; %s\n", comment);
    fprintf(out, "element vertex %d\nproperty float x\nproperty float y\nproperty float z\n", (int)ply->point_count);
    fprintf(out, "property uchar red\nproperty uchar green\nproperty uchar blue\n");
    if (ply->triangle_count)
        fprintf(out, "element face %d\nproperty list uchar int vertex_indices\n", (int)ply->triangle_count);
    fprintf(out, "end_header\n");
    for (int32_t i = 0; i < ply->point_count; i++) {
        uint8_t row[15], *at = row;
        for (int k = 0; k < 3; k++)
            at = put_little_endian(at, &ply->points[i].at[k]);
        memcpy(at, ply->points[i].rgb, 3);
        fwrite(row, 1, sizeof row, out);
    }
    for (int32_t i = 0; i < ply->triangle_count; i++) {
        uint8_t row[13] = {3}, *at = row + 1;
        for (int k = 0; k < 3; k++)
            at = put_little_endian(at, &ply->triangles[i][k]);
        fwrite(row, 1, sizeof row, out);
    }
}

// ---------------------------------------------------------------- points read

// Points of a PLY file: the vertices' x, y, z; other properties are skipped.

struct ply_header {
    bool ascii;
    long vertices;
    int stride;     // bytes a vertex, or numbers in ASCII
    int at[3];      // of x, y, z
    bool wide[3];   // double instead of float
    bool in_vertex; // the element being described
    const uint8_t *body;
};

static int type_bytes(const char *type)
{
    static const struct {
        const char *name;
        int bytes;
    } types[] = {{"char", 1},  {"uchar", 1},   {"int8", 1},   {"uint8", 1},  {"short", 2}, {"ushort", 2},
                 {"int16", 2}, {"uint16", 2},  {"int", 4},    {"uint", 4},   {"int32", 4}, {"uint32", 4},
                 {"float", 4}, {"float32", 4}, {"double", 8}, {"float64", 8}};
    for (size_t i = 0; i < COUNT_OF(types); i++)
        if (!strcmp(type, types[i].name))
            return types[i].bytes;
    return 0;
}

static bool header_line(struct ply_header *header, const char *line)
{
    char a[32] = "", b[32] = "", c[32] = "";
    sscanf(line, "%31s %31s %31s", a, b, c);
    if (!strcmp(a, "format")) {
        header->ascii = !strcmp(b, "ascii");
        return header->ascii || !strcmp(b, "binary_little_endian");
    }
    if (!strcmp(a, "element")) {
        header->in_vertex = !strcmp(b, "vertex") && header->vertices < 0;
        if (header->in_vertex)
            header->vertices = atol(c);
        return header->in_vertex || header->vertices >= 0; // the vertices come first
    }
    if (!strcmp(a, "property") && header->in_vertex) {
        const int bytes = type_bytes(b);
        for (int k = 0; k < 3; k++)
            if (c[0] == "xyz"[k] && !c[1]) {
                header->at[k] = header->stride;
                header->wide[k] = bytes == 8;
                if (!header->ascii && strncmp(b, "float", 5) != 0 && strcmp(b, "double") != 0)
                    return false; // its bytes would be taken for those of a float
            }
        header->stride += header->ascii ? 1 : bytes;
        return bytes > 0 && header->stride < 4096;
    }
    return true;
}

static bool read_header(struct ply_header *header, const uint8_t *bytes, size_t size)
{
    *header = (struct ply_header){.vertices = -1, .at = {-1, -1, -1}};
    const char *at = (const char *)bytes, *end = at + size;
    for (int n = 0; at < end && n < 200; n++) {
        const char *stop = memchr(at, '\n', (size_t)(end - at));
        char line[256];
        if (!stop)
            return false;
        snprintf(line, sizeof line, "%.*s", (int)(stop - at), at);
        at = stop + 1;
        if (n == 0 && strncmp(line, "ply", 3))
            return false;
        if (!strncmp(line, "end_header", 10)) {
            header->body = (const uint8_t *)at;
            return header->vertices >= 0 && header->vertices < 100000000 && header->at[0] >= 0 && header->at[1] >= 0 &&
                   header->at[2] >= 0;
        }
        if (n && !header_line(header, line))
            return false;
    }
    return false;
}

static bool read_vertex(const struct ply_header *header, const uint8_t **at, const uint8_t *end, float out[3])
{
    if (!header->ascii) {
        if (end - *at < header->stride)
            return false;
        for (int k = 0; k < 3; k++)
            if (header->wide[k]) {
                double value;
                memcpy(&value, *at + header->at[k], 8);
                out[k] = (float)value;
            } else
                memcpy(&out[k], *at + header->at[k], 4);
        *at += header->stride;
        return true;
    }
    for (int n = 0; n < header->stride; n++) {
        char *rest;
        const double value = strtod((const char *)*at, &rest);
        if (rest == (const char *)*at)
            return false;
        *at = (const uint8_t *)rest;
        for (int k = 0; k < 3; k++)
            if (header->at[k] == n)
                out[k] = (float)value;
    }
    return true;
}

// Whether so many vertices can be in the bytes behind the header: memory is taken for them before they are read. A
// number in ASCII has a digit and, but for the last one, a blank.
static bool can_hold(const struct ply_header *header, const uint8_t *end)
{
    const uint64_t there = (uint64_t)(end - header->body) + header->ascii;
    return (uint64_t)header->vertices * (uint64_t)(header->ascii ? 2 * header->stride : header->stride) <= there;
}

static enum status ends_early(const char *path) { return fail(ERR_CORRUPT, "%s ends before its last point", path); }

enum status ply_points_read(const char *path, float (**out)[3], int *count)
{
    uint8_t *bytes;
    size_t size;
    enum status status = file_read(path, &bytes, &size);
    if (status != OK)
        return status;
    struct ply_header h;
    if (!read_header(&h, bytes, size)) {
        free(bytes);
        return fail(ERR_CORRUPT, "%s is no PLY file with vertices of x, y, z (ASCII or binary little-endian)", path);
    }
    const uint8_t *at = h.body, *end = bytes + size;
    const bool whole = can_hold(&h, end);
    long kept = 0;
    float(*points)[3] = whole ? malloc((size_t)(h.vertices + 1) * sizeof *points) : NULL;
    if (!points)
        status = whole ? fail(ERR_MEMORY, "no memory for the points of a PLY file") : ends_early(path);
    for (long i = 0; status == OK && i < h.vertices; i++) {
        if (!read_vertex(&h, &at, end, points[kept]))
            status = ends_early(path);
        else
            kept += isfinite(points[kept][0]) && isfinite(points[kept][1]) && isfinite(points[kept][2]);
    }
    free(bytes);
    if (status != OK) {
        free(points);
        return status;
    }
    *out = points;
    *count = (int)kept;
    return OK;
}
