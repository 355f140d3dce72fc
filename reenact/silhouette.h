// Which edges of the likeness's mesh part what is seen from what is not, as it stands in a
// picture: a thin ribbon outwards along them smooths the outline. Pure; one thread.
#pragma once
#include "reenact/likeness.h"

struct silhouette;

// likeness: with its atlas; must outlive it. ERR_MEMORY.
MUST_CHECK enum status silhouette_open(struct silhouette **out, const struct likeness *likeness);
void silhouette_close(struct silhouette **s);

// Corners of the ribbon's triangles: point i of the atlas's mesh is i, and its double farther out
// point_count + i. viewer_from_part: PART_COUNT; shift: of each point in the rest pose, metres. Returns how many, at most silhouette_most; fills out.
int silhouette_find(struct silhouette *s, const struct part_map *viewer_from_part, float (*shift)[3], uint16_t *out);
int silhouette_most(const struct silhouette *s);
