#include "reenact/render/avatar_renderer.h"

#include "reenact/render/shaders.h"
#include "reenact/render/frame_layer_cache.h"
#include "reenact/render/silhouette_edges.h"
#include "reenact/render/screen_bounds.h"

#include <stdlib.h>
#include <string.h>

enum { VERTEX = 16 };

static const float NEAREST_M = 0.05F, FARTHEST_M = 60, HALF_OUTLINE_PX = 0.5F;

enum uniform { VIEW_LENS, VIEW_RANGE, KIND, VIEWER_FROM_NOW, UNIFORMS };

// The same mesh each time.
enum program { FIGURE, GATHERED, SOURCE, FIGURE_IN_ROOM, GATHERED_IN_ROOM, PROGRAMS };
struct program_plan {
    const char *fragment;
    const char *samplers[4];
    int sampler_count;
    const char *word;
};
static const struct program_plan plans[PROGRAMS] = {
    [FIGURE] = {"avatar.frag", {"atlas", "now_picture", "now_depth"}, 3, NULL},
    [GATHERED] = {"avatar_fused.frag", {"atlas"}, 1, NULL},
    [SOURCE] = {"avatar_source.frag", {"atlas_when", "now_depth"}, 2, NULL},
    [FIGURE_IN_ROOM] = {"avatar.frag", {"atlas", "now_picture", "now_depth", "room"}, 4, "IN_ROOM"},
    [GATHERED_IN_ROOM] = {"avatar_fused.frag", {"atlas", "room"}, 2, "IN_ROOM"},
};
static const char *const uniform_names[UNIFORMS] = {
    [VIEW_LENS] = "view_lens",
    [VIEW_RANGE] = "view_range",
    [KIND] = "kind",
    [VIEWER_FROM_NOW] = "viewer_from_now",
};

// What comes to the GPU bit by bit.
struct brought {
    struct gpu_texture *color, *when;
    int color_rows, when_rows; // brought
};

// What comes to it for each picture: the points that the picture shows.
struct shown_mesh {
    struct gpu_mesh *mesh; // NULL: no likeness was given
    float (*vertices)[VERTEX];
    uint16_t *corners;
    int32_t *number; // of a point, then of its double, among the vertices; -1: it is not there yet
    int vertex_count;
};

struct likeness_painter {
    struct gpu *gpu;
    struct take *take;
    struct lens view; // the tablet's
    struct likeness likeness;
    struct gpu_program *programs[PROGRAMS];
    struct brought brought;
    struct shown_mesh shown;
    struct silhouette *silhouette;
    struct shown_frames *frames;
    int rehearsed; // ways in which he is drawn
};

void lens_uniform(const struct lens *l, float out[12])
{
    const double values[12] = {l->fx,    l->fy,    l->cx, l->cy, l->k1, l->k2, l->p1, l->p2, l->k3, lens_largest_r2(l),
                               l->width, l->height};
    for (int i = 0; i < 12; i++)
        out[i] = (float)values[i];
}

// ---------------------------------------------------------------- opening

static void set(struct likeness_painter *p, enum uniform uniform, const float *vec4s, int count)
{
    for (int i = 0; i < PROGRAMS; i++)
        gpu_program_set(p->programs[i], (int)uniform, vec4s, count);
}

static void drop_likeness(struct likeness_painter *p)
{
    gpu_texture_close(&p->brought.color);
    gpu_texture_close(&p->brought.when);
    p->brought = (struct brought){0};
    p->rehearsed = 0;
    gpu_mesh_close(&p->shown.mesh);
    free(p->shown.vertices);
    free(p->shown.corners);
    free(p->shown.number);
    p->shown = (struct shown_mesh){0};
    silhouette_close(&p->silhouette);
    likeness_free(&p->likeness);
    if (p->frames)
        shown_frames_forget(p->frames);
}

static enum status open_shown(struct likeness_painter *p)
{
    struct shown_mesh *m = &p->shown;
    const int points = p->likeness.atlas.mesh.point_count, most = silhouette_most(p->silhouette);
    if (2 * points > UINT16_MAX)
        return fail(ERR_INPUT, "the person is too large to be drawn as one mesh");
    m->vertices = malloc(sizeof *m->vertices * 2 * (size_t)points);
    m->number = malloc(sizeof *m->number * 2 * (size_t)points);
    m->corners = malloc(sizeof *m->corners * (size_t)most);
    if (!m->vertices || !m->number || !m->corners)
        return fail(ERR_MEMORY, "out of memory");
    return gpu_mesh_open(&m->mesh, p->gpu, NULL, VERTEX, 2 * points, NULL, most);
}

static enum status open_brought(struct likeness_painter *p)
{
    const struct unfolded *m = &p->likeness.atlas.mesh;
    struct brought *b = &p->brought;
    enum status status = gpu_texture_open(&b->color, p->gpu, GPU_RGB8, m->width, m->height, GPU_LINEAR, NULL);
    if (status == OK)
        status = gpu_texture_open(&b->when, p->gpu, GPU_RGBA8, m->width, m->height, GPU_NEAREST, NULL);
    if (status == OK)
        status = silhouette_open(&p->silhouette, &p->likeness);
    return status == OK ? open_shown(p) : status;
}

enum status likeness_painter_give(struct likeness_painter *p, struct likeness *likeness)
{
    drop_likeness(p);
    p->likeness = *likeness;
    *likeness = (struct likeness){0};
    enum status status = open_brought(p);
    if (status != OK)
        drop_likeness(p);
    return status;
}

bool likeness_painter_given(const struct likeness_painter *p) { return p->shown.mesh; }

const struct likeness *likeness_painter_likeness(const struct likeness_painter *p)
{
    return likeness_painter_given(p) ? &p->likeness : NULL;
}

enum status likeness_painter_give_frame(struct likeness_painter *p, struct loaded_frame *loaded)
{
    return shown_frames_give(p->frames, loaded);
}

int64_t likeness_painter_near(const struct likeness_painter *p, int64_t frame, int64_t within_ns)
{
    return shown_frames_near(p->frames, frame, within_ns);
}

// Of `wanted` pieces of so many bytes, those that there are bytes left for; takes these off.
static int share_of(size_t *bytes, int wanted, size_t piece)
{
    size_t most = *bytes / piece;
    int count = (size_t)wanted < most ? wanted : (int)most;
    *bytes -= piece * (size_t)count;
    return count;
}

static void bring_rows(struct gpu_texture *t, const uint8_t *pixels, const struct unfolded *m, int each, int *rows,
                       size_t *bytes)
{
    size_t row = (size_t)each * (size_t)m->width;
    int count = share_of(bytes, m->height - *rows, row);
    if (count)
        gpu_texture_write_rows(t, *rows, count, pixels + row * (size_t)*rows);
    *rows += count;
}

bool likeness_painter_bring(struct likeness_painter *p, size_t bytes)
{
    struct brought *b = &p->brought;
    struct atlas *a = &p->likeness.atlas;
    if (!likeness_painter_given(p))
        return false;
    bring_rows(b->color, a->color, &a->mesh, 3, &b->color_rows, &bytes);
    bring_rows(b->when, a->when, &a->mesh, 4, &b->when_rows, &bytes);
    return b->when_rows == a->mesh.height;
}

void likeness_painter_set_lens(struct likeness_painter *p, const struct lens *view)
{
    float lens[12];
    lens_uniform(view, lens);
    p->view = *view;
    set(p, VIEW_LENS, lens, 3);
}

static enum status open_programs(struct likeness_painter *p, const struct lens *view)
{
    for (int i = 0; i < PROGRAMS; i++) {
        const struct gpu_program_text text = {.name = plans[i].fragment,
                                              .vertex = shader_find("avatar.vert"),
                                              .fragment = shader_find(plans[i].fragment),
                                              .uniforms = uniform_names,
                                              .uniform_count = UNIFORMS,
                                              .samplers = plans[i].samplers,
                                              .sampler_count = plans[i].sampler_count,
                                              .word = plans[i].word};
        enum status status = gpu_program_open(&p->programs[i], p->gpu, &text);
        if (status != OK)
            return status;
    }
    const float range[4] = {NEAREST_M, FARTHEST_M, 0, 0};
    likeness_painter_set_lens(p, view);
    set(p, VIEW_RANGE, range, 1);
    return OK;
}

enum status likeness_painter_open(struct likeness_painter **out, struct gpu *gpu, struct take *take,
                                  const struct source_rays *rays, const struct lens *view, size_t max_bytes)
{
    struct likeness_painter *p = *out = calloc(1, sizeof *p);
    if (!p)
        return fail(ERR_MEMORY, "out of memory");
    p->gpu = gpu;
    p->take = take;
    enum status status = shown_frames_open(&p->frames, gpu, take, rays, max_bytes);
    if (status == OK)
        status = open_programs(p, view);
    if (status != OK)
        likeness_painter_close(out);
    return status;
}

void likeness_painter_close(struct likeness_painter **out)
{
    struct likeness_painter *p = *out;
    if (!p)
        return;
    drop_likeness(p);
    shown_frames_close(&p->frames);
    for (int i = 0; i < PROGRAMS; i++)
        gpu_program_close(&p->programs[i]);
    free(p);
    *out = NULL;
}

// ---------------------------------------------------------------- drawing

// How many parts there are to draw; the others are marked as absent.
static int find_absent(const struct likeness_painter *p, const struct likeness_view *view, bool absent[PART_COUNT])
{
    int present = 0;
    const struct skeleton *s = &view->skeleton;
    struct pose viewer_from_world = pose_inverse(view->world_from_viewer);
    for (int part = 0; part < PART_COUNT; part++) {
        const enum joint ends[] = {part_ends[part].from, part_ends[part].to};
        bool known = part_is_known(take_body(p->take), s, (enum part)part), before = false;
        for (int e = 0; e < 2 && known; e++)
            before |= pose_apply(viewer_from_world, s->joint[ends[e]]).z > (double)NEAREST_M;
        known = known && v3_distance(s->joint[ends[0]], s->joint[ends[1]]) > 1e-3;
        absent[part] = !known;
        present += known && before;
    }
    return present;
}

// The vertex of a point or, from point_count on, of a point's double.
static void put_vertex(const struct likeness_painter *p, const struct shown_frame *now,
                       const struct silhouette_corners *from, int i, float v[VERTEX])
{
    const struct unfolded *m = &p->likeness.atlas.mesh;
    const int point = i % m->point_count;
    const struct loaded_point *k = &now->points[point];
    const struct spot *at = &from->placed[point];
    const float u = m->at[point][0] / (float)m->width, t = m->at[point][1] / (float)m->height;
    const float opaque = i < m->point_count;
    const float values[][4] = {{at->x, at->y, at->z, opaque},                         // point
                               {u, t, k->in_color[0], k->in_color[1]},                // places
                               {k->in_depth[0], k->in_depth[1], k->away_m, k->seen},  // there
                               {k->facing[0], k->facing[1], k->facing[2], k->light}}; // facing
    _Static_assert(sizeof values == VERTEX * sizeof *v, "as the shader's inputs");
    memcpy(v, values, sizeof values);
}

// Only the points that are drawn, in the order in which they are wanted.
static void bring_shown(struct likeness_painter *p, const struct shown_frame *now,
                        const struct silhouette_corners *from)
{
    struct shown_mesh *m = &p->shown;
    const int count = from->front + from->ribbon;
    memset(m->number, 0xff, sizeof *m->number * 2 * (size_t)p->likeness.atlas.mesh.point_count);
    m->vertex_count = 0;
    for (int i = 0; i < count; i++) {
        int32_t *number = &m->number[from->corners[i]];
        if (*number < 0) {
            *number = m->vertex_count++;
            put_vertex(p, now, from, from->corners[i], m->vertices[*number]);
        }
        m->corners[i] = (uint16_t)*number;
    }
    gpu_mesh_write_vertices(m->mesh, 0, m->vertices[0], VERTEX * m->vertex_count);
    gpu_mesh_write_indices(m->mesh, 0, m->corners, count);
}

// What he is drawn of, in this order: triangles that may have the shown frame's own colours, the others, the ribbon.
enum layer { OWN, OTHERS, RIBBON, LAYERS };

static void draw_layer(struct likeness_painter *p, enum layer layer, const struct gpu_job *of)
{
    const struct gpu_texture *room = of->textures[3];
    struct gpu_job job = *of;
    job.mesh = p->shown.mesh;
    job.textures[0] = p->brought.color;
    job.program = p->programs[room ? FIGURE_IN_ROOM : FIGURE];
    job.closed = layer != RIBBON; // its triangles run either way
    job.depth_test = true;
    job.blend = layer == RIBBON;
    job.hides_nothing = layer == RIBBON; // where two of it cross, the depth's last bit would decide which is seen
    if (layer != OWN) {
        job.program = p->programs[room ? GATHERED_IN_ROOM : GATHERED];
        job.textures[1] = room;
    }
    gpu_draw(&job);
}

static void draw_colors(struct likeness_painter *p, const struct likeness_view *view, const struct shown_frame *now,
                        const struct silhouette_corners *corners, struct gpu_box box)
{
    const int ends[LAYERS] = {corners->own, corners->front, corners->front + corners->ribbon};
    struct gpu_job job = {.target = view->actor, .textures = {NULL, now->color, now->depth, view->room}, .within = box};
    for (int layer = 0; layer < LAYERS; layer++) {
        job.count = ends[layer] - job.first;
        if (job.count)
            draw_layer(p, (enum layer)layer, &job);
        job.first = ends[layer];
    }
}

enum status likeness_painter_rehearse(struct likeness_painter *p, struct gpu_target *actor,
                                      const struct gpu_texture *room, bool *done)
{
    enum { SIDE = 3 }; // of pictures as shown frames' are: their sides are no powers of two (frame_layer.c)
    const float nothing[3 * VERTEX] = {0};
    const uint16_t corners[3] = {0, 1, 2};
    struct gpu_texture *color = NULL, *depth = NULL;
    enum status status = gpu_texture_open(&color, p->gpu, GPU_RGB8, SIDE, SIDE, GPU_LINEAR, NULL);
    if (status == OK)
        status = gpu_texture_open(&depth, p->gpu, GPU_RGBA8, SIDE, SIDE, GPU_NEAREST, NULL);
    if (status == OK) {
        const struct gpu_job job = {.target = actor,
                                    .textures = {NULL, color, depth, p->rehearsed < LAYERS ? NULL : room},
                                    .count = 3,
                                    .within = {-1, -1, 1, 1}};
        gpu_mesh_write_vertices(p->shown.mesh, 0, nothing, 3 * VERTEX);
        gpu_mesh_write_indices(p->shown.mesh, 0, corners, 3);
        draw_layer(p, (enum layer)(p->rehearsed++ % LAYERS), &job);
    }
    gpu_texture_close(&color);
    gpu_texture_close(&depth);
    *done = p->rehearsed >= (room ? 2 : 1) * LAYERS;
    return status == OK ? gpu_check(p->gpu) : status;
}

enum status likeness_painter_draw(struct likeness_painter *p, const struct likeness_view *view, int *parts,
                                  struct gpu_box *within)
{
    bool absent[PART_COUNT];
    *parts = find_absent(p, view, absent);
    if (!*parts)
        return NOTHING;
    const struct take_entry *e = take_entry(p->take, view->frame);
    const struct shown_frame *now;
    struct posture shown;
    enum status status = shown_frames_of(p->frames, &p->likeness, view->frame, &now);
    if (status == OK && !now->points)
        return NOTHING;
    if (status == OK)
        status = posture_of(&p->likeness.rest, &view->skeleton, &shown); // world axes
    if (status != OK)
        return status;
    shown = posture_adjusted(&shown, &now->adjustment);
    const struct pose viewer_from_world = pose_inverse(view->world_from_viewer);
    struct part_map viewer_from_bone[BONE_COUNT];
    for (int b = 0; b < BONE_COUNT; b++)
        viewer_from_bone[b] = part_map_of(pose_multiply(viewer_from_world, shown.bone[b]));
    const struct silhouette_corners corners =
        silhouette_find(p->silhouette, viewer_from_bone, now->shift, now->own, absent);
    if (corners.front == 0)
        return OK;
    bring_shown(p, now, &corners);
    const struct part_map turn = part_map_of(pose_multiply(viewer_from_world, e->world_from_camera));
    set(p, VIEWER_FROM_NOW, turn.row[0], 3);
    const float time_s = (float)((double)(e->time_ns - take_entry(p->take, 0)->time_ns) * 1e-9);
    set(p, KIND, (const float[4]){time_s, HALF_OUTLINE_PX, 0, 0}, 1);
    const struct gpu_box box = *within =
        view_box(&p->view, (const double[]){(double)corners.low[0], (double)corners.low[1]},
                 (const double[]){(double)corners.high[0], (double)corners.high[1]});
    draw_colors(p, view, now, &corners, box);
    if (view->source) {
        gpu_program_set(p->programs[SOURCE], KIND, (const float[4]){time_s, 0, 0, 0}, 1);
        gpu_draw(&(struct gpu_job){.target = view->source,
                                   .program = p->programs[SOURCE],
                                   .mesh = p->shown.mesh,
                                   .textures = {p->brought.when, now->depth},
                                   .closed = true,
                                   .depth_test = true,
                                   .count = corners.front,
                                   .within = box});
    }
    return gpu_check(p->gpu);
}
