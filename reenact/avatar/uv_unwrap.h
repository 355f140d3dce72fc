// UV unwrapping: lays a triangle mesh out in an image so that every part of it has texels of its own. The mesh is cut
// into charts by region growing: each is an orthographic projection along one direction, first the six main
// directions, in which its triangles face at most 60 degrees away and do not overlap. The charts are packed in rows,
// the highest first. No threads are started; deterministic.
#pragma once
#include "reenact/avatar/tsdf.h"

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
