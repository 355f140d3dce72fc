// The avatar's surface with few triangles, and its colours in a picture that is laid
// over them: shape changes slowly over a body, colours do not. Pure; deterministic.
#pragma once
#include "reenact/avatar/vertex_color.h"
#include "reenact/avatar/uv_unwrap.h"

struct texture_atlas {
    struct uv_mesh mesh;
    struct vec3 *points;  // where the mesh's lie: a little beside the surface's, so that the triangles lie on it
    struct vec3 *normals; // of its points, as its triangles have them; outwards, unit
    uint8_t *color;       // RGB of the mesh's picture: roots of the vertex_colors's colours
    uint8_t *seen_time;   // RGBA likewise: when it was seen best, hundredths of a second, high and low byte;
                          // 255: nobody saw it
};

// ERR_MEMORY; ERR_INPUT as unfold. texture_atlas_free.
MUST_CHECK enum status texture_atlas_make(struct texture_atlas *out, const struct surface_mesh *surface,
                                          const struct vertex_colors *vertex_colors);
void texture_atlas_free(struct texture_atlas *a);
