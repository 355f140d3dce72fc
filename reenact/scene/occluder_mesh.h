// The occluder mesh: surfaces of the room about the actor, which may hide the actor from the
// viewer. Fused from the place's views and some of the take's frames into a coarse truncated
// signed distance field (Curless & Levoy 1996) and extracted by naive surface nets. The floor
// is left out, as it hides nothing; voxels that the actor's body passed through are empty.
//
// Reads the take's images and runs options.threads threads while it works; deterministic, whatever
// their number. Memory while it works: at most 100 MB.
#pragma once
#include "base/progress.h"
#include "recording/recording.h"
#include "reenact/skeleton/body_cylinders.h"

enum { OCCLUDER_MAX_POINTS = 65000 }; // 16-bit indices address these and the shadow's floor patch
#define OCCLUDER_BODY_RADIUS_M 0.35   // upper bound of the body's radius about its joints; chosen by hand

// Triangles in world axes, metres; counter-clockwise as seen from the empty side, from which they were filmed.
struct occluder_mesh {
    float (*points)[3];
    uint16_t *corners; // corner_count, three to a triangle
    int point_count, corner_count;
    struct occluder_sphere *spheres; // bounds of all triangles, in their order, for culling
    int sphere_count;
};
struct occluder_sphere {
    struct vec3 middle;
    double radius_m;
    int first, count; // of the corners inside
};

struct occluder_options {
    int threads;                        // budget; default 2
    const struct progress_watch *watch; // asked while the place's views are fused; default NULL
};
struct occluder_options occluder_default_options(void);

// The take's frames must be located in the place's world. options: NULL: defaults. Where the mesh would exceed
// OCCLUDER_MAX_POINTS, the grid is coarsened. NOTHING: the place or the take has no depth, there is no surface, or
// options.watch cancelled. ERR_CORRUPT, ERR_IO, ERR_MEMORY. *out is zeroed unless OK.
MUST_CHECK enum status occluder_mesh_make(struct occluder_mesh *out, const struct place *place, struct take *take,
                                          const struct occluder_options *options);
void occluder_mesh_free(struct occluder_mesh *mesh); // leaves it zeroed

// ---------------------------------------------------------------- occluder grid

// The voxel grid from which the occluder mesh is made; for occluder_mesh.c
// and its test only.

// A TSDF: signed distance of voxel i is sum[i] / weight[i], positive in empty space; weight 0: unknown.
struct occluder_grid {
    struct vec3 corner;      // of the first voxel, world axes, metres
    double step, truncation; // voxel size; largest distance kept
    int size[3];
    float *sum, *weight; // [z][y][x]
};

static inline size_t occluder_grid_index(const struct occluder_grid *grid, int x, int y, int z)
{
    return ((size_t)z * (size_t)grid->size[1] + (size_t)y) * (size_t)grid->size[0] + (size_t)x;
}

// Extracts the zero crossing by naive surface nets (after Gibson 1998, without relaxation). OK with *too_large: it has
// more than OCCLUDER_MAX_POINTS vertices, *out is empty. NOTHING: there is no surface. ERR_MEMORY. On OK
// occluder_mesh_free(out) frees the mesh, which has no spheres yet.
MUST_CHECK enum status occluder_surface_nets(const struct occluder_grid *grid, struct occluder_mesh *out,
                                             bool *too_large);

// ---------------------------------------------------------------- occlusion frustum

// The frustum behind which an occluder matters, and culling of the occluder mesh by it. Pure.

// What the room may hide: a wedge from the viewpoint that contains it, viewer camera's axes. Zeroed: empty.
struct occlusion_frustum {
    double low[2], high[2]; // of x / z and y / z; infinite: unbounded on that side
    double farthest_m;      // z. 0: empty
};

// Extends the frustum to a sphere, metres.
void occlusion_frustum_add(struct occlusion_frustum *frustum, struct vec3 center, double radius_m);

// The frustum of a body, from its known joints.
struct occlusion_frustum occlusion_frustum_body(const struct skeleton *in_viewer);

// Writes the corners of the triangles that may lie before `hidden` into `corners`, which has room for
// mesh->corner_count of them; returns their number. viewer_from_room: from the mesh's axes into the frustum's.
int occluder_mesh_cull(const struct occluder_mesh *mesh, const struct affine_map *viewer_from_room,
                       const struct occlusion_frustum *hidden, uint16_t *corners);
