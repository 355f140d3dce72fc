// Writes points and triangles as PLY (Turk 1994, "The PLY polygon file format"), binary, little-endian. Pure but for
// the stream; any thread.
#pragma once
#include "base/geometry.h"

#include <stdio.h>

// A growing list of points with colours, and triangles between them. Zeroed: empty.
struct ply {
    struct ply_point {
        float at[3];
        uint8_t rgb[3];
    } * points;
    int32_t (*triangles)[3];
    int32_t point_count, triangle_count;
    int32_t point_capacity, triangle_capacity;
};
void ply_free(struct ply *ply);

// ERR_MEMORY, also beyond 2^31 - 1 of either.
MUST_CHECK enum status ply_add_point(struct ply *ply, struct vec3 at, const uint8_t rgb[3]);
MUST_CHECK enum status ply_add_triangle(struct ply *ply, int32_t a, int32_t b, int32_t c);

// comment: one line, for example the axes. What could not be written is found by ferror(out).
void ply_print(const struct ply *ply, const char *comment, FILE *out);

// Points of a PLY file, ASCII or binary little-endian, with x, y, z among its vertex properties, in binary as float or
// double. *out is malloc'ed.
MUST_CHECK enum status ply_points_read(const char *path, float (**out)[3], int *count);
