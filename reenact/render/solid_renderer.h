// Draws coloured, textured surfaces from any viewpoint: models of things, the map of a place, a filmed picture bent
// over its depth. Threads, errors and memory as in platform/screen/gpu.h.
#pragma once
#include "base/lens.h"
#include "platform/screen/gpu.h"

struct solid_vertex {
    float at[3], u;
    float normal[3], v; // all 0: not lit
    float color[4];     // straight alpha
};

struct solid_mesh;
// Of triangles, three corners each, any number of vertices; copied. ERR_MEMORY, ERR_DEVICE.
MUST_CHECK enum status solid_mesh_open(struct solid_mesh **out, struct gpu *gpu, const struct solid_vertex *vertices,
                                       int vertex_count, const uint32_t *corners, int corner_count);
void solid_mesh_close(struct solid_mesh **m); // NULL is fine
// Puts other vertices and corners in, at most as many as it was opened with. Only for meshes of at most 65536 vertices.
void solid_mesh_write(struct solid_mesh *mesh, const struct solid_vertex *vertices, int vertex_count,
                      const uint16_t *corners, int corner_count);

struct solid_renderer;
MUST_CHECK enum status solid_renderer_open(struct solid_renderer **out, struct gpu *gpu);
void solid_renderer_close(struct solid_renderer **renderer); // NULL is fine

struct solid_view {
    struct gpu_target *target; // with a depth buffer; not cleared
    struct lens lens;
    struct pose world_from_camera;
};

struct solid_look {
    struct pose world_from_solid;
    double scale;                      // of the solid, before the pose; > 0
    const struct gpu_texture *picture; // premultiplied; NULL: white
    bool closed;                       // what turns its back is not drawn
};
void solid_renderer_draw(struct solid_renderer *renderer, const struct solid_view *view, const struct solid_mesh *mesh,
                         const struct solid_look *look);
