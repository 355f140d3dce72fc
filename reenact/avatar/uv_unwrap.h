// Lays a surface out flat in a picture, so that every place of it has a place of its
// own there: cut into charts that bend little, each seen squarely, side by side. Pure;
// deterministic.
#pragma once
#include "reenact/avatar/tsdf.h"

enum { UV_CHART_MARGIN = 2 }; // texels about each chart that are nobody else's

struct uv_mesh {
    int32_t *points;  // point_count: numbers of the surface's points; those on a cut are there once for each chart
    float (*at)[2];   // where each lies, texels; the centre of the first is (0.5, 0.5)
    int32_t *corners; // corner_count, three to a triangle: numbers in `points`, in the order that they were given
    int32_t (*neighbor)[3]; // of each triangle: those across its edges, the first from its first to its second corner;
                            // -1: none
    int point_count, corner_count;
    int width, height; // of the picture
};

// corners: triangles between the surface's points. texel_m: how much of the surface a texel
// takes; a chart's places that are turned aside take up to twice as much. ERR_MEMORY;
// ERR_INPUT: longer than 1024 texels, or does not fit into a picture of 1280 texels square.
MUST_CHECK enum status uv_unwrap(struct uv_mesh *out, const struct surface_mesh *surface, const int32_t *corners,
                                 int corner_count, double texel_m);
void uv_mesh_free(struct uv_mesh *u);
