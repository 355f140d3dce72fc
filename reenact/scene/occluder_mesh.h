// The room about the actor, as far as a sensor saw it: what may stand between him
// and whoever looks. Gathered from the views of the empty place and from some of
// the take's frames (a truncated signed distance on a coarse grid). The floor is
// left out, it hides nobody; and where the actor's own body passed, no room is. Pure.
#pragma once
#include "base/progress.h"
#include "capture/recording/recording.h"
#include "reenact/skeleton/body_cylinders.h"

enum { OCCLUDER_MAX_POINTS = 65000 }; // 16 bits number them, and beside them what is drawn in the same call

// Triangles in the world's axes, metres; either side may face outwards.
struct occluder_mesh {
    float (*points)[3];
    uint16_t *corners; // corner_count, three to a triangle
    int point_count, corner_count;
    struct occluder_sphere
        *spheres; // of the triangles, in their order, all of them: only those that matter need be drawn
    int sphere_count;
};
struct occluder_sphere {
    struct vec3 middle;
    double radius_m;
    int first, count; // the corners that lie in it
};

// The take's frames have to be located in the place's world. rays: as for
// avatar_make. NOTHING: the place or the take has no depth, nothing stands about,
// or watch (perhaps NULL) does not want it any more. ERR_CORRUPT, ERR_IO, ERR_MEMORY.
MUST_CHECK enum status occluder_mesh_make(struct occluder_mesh *out, const struct place *place, struct take *take,
                                          const struct progress_watch *watch);
void occluder_mesh_free(struct occluder_mesh *mesh); // leaves it zeroed

// What the room may hide, as the wedge from the eye that holds it, tablet camera axes. Zeroed: nothing yet.
struct occlusion_frustum {
    double low[2], high[2]; // of x / z and y / z; infinite: it has no such side
    double farthest_m;      // z. 0: nothing
};

// A sphere more, metres.
void occlusion_frustum_add(struct occlusion_frustum *h, struct vec3 middle, double radius_m);

// A body whose joints those are.
struct occlusion_frustum occlusion_frustum_body(const struct skeleton *in_viewer);

// The corners of the triangles that may lie before it, into `corners`, which has room for all of them; how many.
// viewer_from_room: into the same axes.
int occluder_mesh_cull(const struct occluder_mesh *mesh, const struct affine_map *viewer_from_room,
                       const struct occlusion_frustum *hidden, uint16_t *corners);
