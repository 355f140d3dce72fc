// Flat coloured triangles with a texture, drawn over a target or over the window
// whose context is current: what controls are made of. Pixels, top left first.
// Threads and errors as in gpu.h.
#pragma once
#include "platform/gpu.h"

#ifdef __cplusplus
extern "C" {
#endif

struct gpu_draw2d;

// The shaders: vec2 position at location 0, vec2 uv at 1, vec4 color at 2; one
// uniform vec4 map[2], the rows of the affine map from pixels to clip space, and last
// in either what share of the texture uv spans; one sampler, picture. Colours are written with alpha multiplied in.
struct gpu_draw2d_shaders {
    const char *vertex, *fragment;
};
MUST_CHECK enum status gpu_draw2d_open(struct gpu_draw2d **out, struct gpu *g, const struct gpu_draw2d_shaders *texts);
void gpu_draw2d_close(struct gpu_draw2d **f);

struct gpu_draw2d_vertex {
    float x, y, u, v;
    uint8_t rgba[4];
};

// A run of triangles with one texture, clipped to a box.
struct gpu_draw2d_batch {
    const struct gpu_texture *texture;
    float left, top, right, bottom; // pixels
    int first_vertex;               // added to every index
    int first_index, index_count;
};

struct gpu_draw2d_view {
    struct gpu_target *target; // NULL: the window
    int width, height;         // of the picture, upright, pixels
    int quarter_turns;         // 0..3: how often the picture is turned clockwise on its way to the window
    const float *clear;        // NULL: drawn over what is there; else red, green, blue
};

void gpu_draw2d_begin(struct gpu_draw2d *f, const struct gpu_draw2d_view *view);
// Valid between begin and the next job on the same context.
void gpu_draw2d_draw(struct gpu_draw2d *f, const struct gpu_draw2d_vertex *vertices, int vertex_count,
                     const uint16_t *indices, int index_count, const struct gpu_draw2d_batch *runs, int run_count);
MUST_CHECK enum status gpu_draw2d_end(struct gpu_draw2d *f);

#ifdef __cplusplus
}
#endif
