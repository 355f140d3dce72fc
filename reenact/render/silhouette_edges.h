// Skins the avatar's mesh for one image (linear blend skinning, LBS), selects the
// triangles that face the viewer, and builds a thin ribbon along the silhouette edges
// (between a front-facing triangle and a back-facing or missing neighbour). The ribbon,
// faded outwards by the shader, antialiases the silhouette. Pure; one thread.
#pragma once
#include "reenact/avatar/avatar.h"

struct silhouette_edges;

// avatar: with its atlas; must outlive it. Allocates 7 indices for each of the mesh's corners. ERR_MEMORY; *out is
// then NULL.
MUST_CHECK enum status silhouette_edges_open(struct silhouette_edges **out, const struct avatar *avatar);
void silhouette_edges_close(struct silhouette_edges **s);

// Corners of triangles: point i of the atlas's mesh is i, its double at the ribbon's outer rim is point_count + i.
// First the front-facing triangles, of these first those that are `own`; then the ribbon's. Triangles with more than
// half of their skin weight on absent parts are omitted. viewer_from_bone[BONE_COUNT]: from the bind pose to the
// viewer camera; absent[PART_COUNT]. shift: deformation of each of the mesh's points in the bind pose, metres. own: of
// each triangle: seen by the shown frame (frame_layer.triangle_visible).
struct point3f {
    float x, y, z;
};
struct silhouette_corners {
    const uint16_t *corners;      // valid until the next call, as placed
    const struct point3f *placed; // each point of the mesh, viewer camera's axes, metres
    int own, front, ribbon;       // numbers of corners; own: those of `front` that are own
    float low[2], high[2];        // bounds of x / z and y / z; infinite: some points are beside the camera
};
struct silhouette_corners silhouette_edges_find(struct silhouette_edges *s, const struct affine_map *viewer_from_bone,
                                                float (*shift)[3], const bool *own, const bool *absent);
int silhouette_edges_most(const struct silhouette_edges *s); // corners, at most: triangles and ribbon
