// The avatar as it is drawn: a coarse mesh with a texture. Shape changes slowly over a body and colours do not, so the
// surface is simplified to 2500 triangles (platform/vision/mesh_simplify.h: quadric error), refitted to the fine
// surface, unwrapped (uv_unwrap.h), and its vertex colours are baked into one image, 4 mm a texel. Deterministic; the
// result does not depend on the number of threads.
#pragma once
#include "reenact/avatar/uv_unwrap.h"
#include "reenact/avatar/vertex_color.h"

struct texture_atlas {
    struct uv_mesh mesh;
    struct vec3 *points;  // of the mesh, bind-pose axes: moved off the fine surface so that the triangles lie on it
    struct vec3 *normals; // of the mesh's points, area-weighted mean of its triangles'; outwards, unit
    uint8_t *color;       // RGB of the mesh's image: albedo, gamma-encoded (square root of linear)
    uint8_t *seen_time;   // RGBA likewise: A, R, G: when it was seen best, hundredths of a second, highest byte first;
                          // B: 255: it was never seen
};

// Starts up to `threads` threads and ends them. ERR_MEMORY; ERR_INPUT: the surface is too large (uv_unwrap). *out is
// empty then; else the caller frees it with texture_atlas_free.
MUST_CHECK enum status texture_atlas_make(struct texture_atlas *out, const struct surface_mesh *surface,
                                          const struct vertex_colors *vertex_colors, int threads);
void texture_atlas_free(struct texture_atlas *atlas);
