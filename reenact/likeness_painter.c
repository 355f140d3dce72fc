#include "reenact/likeness_painter.h"

#include "reenact/carried.h"
#include "reenact/shaders.h"
#include "reenact/shown_frames.h"
#include "reenact/silhouette.h"
#include "reenact/warp.h"

#include <stdlib.h>
#include <string.h>

enum { VERTEX = 16 };

static const float NEAREST_M = 0.05F, FARTHEST_M = 60, HALF_OUTLINE_PX = 0.5F;

enum uniform {
    VIEWER_FROM_BONE,
    NOW_FROM_BONE,
    VIEW_LENS,
    VIEW_RANGE,
    KIND,
    VIEWER_FROM_NOW,
    SHIFT_RANGE,
    WORLD_FROM_NOW,
    LIGHT,
    COLOR_LENS,
    DEPTH_LENS,
    DEPTH_FROM_COLOR,
    NOW_WINDOWS,
    UNIFORMS
};

// The same mesh each time.
enum program { FIGURE, RIBBON, SOURCE, PROGRAMS };
struct program_plan {
    const char *fragment;
    uint32_t unused; // uniforms that it has not, a bit each
    const char *samplers[4];
    int sampler_count;
};
static const struct program_plan plans[PROGRAMS] = {
    [FIGURE] = {"figure.frag", 0, {"atlas", "shifts", "now_picture", "now_depth"}, 4},
    [RIBBON] = {"figure_ribbon.frag",
             1U << COLOR_LENS | 1U << DEPTH_LENS | 1U << DEPTH_FROM_COLOR | 1U << NOW_WINDOWS,
             {"atlas", "shifts"},
             2},
    [SOURCE] = {"figure_source.frag", 1U << WORLD_FROM_NOW | 1U << LIGHT | 1U << COLOR_LENS, {"atlas_when", "shifts", "now_depth"}, 3},
};
static const char *const uniform_names[UNIFORMS] = {
    [VIEWER_FROM_BONE] = "viewer_from_bone",
    [NOW_FROM_BONE] = "now_from_bone",
    [VIEW_LENS] = "view_lens",
    [VIEW_RANGE] = "view_range",
    [KIND] = "kind",
    [VIEWER_FROM_NOW] = "viewer_from_now",
    [SHIFT_RANGE] = "shift_range",
    [WORLD_FROM_NOW] = "world_from_now",
    [LIGHT] = "light",
    [COLOR_LENS] = "color_lens",
    [DEPTH_LENS] = "depth_lens",
    [DEPTH_FROM_COLOR] = "depth_from_color",
    [NOW_WINDOWS] = "now_windows",
};

// What comes to the GPU bit by bit.
struct brought {
    struct gpu_mesh *mesh;
    struct gpu_texture *color, *when;
    float *vertices; // what they are made of, with the likeness's atlas, until all is there
    int float_count, floats, color_rows, when_rows; // the last three: brought
};

struct likeness_painter {
    struct gpu *gpu;
    struct take *take;
    struct lens view; // the tablet's
    struct likeness likeness;
    struct gpu_program *programs[PROGRAMS];
    struct brought brought; // without a mesh: no likeness was given
    struct silhouette *silhouette;
    struct shown_frames *frames;
};

// Of x / z and y / z: the lens's polynomial is held beyond.
static double largest_r2(const struct lens *l)
{
    double largest = 0;
    const struct pixel corners[] = {
        {-0.5, -0.5}, {l->width - 0.5, -0.5}, {-0.5, l->height - 0.5}, {l->width - 0.5, l->height - 0.5}};
    for (int i = 0; i < 4; i++) {
        struct vec3 ray = lens_ray(l, corners[i]);
        largest = fmax(largest, ray.x * ray.x + ray.y * ray.y);
    }
    return largest * 1.21;
}

void lens_uniform(const struct lens *l, float out[12])
{
    const double values[12] = {l->fx, l->fy, l->cx, l->cy,          l->k1,    l->k2,
                               l->p1, l->p2, l->k3, largest_r2(l), l->width, l->height};
    for (int i = 0; i < 12; i++)
        out[i] = (float)values[i];
}

// ---------------------------------------------------------------- opening

static void set(struct likeness_painter *p, enum uniform uniform, const float *vec4s, int count)
{
    for (int i = 0; i < PROGRAMS; i++)
        if (!(plans[i].unused >> uniform & 1))
            gpu_program_set(p->programs[i], (int)uniform, vec4s, count);
}

static void put_vertex(const struct likeness *f, int i, bool doubled, float v[VERTEX])
{
    const struct unfolded *m = &f->atlas.mesh;
    const struct vec3 *p = &f->atlas.points[i], *n = &f->atlas.normals[i];
    const struct skin *s = &f->skins[m->points[i]];
    const float values[VERTEX] = {
        (float)p->x,  (float)p->y,  (float)p->z,  m->at[i][0] / (float)m->width,
        (float)n->x,  (float)n->y,  (float)n->z,  m->at[i][1] / (float)m->height,
        s->bone[0],   s->bone[1],   s->bone[2],   doubled,
        s->weight[0], s->weight[1], s->weight[2], 0,
    };
    memcpy(v, values, sizeof values);
}

static void drop_likeness(struct likeness_painter *p)
{
    struct brought *b = &p->brought;
    gpu_mesh_close(&b->mesh);
    gpu_texture_close(&b->color);
    gpu_texture_close(&b->when);
    free(b->vertices);
    *b = (struct brought){0};
    silhouette_close(&p->silhouette);
    likeness_free(&p->likeness);
    if (p->frames)
        shown_frames_forget(p->frames);
}

static enum status open_brought(struct likeness_painter *p)
{
    const struct unfolded *m = &p->likeness.atlas.mesh;
    struct brought *b = &p->brought;
    if (2 * m->point_count > UINT16_MAX)
        return fail(ERR_INPUT, "the person is too large to be drawn as one mesh");
    b->float_count = 2 * VERTEX * m->point_count;
    b->vertices = malloc(sizeof *b->vertices * (size_t)b->float_count);
    if (!b->vertices)
        return fail(ERR_MEMORY, "out of memory");
    for (int i = 0; i < 2 * m->point_count; i++)
        put_vertex(&p->likeness, i % m->point_count, i >= m->point_count, b->vertices + VERTEX * (size_t)i);
    enum status status = gpu_texture_open(&b->color, p->gpu, GPU_RGB8, m->width, m->height, GPU_LINEAR, NULL);
    if (status == OK)
        status = gpu_texture_open(&b->when, p->gpu, GPU_RGBA8, m->width, m->height, GPU_NEAREST, NULL);
    if (status == OK)
        status = silhouette_open(&p->silhouette, &p->likeness);
    if (status != OK)
        return status;
    return gpu_mesh_open(&b->mesh, p->gpu, NULL, VERTEX, 2 * m->point_count, NULL, silhouette_most(p->silhouette));
}

enum status likeness_painter_give(struct likeness_painter *p, struct likeness *likeness)
{
    drop_likeness(p);
    p->likeness = *likeness;
    *likeness = (struct likeness){0};
    float light[LIGHT_TERMS][4] = {{0}};
    for (int i = 0; i < LIGHT_TERMS; i++)
        light[i][0] = p->likeness.coat.light.term[i];
    set(p, LIGHT, light[0], LIGHT_TERMS);
    set(p, SHIFT_RANGE, (const float[4]){(float)WARP_MOST_M, (float)p->likeness.atlas.mesh.point_count, 0, 0}, 1);
    enum status status = open_brought(p);
    if (status != OK)
        drop_likeness(p);
    return status;
}

bool likeness_painter_given(const struct likeness_painter *p) { return p->brought.mesh; }

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
    if (!b->vertices)
        return true;
    int floats = share_of(&bytes, b->float_count - b->floats, sizeof(float));
    gpu_mesh_write_vertices(b->mesh, b->floats, b->vertices + b->floats, floats);
    b->floats += floats;
    bring_rows(b->color, a->color, &a->mesh, 3, &b->color_rows, &bytes);
    bring_rows(b->when, a->when, &a->mesh, 4, &b->when_rows, &bytes);
    if (b->when_rows < a->mesh.height)
        return false;
    free(b->vertices);
    b->vertices = NULL;
    return true;
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
        const char *names[UNIFORMS];
        for (int u = 0; u < UNIFORMS; u++)
            names[u] = plans[i].unused >> u & 1 ? NULL : uniform_names[u];
        const struct gpu_program_text text = {
            plans[i].fragment, shader_find("figure.vert"), shader_find(plans[i].fragment), names, UNIFORMS,
            plans[i].samplers, plans[i].sampler_count};
        enum status status = gpu_program_open(&p->programs[i], p->gpu, &text);
        if (status != OK)
            return status;
    }
    const struct calibration *c = take_calibration(p->take);
    const float range[4] = {NEAREST_M, FARTHEST_M, 0, 0};
    float lens[12];
    likeness_painter_set_lens(p, view);
    lens_uniform(&c->color, lens);
    set(p, COLOR_LENS, lens, 3);
    lens_uniform(&c->depth, lens);
    set(p, DEPTH_LENS, lens, 3);
    set(p, VIEW_RANGE, range, 1);
    struct part_map map = part_map_of(c->registered ? POSE_IDENTITY : pose_inverse(c->color_from_depth));
    set(p, DEPTH_FROM_COLOR, map.row[0], 3);
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

static void set_maps(struct likeness_painter *p, enum uniform uniform, struct pose to, const struct posture *posture,
                     struct part_map maps[BONE_COUNT])
{
    for (int b = 0; b < BONE_COUNT; b++)
        maps[b] = part_map_of(pose_multiply(to, posture->bone[b]));
    set(p, uniform, maps[0].row[0], 3 * BONE_COUNT);
}

static void set_turn(struct likeness_painter *p, enum uniform uniform, struct pose turn)
{
    struct part_map map = part_map_of(turn);
    set(p, uniform, map.row[0], 3);
}

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

// The pixels that the figure may fall on, its outline included.
static struct gpu_box box_of(const struct lens *lens, const struct silhouette_corners *c)
{
    enum { SIDE = 16, OUTLINE_PX = 2 };
    const struct gpu_box all = {0, 0, 0, 0};
    double low[2] = {INFINITY, INFINITY}, high[2] = {-INFINITY, -INFINITY}, largest = largest_r2(lens);
    for (int i = 0; i < 4 * (SIDE + 1); i++) { // along the sides, which a lens may bend
        const double along = i / 4 / (double)SIDE, u = i % 4 == 0 ? 0 : i % 4 == 1 ? 1 : along,
                     v = i % 4 == 2 ? 0 : i % 4 == 3 ? 1 : along;
        const struct vec3 ray = {(1 - u) * (double)c->low[0] + u * (double)c->high[0],
                                 (1 - v) * (double)c->low[1] + v * (double)c->high[1], 1};
        if (!(ray.x * ray.x + ray.y * ray.y <= largest) && !lens_is_ideal(lens))
            return all; // out there the shaders hold the lens
        const struct pixel px = lens_project(lens, ray);
        const double at[2] = {px.x, px.y};
        for (int a = 0; a < 2; a++) {
            low[a] = fmin(low[a], at[a]);
            high[a] = fmax(high[a], at[a]);
        }
    }
    const double far[2] = {2.0 * lens->width, 2.0 * lens->height};
    if (!isfinite(low[0]) || !isfinite(low[1]) || !isfinite(high[0]) || !isfinite(high[1]))
        return all;
    for (int a = 0; a < 2; a++) {
        low[a] = fmin(fmax(floor(low[a]) - OUTLINE_PX, -far[a]), far[a]);
        high[a] = fmin(fmax(ceil(high[a]) + OUTLINE_PX, -far[a]), far[a]);
    }
    return (struct gpu_box){(int)low[0], (int)low[1], (int)(high[0] - low[0]) + 1, (int)(high[1] - low[1]) + 1};
}

static void draw_colors(struct likeness_painter *p, const struct likeness_view *view, const struct shown_frame *now,
                        const struct silhouette_corners *corners, struct gpu_box box)
{
    struct gpu_job job = {.target = view->actor,
                          .program = p->programs[FIGURE],
                          .mesh = p->brought.mesh,
                          .textures = {p->brought.color, now->shifts, now->color, now->depth},
                          .closed = true,
                          .depth_test = true,
                          .count = corners->front,
                          .within = box};
    gpu_draw(&job);
    job.program = p->programs[RIBBON];
    job.closed = false; // its triangles run either way
    job.blend = true;
    job.hides_nothing = true; // where two of it cross, the depth's last bit would decide which is seen
    job.first = corners->front;
    job.count = corners->ribbon;
    if (job.count)
        gpu_draw(&job);
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
    struct posture shown, recorded;
    enum status status = shown_frames_of(p->frames, &p->likeness, view->frame, &now);
    if (status == OK)
        status = posture_of(&p->likeness.rest, &view->skeleton, &shown); // world axes
    if (status == OK)
        status = carried_posture(&p->likeness.rest, p->take, view->frame, &recorded);
    if (status != OK)
        return status;
    shown = posture_adjusted(&shown, &now->adjustment);
    recorded = posture_adjusted(&recorded, &now->adjustment);
    struct part_map viewer_from_bone[BONE_COUNT], now_from_bone[BONE_COUNT];
    struct pose viewer_from_world = pose_inverse(view->world_from_viewer);
    set_maps(p, VIEWER_FROM_BONE, viewer_from_world, &shown, viewer_from_bone);
    set_maps(p, NOW_FROM_BONE, POSE_IDENTITY, &recorded, now_from_bone);
    set_turn(p, WORLD_FROM_NOW, e->world_from_camera);
    set_turn(p, VIEWER_FROM_NOW, pose_multiply(viewer_from_world, e->world_from_camera));
    set(p, NOW_WINDOWS, now->windows[0], 2);
    float time_s = (float)((double)(e->time_ns - take_entry(p->take, 0)->time_ns) * 1e-9);
    set(p, KIND, (const float[4]){now->seen, time_s, HALF_OUTLINE_PX, 0}, 1);
    const struct silhouette_corners corners = silhouette_find(p->silhouette, viewer_from_bone, now->shift, absent);
    if (corners.front == 0)
        return OK;
    gpu_mesh_write_indices(p->brought.mesh, 0, corners.corners, corners.front + corners.ribbon);
    const struct gpu_box box = *within = box_of(&p->view, &corners);
    draw_colors(p, view, now, &corners, box);
    if (view->source) {
        gpu_program_set(p->programs[SOURCE], KIND, (const float[4]){now->seen, time_s, 0, 0}, 1);
        gpu_draw(&(struct gpu_job){.target = view->source,
                                   .program = p->programs[SOURCE],
                                   .mesh = p->brought.mesh,
                                   .textures = {p->brought.when, now->shifts, now->depth},
                                   .closed = true,
                                   .depth_test = true,
                                   .count = corners.front,
                                   .within = box});
    }
    return gpu_check(p->gpu);
}
