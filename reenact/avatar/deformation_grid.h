// The regular grid that carries a deformation: a box about the avatar's surface in the bind pose, with trilinear
// interpolation between its points. Bind-pose axes, metres. No state; any thread.
#pragma once
#include "reenact/avatar/tsdf.h"

#define DEFORMATION_STEP_M 0.06 // between neighbouring points; chosen by hand

enum { DEFORMATION_POINTS_MOST = 1 << 20 }; // 226 cubic metres; the models of three filmed people take 6900 to 10700

// Point (x, y, z) lies at corner + (x, y, z) * DEFORMATION_STEP_M; its index is (z * size[1] + y) * size[0] + x.
struct deformation_grid {
    struct vec3 corner;
    int size[3];
};

// The surface's bounding box with one step of margin on each side. The surface has at least one point, and its box at
// most DEFORMATION_POINTS_MOST.
struct deformation_grid deformation_grid_about(const struct surface_mesh *surface);
// Whether the box has at most that many points. Those of the surface lie within 1 km.
bool deformation_grid_is_small(const struct surface_mesh *surface);
int deformation_grid_count(const struct deformation_grid *g); // of its points
struct vec3 deformation_grid_point(const struct deformation_grid *g, int at);

// The eight grid points about a point, with the trilinear weight of each.
struct deformation_cell {
    int at[8];
    double weight[8]; // add up to 1
};
// False: p lies outside the grid.
bool deformation_grid_cell(const struct deformation_grid *g, struct vec3 p, struct deformation_cell *out);
