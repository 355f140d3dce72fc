#include "formats/ply.h"

#include <limits.h>
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

enum status ply_add_point(struct ply *p, struct vec3 at, const uint8_t rgb[3])
{
    void *points = p->points;
    const bool fits = grow_items(&points, p->point_count, &p->point_capacity, sizeof *p->points);
    p->points = points;
    if (!fits)
        return no_memory();
    p->points[p->point_count++] = (struct ply_point){{(float)at.x, (float)at.y, (float)at.z}, {rgb[0], rgb[1], rgb[2]}};
    return OK;
}

enum status ply_add_triangle(struct ply *p, int32_t a, int32_t b, int32_t c)
{
    void *triangles = p->triangles;
    const bool fits = grow_items(&triangles, p->triangle_count, &p->triangle_capacity, sizeof *p->triangles);
    p->triangles = triangles;
    if (!fits)
        return no_memory();
    memcpy(p->triangles[p->triangle_count++], (const int32_t[3]){a, b, c}, 3 * sizeof(int32_t));
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
