// Body cylinders ([D14] 4.1): about each body part, radius = radius rate * bone length; and
// the meshes they are drawn with. Affine maps as shaders take them. Pure.
#pragma once
#include "reenact/skeleton/bone_frame.h"

// An affine map by rows, as three vec4s: out[i] = row[i][0..2] . in + row[i][3].
struct affine_map {
    float row[3][4];
};

// From the cylinder mesh (x, y in radii, z in bone lengths) into the axes of the bone frame's skeleton, metres.
struct affine_map cylinder_affine(const struct bone_frame *frame, double radius_m);

// Rigid: metres to metres.
struct affine_map affine_from_pose(struct pose a_from_b);
struct affine_map affine_multiply(const struct affine_map *a_from_b, const struct affine_map *b_from_c);

enum cylinder_shape {
    CYLINDER_OPEN,    // [D14]: a tube without ends
    CYLINDER_ROUNDED, // half ellipsoids over both ends
};

// Triangles around the z axis, radius 1 between z = 0 and 1. cap: how far the round ends
// reach beyond, in bone lengths (half balls: the radius rate). `around` >= 3 sides,
// `along` >= 1 rings; the polygon lies midway between the circle's inner and outer one.
// The caller frees the mesh. ERR_MEMORY; *out is then zeroed.
struct cylinder_mesh {
    float *vertices;   // vertex_count * 3
    uint16_t *indices; // index_count, a multiple of 3
    int vertex_count, index_count;
};
MUST_CHECK enum status cylinder_mesh_make(enum cylinder_shape shape, double cap, int around, int along,
                                          struct cylinder_mesh *out);
void cylinder_mesh_free(struct cylinder_mesh *mesh);

// Number of sides with which a circle of `radius_px` is approximated within `error_px`: 8, 16, 32 or 64 (at most).
int cylinder_sides(double radius_px, double error_px);
