#include "reenact/likeness_painter.h"

#include "reenact/shaders.h"
#include "reenact/warp.h"

#include <stdlib.h>
#include <string.h>

enum { VERTEX = 20, INNER_PX = 3 };

static const float NEAREST_M = 0.05F, FARTHEST_M = 60;
static const double COARSE_PX_A_M = 1 / VOLUME_STEP_M; // up to here a step of the fine mesh is finer than a pixel

enum uniform {
    VIEWER_FROM_PART,
    NOW_FROM_PART,
    WORLD_FROM_NOW,
    LIGHT,
    VIEW_LENS,
    VIEW_RANGE,
    COLOR_LENS,
    DEPTH_LENS,
    DEPTH_FROM_COLOR,
    KIND,
    ABSENT,
    SHIFT_GRID,
    UNIFORMS
};
static const char *const uniform_names[UNIFORMS] = {
    [VIEWER_FROM_PART] = "viewer_from_part",
    [NOW_FROM_PART] = "now_from_part",
    [WORLD_FROM_NOW] = "world_from_now",
    [LIGHT] = "light",
    [VIEW_LENS] = "view_lens",
    [VIEW_RANGE] = "view_range",
    [COLOR_LENS] = "color_lens",
    [DEPTH_LENS] = "depth_lens",
    [DEPTH_FROM_COLOR] = "depth_from_color",
    [KIND] = "kind",
    [ABSENT] = "absent",
    [SHIFT_GRID] = "shift_grid",
};

// A mesh that comes to the GPU bit by bit.
struct brought {
    struct gpu_mesh *mesh;
    float *vertices; // what it is made of, until it is all there
    uint16_t *corners;
    int float_count, corner_count, brought_floats, brought_corners;
};

struct likeness_painter {
    struct gpu *gpu;
    struct take *take;
    struct likeness likeness;
    struct sight sight;
    struct gpu_program *program;
    struct brought fine, coarse;  // without meshes: no likeness was given
    struct gpu_texture *now_picture, *now_depth;
    uint8_t *color, *depth;       // their pixels
    int64_t frame;                // whose pictures are there; -1: nobody's
    bool has_now;                 // it has colours and depth
    struct adjustment adjustment; // of that frame, and what goes beyond it
    struct warp *warp;
    struct gpu_texture *shifts;
};

void lens_uniform(const struct lens *l, float out[12])
{
    double largest = 0;
    const struct pixel corners[] = {
        {-0.5, -0.5}, {l->width - 0.5, -0.5}, {-0.5, l->height - 0.5}, {l->width - 0.5, l->height - 0.5}};
    for (int i = 0; i < 4; i++) {
        struct vec3 ray = lens_ray(l, corners[i]);
        largest = fmax(largest, ray.x * ray.x + ray.y * ray.y);
    }
    const double values[12] = {l->fx, l->fy, l->cx, l->cy,          l->k1,    l->k2,
                               l->p1, l->p2, l->k3, largest * 1.21, l->width, l->height};
    for (int i = 0; i < 12; i++)
        out[i] = (float)values[i];
}

// ---------------------------------------------------------------- opening

static void put_vertex(const struct likeness *f, int i, const float c[3], float v[VERTEX])
{
    const struct vec3 *p = &f->surface.points[i], *n = &f->surface.normals[i];
    const struct skin *s = &f->skins[i];
    const float values[VERTEX] = {
        (float)p->x,  (float)p->y,  (float)p->z,  f->coat.time_s[i],
        (float)n->x,  (float)n->y,  (float)n->z,  f->coat.filled[i],
        s->part[0],   s->part[1],   s->part[2],   0,
        s->weight[0], s->weight[1], s->weight[2], 0,
        c[0],         c[1],         c[2],         0,
    };
    memcpy(v, values, sizeof values);
}

static void drop_mesh(struct brought *b)
{
    gpu_mesh_close(&b->mesh);
    free(b->vertices);
    free(b->corners);
    *b = (struct brought){0};
}

static void drop_likeness(struct likeness_painter *p)
{
    drop_mesh(&p->fine);
    drop_mesh(&p->coarse);
    warp_close(&p->warp);
    gpu_texture_close(&p->shifts);
    likeness_free(&p->likeness);
    p->frame = -1;
}

// points: numbers of the surface's points; NULL: all of them, as they are.
static enum status open_mesh(struct likeness_painter *p, struct brought *b, const int32_t *points, int point_count,
                             float (*colors)[3], const int32_t *corners, int corner_count)
{
    if (point_count > UINT16_MAX)
        return fail(ERR_INPUT, "the person is too large to be drawn as one mesh");
    b->float_count = VERTEX * point_count;
    b->corner_count = corner_count;
    b->vertices = malloc(sizeof *b->vertices * (size_t)b->float_count);
    b->corners = malloc(sizeof *b->corners * (size_t)corner_count);
    if (!b->vertices || !b->corners)
        return fail(ERR_MEMORY, "out of memory");
    for (int i = 0; i < point_count; i++)
        put_vertex(&p->likeness, points ? points[i] : i, colors[i], b->vertices + VERTEX * (size_t)i);
    for (int i = 0; i < corner_count; i++)
        b->corners[i] = (uint16_t)corners[i];
    return gpu_mesh_open(&b->mesh, p->gpu, NULL, VERTEX, point_count, NULL, corner_count);
}

static enum status open_meshes(struct likeness_painter *p)
{
    const struct likeness *f = &p->likeness;
    const struct surface *s = &f->surface;
    const struct coarse *c = &f->coarse;
    enum status status =
        open_mesh(p, &p->fine, NULL, s->point_count, f->coat.color, s->corners, s->corner_count);
    return status == OK
               ? open_mesh(p, &p->coarse, c->points, c->point_count, c->color, c->corners, c->corner_count)
               : status;
}

static enum status open_warp(struct likeness_painter *p)
{
    const struct likeness *f = &p->likeness;
    enum status status = warp_open(&p->warp, &f->rest, &f->surface, take_calibration(p->take));
    if (status != OK)
        return status;
    struct warp_grid g = warp_grid_of(p->warp);
    const float uniform[8] = {(float)g.corner.x, (float)g.corner.y, (float)g.corner.z, (float)WARP_STEP_M,
                              (float)g.size[0],  (float)g.size[1],  (float)g.size[2],  (float)WARP_MOST_M};
    gpu_program_set(p->program, SHIFT_GRID, uniform, 2);
    return gpu_texture_open(&p->shifts, p->gpu, GPU_RGBA8, g.size[0], g.size[1] * g.size[2], GPU_NEAREST,
                            warp_picture(p->warp));
}

enum status likeness_painter_give(struct likeness_painter *p, struct likeness *likeness)
{
    drop_likeness(p);
    p->likeness = *likeness;
    *likeness = (struct likeness){0};
    float light[LIGHT_TERMS][4] = {{0}};
    for (int i = 0; i < LIGHT_TERMS; i++)
        light[i][0] = p->likeness.coat.light.term[i];
    gpu_program_set(p->program, LIGHT, light[0], LIGHT_TERMS);
    enum status status = open_meshes(p);
    if (status == OK)
        status = open_warp(p);
    if (status != OK)
        drop_likeness(p);
    return status;
}

bool likeness_painter_given(const struct likeness_painter *p) { return p->coarse.mesh; }

// At most *bytes, and takes off what it took. True: all is there.
static bool bring(struct brought *b, size_t *bytes)
{
    if (!b->vertices)
        return true;
    int floats = b->float_count - b->brought_floats;
    floats = (size_t)floats < *bytes / sizeof(float) ? floats : (int)(*bytes / sizeof(float));
    gpu_mesh_write_vertices(b->mesh, b->brought_floats, b->vertices + b->brought_floats, floats);
    b->brought_floats += floats;
    *bytes -= sizeof(float) * (size_t)floats;
    int corners = b->corner_count - b->brought_corners;
    corners = (size_t)corners < *bytes / sizeof(uint16_t) ? corners : (int)(*bytes / sizeof(uint16_t));
    gpu_mesh_write_indices(b->mesh, b->brought_corners, b->corners + b->brought_corners, corners);
    b->brought_corners += corners;
    *bytes -= sizeof(uint16_t) * (size_t)corners;
    if (b->brought_corners < b->corner_count)
        return false;
    free(b->vertices);
    free(b->corners);
    b->vertices = NULL;
    b->corners = NULL;
    return true;
}

bool likeness_painter_bring(struct likeness_painter *p, size_t bytes)
{
    return likeness_painter_given(p) && bring(&p->fine, &bytes) && bring(&p->coarse, &bytes);
}

void likeness_painter_set_lens(struct likeness_painter *p, const struct lens *view)
{
    float lens[12];
    lens_uniform(view, lens);
    gpu_program_set(p->program, VIEW_LENS, lens, 3);
}

static enum status open_program(struct likeness_painter *p, const struct lens *view)
{
    static const char *const samplers[] = {"now_picture", "now_depth", "shifts"};
    const struct gpu_program_text text = {
        "figure", shader_find("figure.vert"), shader_find("figure.frag"), uniform_names, UNIFORMS, samplers, 3};
    enum status status = gpu_program_open(&p->program, p->gpu, &text);
    if (status != OK)
        return status;
    const struct calibration *c = take_calibration(p->take);
    const float range[4] = {NEAREST_M, FARTHEST_M, 0, 0};
    float lens[12];
    likeness_painter_set_lens(p, view);
    lens_uniform(&c->color, lens);
    gpu_program_set(p->program, COLOR_LENS, lens, 3);
    lens_uniform(&c->depth, lens);
    gpu_program_set(p->program, DEPTH_LENS, lens, 3);
    gpu_program_set(p->program, VIEW_RANGE, range, 1);
    struct part_map map = part_map_of(c->registered ? POSE_IDENTITY : pose_inverse(c->color_from_depth));
    gpu_program_set(p->program, DEPTH_FROM_COLOR, map.row[0], 3);
    return OK;
}

enum status likeness_painter_open(struct likeness_painter **out, struct gpu *gpu, struct take *take,
                                  const struct source_rays *rays, const struct lens *view)
{
    *out = NULL;
    struct likeness_painter *p = calloc(1, sizeof *p);
    if (!p)
        return fail(ERR_MEMORY, "out of memory");
    p->gpu = gpu;
    p->take = take;
    p->frame = -1;
    const struct calibration *c = take_calibration(take);
    enum status status = sight_open(&p->sight, take, rays);
    p->color = malloc((size_t)c->color.width * (size_t)c->color.height * 3);
    p->depth = malloc((size_t)c->depth.width * (size_t)c->depth.height * 4);
    if (status == OK && (!p->color || !p->depth))
        status = fail(ERR_MEMORY, "out of memory");
    if (status == OK)
        status = gpu_texture_open(&p->now_picture, gpu, GPU_RGB8, c->color.width, c->color.height, GPU_LINEAR, NULL);
    if (status == OK)
        status = gpu_texture_open(&p->now_depth, gpu, GPU_RGBA8, c->depth.width, c->depth.height, GPU_NEAREST, NULL);
    if (status == OK)
        status = open_program(p, view);
    if (status != OK)
        likeness_painter_close(&p);
    *out = p;
    return status;
}

void likeness_painter_close(struct likeness_painter **out)
{
    struct likeness_painter *p = *out;
    if (!p)
        return;
    drop_likeness(p);
    sight_close(&p->sight);
    free(p->color);
    free(p->depth);
    gpu_texture_close(&p->now_picture);
    gpu_texture_close(&p->now_depth);
    gpu_program_close(&p->program);
    free(p);
    *out = NULL;
}

// ---------------------------------------------------------------- the shown frame

// Blue: how deep within one surface of the person each pixel lies, 255 at INNER_PX and more.
static void write_depth(struct likeness_painter *p)
{
    const struct sight *s = &p->sight;
    for (int i = 0; i < s->width * s->height; i++) {
        int inner = s->part[i] < PART_COUNT ? s->edge[i] : 0;
        inner = inner > INNER_PX ? INNER_PX : inner;
        p->depth[4 * i] = (uint8_t)(s->depth[i] >> 8);
        p->depth[4 * i + 1] = (uint8_t)(s->depth[i] & 255);
        p->depth[4 * i + 2] = (uint8_t)(255 * inner / INNER_PX);
        p->depth[4 * i + 3] = 255;
    }
    gpu_texture_write(p->now_depth, p->depth);
}

static enum status load_frame(struct likeness_painter *p, int64_t frame)
{
    if (p->frame == frame)
        return OK;
    const struct take_entry *e = take_entry(p->take, frame);
    struct posture joints;
    p->frame = -1;
    p->has_now = false;
    p->adjustment = likeness_adjustment(&p->likeness, frame);
    warp_clear(p->warp);
    enum status status = sight_read(&p->sight, p->take, frame);
    if (status == OK)
        status = posture_of(&p->likeness.rest, &e->skeleton, &joints);
    if (status < 0)
        return status;
    if (status == OK) {
        struct take_pictures seen;
        status = take_read(p->take, frame, TAKE_COLOR, &seen);
        p->has_now = status == OK && seen.color;
        if (p->has_now)
            status = sight_colors(&p->sight, take_calibration(p->take), seen.color, p->color);
        if (status < 0)
            return status;
        p->adjustment = align(p->likeness.volume, &p->likeness.rest, &p->sight, &joints, &p->adjustment);
        joints = posture_adjusted(&joints, &p->adjustment);
        const struct warp_model model = {p->likeness.volume, &p->likeness.surface, p->likeness.skins};
        warp_fit(p->warp, &model, &p->sight, &joints);
        write_depth(p);
        if (p->has_now)
            gpu_texture_write(p->now_picture, p->color);
    }
    gpu_texture_write(p->shifts, warp_picture(p->warp));
    p->frame = frame;
    return OK;
}

// ---------------------------------------------------------------- drawing

static void set_maps(struct likeness_painter *p, enum uniform uniform, struct pose to, const struct posture *posture)
{
    struct part_map maps[PART_COUNT];
    for (int part = 0; part < PART_COUNT; part++)
        maps[part] = part_map_of(pose_multiply(to, posture->part[part]));
    gpu_program_set(p->program, uniform, maps[0].row[0], 3 * PART_COUNT);
}

// How many parts there are to draw; the others are marked as absent.
static int set_absent(struct likeness_painter *p, const struct likeness_view *view)
{
    float absent[12] = {0};
    int present = 0;
    const struct skeleton *s = &view->skeleton;
    struct pose viewer_from_world = pose_inverse(view->world_from_viewer);
    for (int part = 0; part < PART_COUNT; part++) {
        const enum joint ends[] = {part_ends[part].from, part_ends[part].to};
        bool known = part_is_known(take_body(p->take), s, (enum part)part), before = false;
        for (int e = 0; e < 2 && known; e++)
            before |= pose_apply(viewer_from_world, s->joint[ends[e]]).z > (double)NEAREST_M;
        known = known && v3_distance(s->joint[ends[0]], s->joint[ends[1]]) > 1e-3;
        absent[part] = known ? 0 : 1;
        present += known && before;
    }
    gpu_program_set(p->program, ABSENT, absent, 3);
    return present;
}

enum status likeness_painter_draw(struct likeness_painter *p, const struct likeness_view *view, int *parts)
{
    *parts = set_absent(p, view);
    if (!*parts)
        return NOTHING;
    struct posture shown, recorded;
    enum status status = load_frame(p, view->frame);
    if (status == OK)
        status = posture_of(&p->likeness.rest, &view->skeleton, &shown); // world axes
    if (status == OK)
        status = posture_of(&p->likeness.rest, &take_entry(p->take, view->frame)->skeleton, &recorded);
    if (status != OK)
        return status;
    shown = posture_adjusted(&shown, &p->adjustment);
    recorded = posture_adjusted(&recorded, &p->adjustment);
    set_maps(p, VIEWER_FROM_PART, pose_inverse(view->world_from_viewer), &shown);
    set_maps(p, NOW_FROM_PART, POSE_IDENTITY, &recorded);
    struct part_map world = part_map_of(take_entry(p->take, view->frame)->world_from_camera);
    gpu_program_set(p->program, WORLD_FROM_NOW, world.row[0], 3);
    float time_s =
        (float)((double)(take_entry(p->take, view->frame)->time_ns - take_entry(p->take, 0)->time_ns) * 1e-9);
    for (int coded = 0; coded < (view->source ? 2 : 1); coded++) {
        const float kind[4] = {(float)coded, time_s, p->has_now ? 1 : 0, 0};
        gpu_program_set(p->program, KIND, kind, 1);
        gpu_draw(&(struct gpu_job){.target = coded ? view->source : view->actor,
                                   .program = p->program,
                                   .mesh = view->px_a_m > COARSE_PX_A_M ? p->fine.mesh : p->coarse.mesh,
                                   .textures = {p->now_picture, p->now_depth, p->shifts},
                                   .closed = true,
                                   .depth_test = true});
    }
    return gpu_check(p->gpu);
}
