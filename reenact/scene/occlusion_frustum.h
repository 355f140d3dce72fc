// The frustum behind which an occluder matters, and culling of the occluder mesh by it. Pure.
#pragma once
#include "reenact/scene/occluder_mesh.h"

// What the room may hide: a wedge from the viewpoint that contains it, viewer camera's axes. Zeroed: empty.
struct occlusion_frustum {
    double low[2], high[2]; // of x / z and y / z; infinite: unbounded on that side
    double farthest_m;      // z. 0: empty
};

// Extends the frustum to a sphere, metres.
void occlusion_frustum_add(struct occlusion_frustum *f, struct vec3 center, double radius_m);

// The frustum of a body, from its known joints.
struct occlusion_frustum occlusion_frustum_body(const struct skeleton *in_viewer);

// Writes the corners of the triangles that may lie before `hidden` into `corners`, which has room for
// mesh->corner_count of them; returns their number. viewer_from_room: from the mesh's axes into the frustum's.
int occluder_mesh_cull(const struct occluder_mesh *mesh, const struct affine_map *viewer_from_room,
                       const struct occlusion_frustum *hidden, uint16_t *corners);
