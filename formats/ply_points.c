// Points of a PLY file: the vertices' x, y, z; other properties are skipped.
#include "formats/ply.h"
#include "platform/files/file.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

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
