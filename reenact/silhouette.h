// Which triangles of the likeness's mesh a picture shows, as the person stands in it, and
// along which edges they end: a thin ribbon outwards along these smooths the outline. Pure;
// one thread.
#pragma once
#include "reenact/likeness.h"

struct silhouette;

// likeness: with its atlas; must outlive it. ERR_MEMORY.
MUST_CHECK enum status silhouette_open(struct silhouette **out, const struct likeness *likeness);
void silhouette_close(struct silhouette **s);

// From here on that is the shown frame: where each part was in its camera's axes, which
// tells what of the person may have faced it. PART_COUNT. shift: of each of the mesh's points
// in the rest pose, metres.
void silhouette_set_shown(struct silhouette *s, const struct part_map *now_from_part, float (*shift)[3]);

// Corners of triangles: point i of the atlas's mesh is i, and its double farther out is
// point_count + i. First come those that face the viewer and the shown frame's camera, then
// the others that face the viewer, at last the ribbon's.
struct silhouette_corners {
    const uint16_t *corners; // valid until the next call
    int shared, own, ribbon; // how many of each
};
struct silhouette_corners silhouette_find(struct silhouette *s, const struct part_map *viewer_from_part,
                                          float (*shift)[3]);
int silhouette_most(const struct silhouette *s); // corners, of all three together
