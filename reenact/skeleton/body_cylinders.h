// Body cylinders ([D14] 4.1): about each body part, radius = radius rate * bone length; and
// the meshes they are drawn with. Affine maps as shaders take them. Pure.
#pragma once
#include "reenact/skeleton/bind_pose.h"

// ---------------------------------------------------------------- bone chart

// A bone chart: a scalar field on the surface about a bone, over height along it and angle about it (as the thickness
// of a body part is), on a 7 x 12 grid with bilinear interpolation. Pure.

enum { CHART_HEIGHTS = 7, CHART_ANGLES = 12 };
#define CHART_MARGIN 0.5 // the chart extends beyond both ends by this share of the bone's length; then it is clamped

struct bone_chart {
    float at[CHART_HEIGHTS * CHART_ANGLES]; // [height][angle]
};

// A point of a chart: the four grid values about it and their bilinear weights, which add up to 1.
struct chart_sample {
    int index[4];
    float weight[4];
};
struct chart_sample chart_sample_at(const struct bone_frame *bone,
                                    struct vec3 point); // in the bone frame's skeleton's axes

float bone_chart_at(const struct bone_chart *chart, const struct chart_sample *sample);
void bone_chart_add(struct bone_chart *chart, const struct chart_sample *sample, float value); // by its weights
double bone_chart_sum(const struct bone_chart *chart);

// 3 x 3 binomial filter, cyclic in the angle; zero beyond the first and last height.
void bone_chart_smooth(struct bone_chart *chart);

// ---------------------------------------------------------------- body cylinders

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
