// Which triangles of the avatar's mesh a picture shows, as the person stands in it, and
// along which edges they end: a thin ribbon outwards along these smooths the outline. Pure;
// one thread.
#pragma once
#include "reenact/avatar/avatar.h"

struct silhouette_edges;

// avatar: with its atlas; must outlive it. ERR_MEMORY.
MUST_CHECK enum status silhouette_edges_open(struct silhouette_edges **out, const struct avatar *avatar);
void silhouette_edges_close(struct silhouette_edges **s);

// Corners of triangles: point i of the atlas's mesh is i, and its double farther out is
// point_count + i. First come those that face the viewer, of these first those that are `own`, then the ribbon's. None
// goes for the most part with absent parts of the body. viewer_from_bone: of each bone, BONE_COUNT; absent: of each
// part. shift: of each of the mesh's points in the bind pose, metres. own: of each triangle, as loaded_frame has it.
struct point3f {
    float x, y, z;
};
struct silhouette_corners {
    const uint16_t *corners;      // valid until the next call, as placed
    const struct point3f *placed; // each point of the mesh, in the viewer's axes, metres
    int own, front, ribbon;       // how many of each; own: of those in front
    float low[2], high[2]; // between which all of it lies, x and y where z is 1; infinite: some is beside the camera
};
struct silhouette_corners silhouette_edges_find(struct silhouette_edges *s, const struct affine_map *viewer_from_bone,
                                                float (*shift)[3], const bool *own, const bool *absent);
int silhouette_edges_most(const struct silhouette_edges *s); // corners, of both together
