// The voxel grid from which the occluder mesh is made; for occluder_mesh.c and surface_nets.c
// (and its test) only.
#pragma once
#include "reenact/scene/occluder_mesh.h"

// A TSDF: signed distance of voxel i is sum[i] / weight[i], positive in empty space; weight 0: unknown.
struct occluder_grid {
    struct vec3 corner;      // of the first voxel, world axes, metres
    double step, truncation; // voxel size; largest distance kept
    int size[3];
    float *sum, *weight; // [z][y][x]
};

static inline size_t occluder_grid_index(const struct occluder_grid *g, int x, int y, int z)
{
    return ((size_t)z * (size_t)g->size[1] + (size_t)y) * (size_t)g->size[0] + (size_t)x;
}

// Extracts the zero crossing by naive surface nets (after Gibson 1998, without relaxation). OK with *too_large: it has
// more than OCCLUDER_MAX_POINTS vertices, *out is empty. NOTHING: there is no surface. ERR_MEMORY. On OK
// occluder_mesh_free(out) frees the mesh, which has no spheres yet.
MUST_CHECK enum status occluder_surface_nets(const struct occluder_grid *g, struct occluder_mesh *out, bool *too_large);
