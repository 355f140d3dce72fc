#include "reenact/render/solid_renderer.h"

#include "reenact/render/shaders.h"

#include <stdlib.h>
#include <string.h>

enum { MAX_VERTICES = 65536, FLOATS = 12 };
_Static_assert(sizeof(struct solid_vertex) == FLOATS * sizeof(float), "vertices are floats side by side");

enum uniform { VIEWER_FROM_SOLID, VIEW_LENS, VIEW_RANGE, UNIFORMS };
static const char *const uniform_names[UNIFORMS] = {
    [VIEWER_FROM_SOLID] = "viewer_from_solid", [VIEW_LENS] = "view_lens", [VIEW_RANGE] = "view_range"};

struct solid_mesh {
    struct gpu_mesh **pieces; // of at most MAX_VERTICES
    int *drawn;               // corners of each
    int count;
};

struct solid_renderer {
    struct gpu_program *program;
    struct gpu_texture *white;
};

// ---------------------------------------------------------------- meshes

static enum status add_piece(struct solid_mesh *mesh, struct gpu *gpu, const struct gpu_mesh_data *data)
{
    struct gpu_mesh **pieces = realloc(mesh->pieces, sizeof *pieces * ((size_t)mesh->count + 1));
    if (pieces)
        mesh->pieces = pieces;
    int *drawn = realloc(mesh->drawn, sizeof *drawn * ((size_t)mesh->count + 1));
    if (drawn)
        mesh->drawn = drawn;
    if (!pieces || !drawn)
        return fail(ERR_MEMORY, "no memory for the solids' renderer");
    const enum status status = gpu_mesh_open(&mesh->pieces[mesh->count], gpu, data);
    if (status == OK)
        mesh->drawn[mesh->count++] = data->index_count;
    return status;
}

struct splitter {
    struct solid_vertex *vertices; // MAX_VERTICES
    uint16_t *corners;             // as many as there are in all
    int32_t *number;               // of each vertex in the piece; -1: not in it
    int32_t *members;              // MAX_VERTICES: which those are
    int vertex_count, corner_count;
};

static enum status flush_piece(struct splitter *splitter, struct solid_mesh *mesh, struct gpu *gpu)
{
    const struct gpu_mesh_data data = {&splitter->vertices[0].at[0], FLOATS, splitter->vertex_count, splitter->corners,
                                       splitter->corner_count};
    const enum status status = splitter->corner_count ? add_piece(mesh, gpu, &data) : OK;
    for (int i = 0; i < splitter->vertex_count; i++)
        splitter->number[splitter->members[i]] = -1;
    splitter->vertex_count = splitter->corner_count = 0;
    return status;
}

static enum status split_mesh(struct splitter *splitter, struct solid_mesh *mesh, struct gpu *gpu,
                              const struct solid_vertex *vertices, const uint32_t *corners, int corner_count)
{
    enum status status = OK;
    for (int i = 0; i + 2 < corner_count && status == OK; i += 3) {
        if (splitter->vertex_count + 3 > MAX_VERTICES)
            status = flush_piece(splitter, mesh, gpu);
        for (int k = 0; k < 3; k++) {
            const uint32_t v = corners[i + k];
            if (splitter->number[v] < 0) {
                splitter->number[v] = splitter->vertex_count;
                splitter->members[splitter->vertex_count] = (int32_t)v;
                splitter->vertices[splitter->vertex_count++] = vertices[v];
            }
            splitter->corners[splitter->corner_count++] = (uint16_t)splitter->number[v];
        }
    }
    return status == OK ? flush_piece(splitter, mesh, gpu) : status;
}

enum status solid_mesh_open(struct solid_mesh **out, struct gpu *gpu, const struct solid_vertex *vertices,
                            int vertex_count, const uint32_t *corners, int corner_count)
{
    struct solid_mesh *m = *out = calloc(1, sizeof *m);
    struct splitter s = {.vertices = malloc(sizeof *s.vertices * MAX_VERTICES),
                         .corners = malloc(sizeof *s.corners * (size_t)(corner_count + 1)),
                         .number = malloc(sizeof *s.number * (size_t)(vertex_count + 1)),
                         .members = malloc(sizeof *s.members * MAX_VERTICES)};
    enum status status = m && s.vertices && s.corners && s.number && s.members
                             ? OK
                             : fail(ERR_MEMORY, "no memory for the solids' renderer");
    for (int i = 0; i < vertex_count && status == OK; i++)
        s.number[i] = -1;
    if (status == OK)
        status = split_mesh(&s, m, gpu, vertices, corners, corner_count);
    free(s.vertices);
    free(s.corners);
    free(s.number);
    free(s.members);
    if (status != OK)
        solid_mesh_close(out);
    return status;
}

void solid_mesh_close(struct solid_mesh **out)
{
    struct solid_mesh *m = *out;
    if (!m)
        return;
    for (int i = 0; i < m->count; i++)
        gpu_mesh_close(&m->pieces[i]);
    free(m->pieces);
    free(m->drawn);
    free(m);
    *out = NULL;
}

void solid_mesh_write(struct solid_mesh *mesh, const struct solid_vertex *vertices, int vertex_count,
                      const uint16_t *corners, int corner_count)
{
    assert(mesh->count == 1);
    gpu_mesh_write_vertices(mesh->pieces[0], 0, &vertices[0].at[0], vertex_count * FLOATS);
    if (corner_count)
        gpu_mesh_write_indices(mesh->pieces[0], 0, corners, corner_count);
    mesh->drawn[0] = corner_count;
}

// ---------------------------------------------------------------- drawing

enum status solid_renderer_open(struct solid_renderer **out, struct gpu *gpu)
{
    static const char *const samplers[] = {"picture"};
    static const uint8_t white[4] = {255, 255, 255, 255};
    const struct gpu_program_source text = {.name = "solid",
                                            .vertex = shader_find("solid.vert"),
                                            .fragment = shader_find("solid.frag"),
                                            .uniforms = uniform_names,
                                            .uniform_count = UNIFORMS,
                                            .samplers = samplers,
                                            .sampler_count = 1};
    struct solid_renderer *r = *out = calloc(1, sizeof *r);
    if (!r)
        return fail(ERR_MEMORY, "no memory for the solids' renderer");
    enum status status = gpu_program_open(&r->program, gpu, &text);
    if (status == OK)
        status = gpu_texture_open(&r->white, gpu, &(struct gpu_texture_layout){GPU_RGBA8, 1, 1, GPU_NEAREST}, white);
    if (status != OK)
        solid_renderer_close(out);
    return status;
}

void solid_renderer_close(struct solid_renderer **renderer)
{
    if (!*renderer)
        return;
    gpu_program_close(&(*renderer)->program);
    gpu_texture_close(&(*renderer)->white);
    free(*renderer);
    *renderer = NULL;
}

void solid_renderer_draw(struct solid_renderer *renderer, const struct solid_view *view, const struct solid_mesh *mesh,
                         const struct solid_look *look)
{
    const struct pose viewer_from_solid = pose_multiply(pose_inverse(view->world_from_camera), look->world_from_solid);
    const float range[4] = {(float)VIEW_NEAREST_M, VIEW_FARTHEST_M, 0, 0};
    const struct vec3 t = viewer_from_solid.translation;
    const double shift[3] = {t.x, t.y, t.z};
    double m[3][3];
    float rows[12], lens[12];
    quat_to_matrix(viewer_from_solid.rotation, m);
    for (int i = 0; i < 3; i++) {
        for (int k = 0; k < 3; k++)
            rows[4 * i + k] = (float)(look->scale * m[i][k]);
        rows[4 * i + 3] = (float)shift[i];
    }
    lens_uniform(&view->lens, lens);
    gpu_program_set(renderer->program, VIEWER_FROM_SOLID, rows, 3);
    gpu_program_set(renderer->program, VIEW_LENS, lens, 3);
    gpu_program_set(renderer->program, VIEW_RANGE, range, 1);
    for (int i = 0; i < mesh->count; i++)
        if (mesh->drawn[i])
            gpu_draw(&(struct gpu_job){.target = view->target,
                                       .program = renderer->program,
                                       .mesh = mesh->pieces[i],
                                       .textures = {look->picture ? look->picture : renderer->white},
                                       .closed = look->closed,
                                       .depth_test = true,
                                       .blend = true,
                                       .count = mesh->drawn[i]});
}
