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
    struct occluder_sphere *spheres; // bounds of all triangles, in their order, for culling (occlusion_frustum.h)
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
