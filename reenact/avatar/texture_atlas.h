// The avatar as it is drawn: a coarse mesh with a texture. Shape changes slowly over a body and colours do not, so the
// surface is simplified to 2500 triangles (platform/vision/mesh_simplify.h: quadric error), refitted to the fine
// surface, unwrapped, and its vertex colours are baked into one image, 4 mm a texel. Deterministic;
// the result does not depend on the number of threads.
#pragma once
#include "reenact/avatar/tsdf.h"
#include "reenact/avatar/vertex_color.h"

// ---------------------------------------------------------------- uv unwrap

// UV unwrapping: lays a triangle mesh out in an image so that every part of it has texels of its own. The mesh is cut
// into charts by region growing: each is an orthographic projection along one direction, first the six main
// directions, in which its triangles face at most 60 degrees away and do not overlap. The charts are packed in rows,
// the highest first. No threads are started; deterministic.

enum { UV_CHART_MARGIN = 2 }; // texels between one chart and the next

struct uv_mesh {
    int32_t *points;  // point_count: indices of the surface's points; those on a cut occur once for each chart
    float (*at)[2];   // of each: texel coordinates; the centre of the first texel is (0.5, 0.5)
    int32_t *corners; // corner_count, three to a triangle: indices in `points`, in the order of the given triangles
    int32_t (*neighbor)[3]; // of each triangle: those across its edges, beginning with the edge from its first to its
                            // second corner; -1: none
    int point_count, corner_count;
    int width, height; // of the image, texels
};

// corners: triangles between the surface's points, corner_count / 3 of them. texel_m: metres of the surface to a texel;
// up to twice as many where a chart's surface is oblique. ERR_MEMORY; ERR_INPUT: a chart is longer than 1024 texels, or
// the charts do not fit an image of 1280 x 1280. *out is empty then; else the caller frees it with uv_mesh_free.
MUST_CHECK enum status uv_unwrap(struct uv_mesh *out, const struct surface_mesh *surface, const int32_t *corners,
                                 int corner_count, double texel_m);
void uv_mesh_free(struct uv_mesh *mesh);

// ---------------------------------------------------------------- color inpainting

// Inpainting of vertex colours: colours for the surface that no frame showed. The surface is in the bind pose. A point
// takes, in this order, the first that there is:
// 1. the mirrored point's colour, if the body's other half was seen there (and this half was not seen nearer by);
// 2. clothes are assumed to look alike all round a bone at one height: a robust mean of what was seen of the bone at
//    this height, nearer sides with more weight, and without outliers such as prints or the face;
// 3. the colour of the nearest point that was seen.
// Deterministic; the result does not depend on the number of threads.

// Sets color and time_s of every point that is marked as filled, and leaves all others alone; without any point that
// was seen it changes nothing. Starts up to `threads` threads and ends them. ERR_MEMORY; nothing is changed then.
MUST_CHECK enum status color_inpaint(struct vertex_colors *vertex_colors, const struct vertex_color_target *target,
                                     int threads);

// ---------------------------------------------------------------- texture atlas

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
