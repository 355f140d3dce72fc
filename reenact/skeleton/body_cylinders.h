// The rough model: a cylinder about each body part, radius = rate * bone length
// (2014 paper, section 4.1), and the meshes it is drawn with. Pure.
#pragma once
#include "reenact/skeleton/bone_frame.h"

// An affine map as the rows the shader takes: p = m[i][0..2] . local + m[i][3].
struct affine_map {
    float row[3][4];
};

// From the part's mesh (x, y in radii, z in bone lengths) into the frame's axes, metres.
struct affine_map cylinder_affine(const struct bone_frame *frame, double radius_m);

// Rigid: metres to metres.
struct affine_map affine_from_pose(struct pose a_from_b);
struct affine_map affine_multiply(const struct affine_map *a_from_b, const struct affine_map *b_from_c);

// How the mesh ends.
enum cylinder_shape {
    CYLINDER_OPEN,    // the paper's: a tube
    CYLINDER_ROUNDED, // half ellipsoids over both ends
};

// Triangles around the z axis: local (x, y, z), radius 1 between z = 0 and 1.
// cap: how far the round ends reach over, in bone lengths (for a half ball: the
// radius rate). `around` >= 3 sides, `along` >= 1 rings; the sides stand outside
// and inside the true circle by equal areas. The caller owns both arrays and
// frees them. ERR_MEMORY.
struct cylinder_mesh {
    float *vertices;   // vertex_count * 3
    uint16_t *indices; // index_count, a multiple of 3
    int vertex_count, index_count;
};
MUST_CHECK enum status cylinder_mesh_make(enum cylinder_shape shape, double cap, int around, int along,
                                          struct cylinder_mesh *out);
void cylinder_mesh_free(struct cylinder_mesh *mesh);

// Sides that keep a circle of `radius_px` true within `error_px`: 8, 16, 32 or 64.
int cylinder_sides(double radius_px, double error_px);
