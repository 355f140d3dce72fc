// Coloured, textured triangles in two dimensions, for controls: drawn into a target or into the window whose context is
// current. Coordinates are pixels of the upright image, x right, y down, (0, 0) at its top left corner. Threads, errors
// and the state after them as in gpu.h.
#pragma once
#include "platform/screen/gpu.h"

#ifdef __cplusplus
extern "C" {
#endif

struct gpu_draw2d;

// The shaders. Inputs: vec2 position at location 0, vec2 uv at 1, vec4 color at 2. Uniform vec4 map[2]: x, y, z of each
// are a row of the affine map from pixels to clip space; w is the share of the texture that uv 0..1 spans, along u and
// along v. One sampler, `picture`. They write premultiplied colours.
struct gpu_draw2d_shaders {
    const char *vertex, *fragment;
};
// ERR_MEMORY; ERR_DEVICE as gpu_program_open.
MUST_CHECK enum status gpu_draw2d_open(struct gpu_draw2d **out, struct gpu *gpu,
                                       const struct gpu_draw2d_shaders *texts);
void gpu_draw2d_close(struct gpu_draw2d **f); // NULL is fine

struct gpu_draw2d_vertex {
    float x, y, u, v;
    uint8_t rgba[4];
};

// Triangles with one texture, clipped to a box.
struct gpu_draw2d_batch {
    const struct gpu_texture *texture;
    float left, top, right, bottom; // pixels
    int first_vertex;               // added to every index
    int first_index, index_count;
};

struct gpu_draw2d_list {
    const struct gpu_draw2d_vertex *vertices;
    const uint16_t *indices;
    const struct gpu_draw2d_batch *batches; // drawn in this order
    int vertex_count, index_count, batch_count;
};

struct gpu_draw2d_view {
    struct gpu_target *target; // NULL: the window
    int width, height;         // of the upright image, pixels
    int quarter_turns;         // 0..3: rotation of the image, clockwise, on its way to the window
    const float *clear;        // red, green, blue; NULL: draw over what is there
};

// begin, any number of draws, end; without another job on the same context in between. The lists are copied.
void gpu_draw2d_begin(struct gpu_draw2d *draw2d, const struct gpu_draw2d_view *view);
void gpu_draw2d_draw(struct gpu_draw2d *draw2d, const struct gpu_draw2d_list *list);
MUST_CHECK enum status gpu_draw2d_end(struct gpu_draw2d *draw2d); // ERR_DEVICE as gpu_check

#ifdef __cplusplus
}
#endif
