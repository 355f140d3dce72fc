#include "reenact/painter.h"

#include "reenact/cylinders.h"
#include "reenact/motion.h"
#include "reenact/seen.h"
#include "reenact/select.h"
#include "reenact/shaders.h"
#include "reenact/shape.h"
#include "reenact/texture_cache.h"

#include <stdlib.h>
#include <string.h>

enum { SIDES = 4, ALONG = 24, SMOOTH_SAMPLES = 4, SHAPE_FRAMES = 60 };

static const double NEAREST_M = 0.05, FARTHEST_M = 60;
static const double AUTO_FULL_PX = 48;
static const double OUTLINE_ERROR_PX = 0.1;
static const float STANDS_BACK_M = 0.04F; // the model behind the seen surface, so that they do not mingle

enum actor_uniform {
    VIEWER_FROM_PART,
    SOURCE_FROM_PART,
    VIEW_LENS,
    VIEW_RANGE,
    SOURCE_LENS,
    SOURCE_WINDOW,
    ACTOR_UNIFORMS,
    NOW_FROM_PART = ACTOR_UNIFORMS, // from here on of the figure alone
    NOW_LENS,
    KIND,
    CODE,
    FIGURE_UNIFORMS
};
static const char *const uniform_names[] = {
    [VIEWER_FROM_PART] = "viewer_from_part",
    [SOURCE_FROM_PART] = "source_from_part",
    [VIEW_LENS] = "view_lens",
    [VIEW_RANGE] = "view_range",
    [SOURCE_LENS] = "source_lens",
    [SOURCE_WINDOW] = "source_window",
    [NOW_FROM_PART] = "now_from_part",
    [NOW_LENS] = "now_lens",
    [KIND] = "kind",
    [CODE] = "code",
};
enum figure_kind { WHOLE_MODEL, CARVED_MODEL, SEEN_SURFACE }; // as figure.frag has them

// What the shown frame itself saw, on the GPU.
struct now {
    struct seen seen;
    struct gpu_mesh *surface[PART_COUNT]; // NULL: nothing of that part
    struct vec3 shift[PART_COUNT];        // of the parts' shapes, in bodily axes
    struct gpu_texture *color, *depth;
    float color_lens[12], depth_lens[12];
};

struct painter {
    struct gpu *gpu;
    struct take *take;
    struct lens lens;
    enum detail detail;
    struct motion *motion;
    struct selector *selector;
    struct texture_cache *textures;
    struct shape *shape;                 // NULL: the take has no depth
    struct gpu_mesh *shaped[PART_COUNT]; // NULL: the part's shape was not seen, draw it rounded
    struct source_rays *rays;            // NULL: the take has no depth
    struct now now;
    struct gpu_program *actor_program, *figure_program, *compose_program;
    struct gpu_mesh *whole;                      // one triangle over everything
    struct gpu_mesh *open[SIDES];                // the paper's cylinder
    struct gpu_mesh *rounded[PART_COUNT][SIDES]; // made when first wanted
    struct gpu_texture *camera;
    struct gpu_target *plain, *smooth, *composed; // actor at paper, actor at full, result
    struct gpu_target *actor;                     // the one of the two last drawn into
    struct gpu_target *source;                    // where each pixel is from; NULL: not asked for
    bool coding;                                  // it is asked for now
};

struct painter_options painter_default_options(void)
{
    return (struct painter_options){.detail = DETAIL_FULL, .texture_bytes = (size_t)64 << 20};
}

enum detail painter_level(double height_px) { return height_px < AUTO_FULL_PX ? DETAIL_PAPER : DETAIL_FULL; }

// ---------------------------------------------------------------- opening

// The lens as the shaders take it.
static void lens_uniform(const struct lens *l, float out[12])
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

static void set_view_lens(struct painter *p)
{
    float lens[12];
    lens_uniform(&p->lens, lens);
    gpu_program_set(p->actor_program, VIEW_LENS, lens, 3);
    gpu_program_set(p->figure_program, VIEW_LENS, lens, 3);
}

static enum status open_programs(struct painter *p)
{
    static const float corners[] = {-1, -1, 3, -1, -1, 3};
    static const uint16_t order[] = {0, 1, 2};
    static const char *const actor_samplers[] = {"source_picture"};
    static const char *const figure_samplers[] = {"source_picture", "now_picture", "now_depth"};
    static const char *const compose_samplers[] = {"camera_picture", "actor_picture"};
    const struct gpu_program_text actor = {
        "actor", shader_find("actor.vert"), shader_find("actor.frag"), uniform_names, ACTOR_UNIFORMS, actor_samplers,
        1};
    const struct gpu_program_text figure = {"figure",
                                            shader_find("figure.vert"),
                                            shader_find("figure.frag"),
                                            uniform_names,
                                            FIGURE_UNIFORMS,
                                            figure_samplers,
                                            3};
    const struct gpu_program_text compose = {
        "compose", shader_find("whole.vert"), shader_find("compose.frag"), NULL, 0, compose_samplers, 2};
    enum status status = gpu_mesh_open(&p->whole, p->gpu, corners, 2, 3, order, 3);
    if (status == OK)
        status = gpu_program_open(&p->actor_program, p->gpu, &actor);
    if (status == OK)
        status = gpu_program_open(&p->figure_program, p->gpu, &figure);
    if (status == OK)
        status = gpu_program_open(&p->compose_program, p->gpu, &compose);
    if (status != OK)
        return status;
    const float range[4] = {(float)NEAREST_M, (float)FARTHEST_M, 0, 0};
    lens_uniform(&take_calibration(p->take)->color, p->now.color_lens);
    lens_uniform(&take_calibration(p->take)->depth, p->now.depth_lens);
    struct gpu_program *both[] = {p->actor_program, p->figure_program};
    for (int i = 0; i < 2; i++) {
        gpu_program_set(both[i], SOURCE_LENS, p->now.color_lens, 3);
        gpu_program_set(both[i], VIEW_RANGE, range, 1);
    }
    set_view_lens(p);
    return OK;
}

static enum status open_targets(struct painter *p, bool sources)
{
    int w = p->lens.width, h = p->lens.height;
    enum status status = gpu_texture_open(&p->camera, p->gpu, GPU_RGB8, w, h, GPU_NEAREST, NULL);
    if (status == OK && p->detail != DETAIL_FULL)
        status = gpu_target_open(&p->plain, p->gpu, w, h, 1);
    if (status == OK && p->detail != DETAIL_PAPER)
        status = gpu_target_open(&p->smooth, p->gpu, w, h, SMOOTH_SAMPLES);
    if (status == OK)
        status = gpu_target_open(&p->composed, p->gpu, w, h, 1);
    if (status == OK && sources)
        status = gpu_target_open(&p->source, p->gpu, w, h, 1);
    p->actor = p->plain ? p->plain : p->smooth;
    p->coding = sources;
    return status;
}

static void close_targets(struct painter *p)
{
    gpu_target_close(&p->plain);
    gpu_target_close(&p->smooth);
    gpu_target_close(&p->composed);
    gpu_target_close(&p->source);
    gpu_texture_close(&p->camera);
}

enum status painter_set_lens(struct painter *p, const struct lens *lens)
{
    enum status status = lens_check(lens, "tablet's");
    if (status != OK)
        return status;
    bool resized = lens->width != p->lens.width || lens->height != p->lens.height, sources = p->source,
         coding = p->coding;
    p->lens = *lens;
    set_view_lens(p);
    if (!resized)
        return OK;
    close_targets(p);
    enum status opened = open_targets(p, sources);
    p->coding = coding;
    return opened;
}

static enum status open_now(struct painter *p)
{
    const struct calibration *c = take_calibration(p->take);
    const struct lens *color = &c->color, *depth = &c->depth;
    p->now.seen.frame = -1;
    // Bound also where the take has no depth: a program's textures are all there.
    bool has = depth->width > 0;
    enum status status =
        gpu_texture_open(&p->now.color, p->gpu, GPU_RGB8, color->width, color->height, GPU_LINEAR, NULL);
    if (status == OK)
        status = gpu_texture_open(&p->now.depth, p->gpu, GPU_RGBA8, has ? depth->width : 1, has ? depth->height : 1,
                                  GPU_NEAREST, NULL);
    if (status == OK && has && p->detail != DETAIL_PAPER)
        status = source_rays_open(&p->rays, c);
    return status;
}

static enum status open_selector(struct painter *p)
{
    int64_t frames = take_frame_count(p->take);
    enum status status = selector_open(&p->selector, frames);
    for (int64_t i = 0; i < frames && status == OK; i++) {
        const struct take_entry *e = take_entry(p->take, i);
        if (e->has_color && e->has_skeleton)
            status = selector_add(p->selector, i, &e->skeleton, take_body(p->take));
    }
    return status;
}

static enum status open_shapes(struct painter *p)
{
    if (!p->rays)
        return OK;
    enum status status = OK;
    struct shape *shape = p->shape = malloc(sizeof *shape);
    if (!shape)
        status = fail(ERR_MEMORY, "out of memory");
    if (status == OK)
        status = shape_measure(shape, p->take, p->rays, SHAPE_FRAMES);
    for (int part = 0; part < PART_COUNT && status == OK; part++) {
        struct cylinder_mesh mesh;
        if (!shape->parts[part].known)
            continue;
        status = shape_mesh(&shape->parts[part], &mesh);
        if (status != OK)
            break;
        status = gpu_mesh_open(&p->shaped[part], p->gpu, mesh.vertices, 3, mesh.vertex_count, mesh.indices,
                               mesh.index_count);
        cylinder_mesh_free(&mesh);
    }
    return status;
}

enum status painter_open(struct painter **out, struct gpu *gpu, struct take *take, const struct lens *lens,
                         const struct painter_options *options)
{
    *out = NULL;
    enum status status = lens_check(lens, "tablet's");
    if (status == OK)
        status = lens_check(&take_calibration(take)->color, "take's colour");
    if (status != OK)
        return status;
    if (take_body(take)->representative_frame < 0)
        return fail(ERR_INPUT, "the take has no measured body, so nobody can be drawn; "
                               "record again with the arms once held away from the body");
    struct painter *p = calloc(1, sizeof *p);
    if (!p)
        return fail(ERR_MEMORY, "out of memory");
    p->gpu = gpu;
    p->take = take;
    p->lens = *lens;
    p->detail = options->detail;
    status = motion_open(&p->motion, take);
    if (status == OK)
        status = open_selector(p);
    if (status == OK)
        status = texture_cache_open(&p->textures, gpu, take, options->texture_bytes);
    if (status == OK)
        status = open_now(p);
    if (status == OK)
        status = open_shapes(p);
    if (status == OK)
        status = open_programs(p);
    if (status == OK)
        status = open_targets(p, options->sources);
    if (status != OK) {
        painter_close(&p);
        return status;
    }
    *out = p;
    return OK;
}

void painter_close(struct painter **out)
{
    struct painter *p = *out;
    if (!p)
        return;
    for (int i = 0; i < SIDES; i++) {
        gpu_mesh_close(&p->open[i]);
        for (int part = 0; part < PART_COUNT; part++)
            gpu_mesh_close(&p->rounded[part][i]);
    }
    for (int part = 0; part < PART_COUNT; part++) {
        gpu_mesh_close(&p->shaped[part]);
        gpu_mesh_close(&p->now.surface[part]);
    }
    gpu_texture_close(&p->now.color);
    gpu_texture_close(&p->now.depth);
    seen_free(&p->now.seen);
    free(p->shape);
    source_rays_close(&p->rays);
    gpu_mesh_close(&p->whole);
    close_targets(p);
    gpu_program_close(&p->actor_program);
    gpu_program_close(&p->figure_program);
    gpu_program_close(&p->compose_program);
    texture_cache_close(&p->textures);
    selector_close(&p->selector);
    motion_close(&p->motion);
    free(p);
    *out = NULL;
}

// ---------------------------------------------------------------- parts

static enum status mesh_for(struct painter *p, enum detail level, enum part part, double radius_px,
                            struct gpu_mesh **out)
{
    int sides = cylinder_sides(radius_px, OUTLINE_ERROR_PX), which = 0;
    while (8 << which < sides)
        which++;
    struct gpu_mesh **kept = level == DETAIL_PAPER ? &p->open[which] : &p->rounded[part][which];
    *out = *kept;
    if (*out)
        return OK;
    struct cylinder_mesh mesh;
    enum cylinder_shape shape = level == DETAIL_PAPER ? CYLINDER_OPEN : CYLINDER_ROUNDED;
    enum status status = cylinder_mesh_make(shape, take_body(p->take)->radius_rate[part], sides, ALONG, &mesh);
    if (status != OK)
        return status;
    status = gpu_mesh_open(kept, p->gpu, mesh.vertices, 3, mesh.vertex_count, mesh.indices, mesh.index_count);
    cylinder_mesh_free(&mesh);
    *out = *kept;
    return status;
}

// The frame a part takes its colours from, and its texture. NOTHING: there is none.
static enum status texture_for(struct painter *p, enum detail level, const struct skeleton *in_viewer, enum part part,
                               const struct selection *whole, int64_t *frame, struct source_texture *texture)
{
    if (level == DETAIL_PAPER) {
        *frame = whole->frame;
        return texture_cache_whole(p->textures, whole->frame, texture);
    }
    for (;;) {
        struct selection chosen;
        enum status status = select_part(p->selector, in_viewer, part, &chosen);
        if (status != OK)
            return status;
        *frame = chosen.frame;
        status = texture_cache_part(p->textures, chosen.frame, part, texture);
        if (status != NOTHING)
            return status;
        selector_exclude(p->selector, chosen.frame, part); // its pictures do not bear out what the joints promise
    }
}

// What is being drawn.
struct scene {
    enum detail level;
    int64_t shown;
    struct skeleton in_viewer;
    struct selection whole;                               // at paper
    struct part_map viewer_from_color, depth_from_viewer; // of the shown frame; valid if has_now
    bool has_now;
};

// A part's model, ready to be drawn.
struct model {
    const struct gpu_mesh *mesh;
    struct source_texture texture;
    struct part_map viewer_from_part, source_from_part, source_from_color;
    int64_t frame; // of the colours
};

// NOTHING: there is none.
static enum status make_model(struct painter *p, const struct scene *scene, enum part part, struct model *out)
{
    const struct body *body = take_body(p->take);
    const struct vec3 eye = v3(0, 0, 0);
    struct part_frame here, there, now;
    struct gpu_mesh *mesh = NULL;
    if (!part_is_known(body, &scene->in_viewer, part) || !part_frame_facing(&scene->in_viewer, part, eye, &here))
        return NOTHING;
    double radius = body->radius_rate[part] * here.length;
    double near = fmin(here.origin.z, here.origin.z + here.z.z * here.length) - radius;
    if (fmax(here.origin.z, here.origin.z + here.z.z * here.length) + radius < NEAREST_M)
        return NOTHING; // behind the camera
    enum status status =
        texture_for(p, scene->level, &scene->in_viewer, part, &scene->whole, &out->frame, &out->texture);
    if (status != OK)
        return status;
    const struct skeleton *source = &take_entry(p->take, out->frame)->skeleton;
    const struct skeleton *shown = &take_entry(p->take, scene->shown)->skeleton;
    if (!part_frame_facing(source, part, eye, &there))
        return NOTHING;
    struct part_frame here_bodily, there_bodily;
    if (scene->level != DETAIL_PAPER && p->shaped[part] && part_frame_bodily(&scene->in_viewer, part, &here_bodily) &&
        part_frame_bodily(source, part, &there_bodily)) { // flesh meets flesh
        mesh = p->shaped[part];
        here = here_bodily;
        if (scene->has_now) {
            struct vec3 shift = p->now.shift[part];
            here.origin = v3_add(here.origin, v3_add(v3_scale(here.x, shift.x),
                                                     v3_add(v3_scale(here.y, shift.y), v3_scale(here.z, shift.z))));
        }
        there = there_bodily;
    }
    if (!mesh)
        status = mesh_for(p, scene->level, part, p->lens.fx * radius / fmax(near, NEAREST_M), &mesh);
    if (status != OK)
        return status;
    out->mesh = mesh;
    out->viewer_from_part = cylinder_map(&here, radius);
    out->source_from_part = cylinder_map(&there, body->radius_rate[part] * there.length);
    if (part_frame_bodily(shown, part, &now) && part_frame_bodily(source, part, &there_bodily))
        out->source_from_color = part_map_between(&now, &there_bodily);
    else if (part_frame_facing(shown, part, eye, &now) && part_frame_facing(source, part, eye, &there))
        out->source_from_color = part_map_between(&now, &there);
    return OK;
}

// A job for the figure's program, and the same again for the picture of sources.
static void draw_figure(struct painter *p, const struct scene *scene, const struct model *model, enum figure_kind kind,
                        const struct gpu_mesh *mesh)
{
    static const struct part_map same = {{{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}}};
    bool surface = kind == SEEN_SURFACE;
    struct part_map now = same;
    if (kind == CARVED_MODEL)
        now = part_map_multiply(&scene->depth_from_viewer, &model->viewer_from_part);
    const float *viewer = surface ? scene->viewer_from_color.row[0] : model->viewer_from_part.row[0];
    gpu_program_set(p->figure_program, VIEWER_FROM_PART, viewer, 3);
    gpu_program_set(p->figure_program, NOW_FROM_PART, now.row[0], 3);
    gpu_program_set(p->figure_program, NOW_LENS, surface ? p->now.color_lens : p->now.depth_lens, 3);
    const struct gpu_texture *texture = p->now.color;
    int64_t age = 0;
    if (model) {
        const struct part_map *source = surface ? &model->source_from_color : &model->source_from_part;
        gpu_program_set(p->figure_program, SOURCE_FROM_PART, source->row[0], 3);
        gpu_program_set(p->figure_program, SOURCE_WINDOW, model->texture.window, 1);
        texture = model->texture.texture;
        age = llabs(take_entry(p->take, model->frame)->time_ns - take_entry(p->take, scene->shown)->time_ns) / 10000000;
        age = age < 65535 ? age : 65535;
    }
    const float code[4] = {(float)(age / 256) / 255, (float)(age % 256) / 255, 0, 0};
    gpu_program_set(p->figure_program, CODE, code, 1);
    for (int coded = scene->level == DETAIL_PAPER; coded < (p->coding ? 2 : 1); coded++) {
        const float how[4] = {(float)kind, (float)coded, model ? 1 : 0, kind == CARVED_MODEL ? STANDS_BACK_M : 0};
        gpu_program_set(p->figure_program, KIND, how, 1);
        gpu_draw(&(struct gpu_job){.target = coded ? p->source : p->actor,
                                   .program = p->figure_program,
                                   .mesh = mesh,
                                   .textures = {texture, p->now.color, p->now.depth},
                                   .depth_test = true});
    }
}

// NOTHING: not drawn.
static enum status draw_part(struct painter *p, const struct scene *scene, enum part part)
{
    struct model model = {0};
    enum status status = make_model(p, scene, part, &model);
    if (status < 0)
        return status;
    if (scene->level == DETAIL_PAPER && status == OK) {
        gpu_program_set(p->actor_program, VIEWER_FROM_PART, model.viewer_from_part.row[0], 3);
        gpu_program_set(p->actor_program, SOURCE_FROM_PART, model.source_from_part.row[0], 3);
        gpu_program_set(p->actor_program, SOURCE_WINDOW, model.texture.window, 1);
        gpu_draw(&(struct gpu_job){.target = p->actor,
                                   .program = p->actor_program,
                                   .mesh = model.mesh,
                                   .textures = {model.texture.texture},
                                   .depth_test = true});
    }
    if (status == OK)
        draw_figure(p, scene, &model, scene->has_now ? CARVED_MODEL : WHOLE_MODEL, model.mesh);
    if (!scene->has_now || !p->now.surface[part])
        return status;
    draw_figure(p, scene, status == OK ? &model : NULL, SEEN_SURFACE, p->now.surface[part]);
    return status;
}

// Has what the shown frame saw at hand, unless it is already.
static enum status load_now(struct painter *p, const struct painter_view *view, const struct moment *moment,
                            struct scene *scene)
{
    struct now *now = &p->now;
    if (!p->rays)
        return NOTHING;
    if (now->seen.frame != moment->frame) {
        for (int part = 0; part < PART_COUNT; part++)
            gpu_mesh_close(&now->surface[part]);
        enum status status = seen_load(&now->seen, p->take, moment->frame, p->rays);
        for (int part = 0; part < PART_COUNT && status == OK; part++) {
            const struct cylinder_mesh *m = &now->seen.surface[part];
            struct part_frame f;
            now->shift[part] = v3(0, 0, 0);
            if (m->index_count && p->shape && p->shape->parts[part].known &&
                part_frame_bodily(&take_entry(p->take, moment->frame)->skeleton, (enum part)part, &f))
                now->shift[part] =
                    shape_shift(&p->shape->parts[part], &f, take_body(p->take)->radius_rate[part] * f.length,
                                part == PART_HEAD, m->vertices, m->vertex_count);
            if (m->index_count)
                status = gpu_mesh_open(&now->surface[part], p->gpu, m->vertices, 3, m->vertex_count, m->indices,
                                       m->index_count);
        }
        if (status != OK) {
            seen_free(&now->seen);
            return status;
        }
        gpu_texture_write(now->color, now->seen.picture.rgb);
        gpu_texture_write(now->depth, now->seen.depth);
    }
    // Between two recorded instants it goes along with the skeleton's middle.
    struct skeleton then = skeleton_transform(moment->world_from_camera, &take_entry(p->take, moment->frame)->skeleton);
    struct vec3 sum = v3(0, 0, 0);
    int count = 0;
    for (int j = 0; j < JOINT_COUNT; j++)
        if (then.confidence[j] > 0 && moment->skeleton.confidence[j] > 0) {
            sum = v3_add(sum, v3_sub(moment->skeleton.joint[j], then.joint[j]));
            count++;
        }
    struct pose world_from_color = moment->world_from_camera;
    if (count)
        world_from_color.translation = v3_add(world_from_color.translation, v3_scale(sum, 1.0 / count));
    struct pose viewer_from_color = pose_multiply(pose_inverse(view->world_from_camera), world_from_color);
    const struct calibration *c = take_calibration(p->take);
    struct pose depth_from_color = c->registered ? POSE_IDENTITY : pose_inverse(c->color_from_depth);
    scene->viewer_from_color = part_map_of(viewer_from_color);
    scene->depth_from_viewer = part_map_of(pose_multiply(depth_from_color, pose_inverse(viewer_from_color)));
    scene->has_now = true;
    return OK;
}

// How high the bones stand in the picture; 0 when the camera stands among them or they are behind it.
static double height_px(const struct painter *p, const struct skeleton *in_viewer)
{
    double top = INFINITY, bottom = -INFINITY;
    for (int j = 0; j < JOINT_COUNT; j++) {
        if (!(in_viewer->confidence[j] > 0) || !(in_viewer->joint[j].z > NEAREST_M))
            continue;
        double y = p->lens.fy * in_viewer->joint[j].y / in_viewer->joint[j].z;
        top = fmin(top, y);
        bottom = fmax(bottom, y);
    }
    return bottom > top ? bottom - top : 0;
}

static void clear(struct painter *p)
{
    gpu_target_clear(p->actor);
    if (p->coding)
        gpu_target_clear(p->source);
}

static enum status draw_actor(struct painter *p, const struct painter_view *view, struct painter_result *result)
{
    struct moment moment;
    enum status status = motion_at(p->motion, view->time_ns, p->detail != DETAIL_PAPER, &moment);
    if (status != OK)
        return status;
    struct skeleton in_viewer = skeleton_transform(pose_inverse(view->world_from_camera), &moment.skeleton);
    result->shown = moment.frame;
    result->height_px = height_px(p, &in_viewer);
    result->level = p->detail == DETAIL_AUTO ? painter_level(result->height_px) : p->detail;
    p->actor = result->level == DETAIL_PAPER ? p->plain : p->smooth;
    clear(p);
    struct selection whole = {0};
    if (result->level == DETAIL_PAPER) {
        status = select_whole(p->selector, &in_viewer, &whole);
        if (status != OK)
            return status;
        result->source = whole.frame;
    }
    struct scene scene = {result->level, moment.frame, in_viewer, whole, {{{0}}}, {{{0}}}, false};
    if (result->level != DETAIL_PAPER)
        status = load_now(p, view, &moment, &scene);
    if (status < 0)
        return status;
    for (int part = 0; part < PART_COUNT; part++) {
        status = draw_part(p, &scene, (enum part)part);
        if (status < 0)
            return status;
        result->parts += status == OK;
    }
    return OK;
}

// ---------------------------------------------------------------- pictures

static enum status compose(struct painter *p, const uint8_t *color)
{
    gpu_texture_write(p->camera, color);
    gpu_draw(&(struct gpu_job){.target = p->composed,
                               .program = p->compose_program,
                               .mesh = p->whole,
                               .textures = {p->camera, gpu_target_texture(p->actor)}});
    return gpu_check(p->gpu);
}

enum status painter_draw_nobody(struct painter *p, const uint8_t *color)
{
    clear(p);
    return compose(p, color);
}

enum status painter_draw(struct painter *p, const struct painter_view *view, struct painter_result *result)
{
    *result = (struct painter_result){.level = p->detail, .shown = -1, .source = -1};
    if (!pose_finite(view->world_from_camera))
        return fail(ERR_INPUT, "the camera's pose is not finite");
    clear(p);
    enum status status = draw_actor(p, view, result);
    if (status < 0)
        return status;
    return view->color ? compose(p, view->color) : gpu_check(p->gpu);
}

static enum status read_rgb(const struct painter *p, struct gpu_target *from, uint8_t *rgb)
{
    size_t pixels = (size_t)p->lens.width * (size_t)p->lens.height;
    uint8_t *rgba = malloc(pixels * 4);
    if (!rgba)
        return fail(ERR_MEMORY, "out of memory");
    enum status status = gpu_target_read(from, rgba);
    for (size_t i = 0; i < pixels && status == OK; i++)
        memcpy(rgb + 3 * i, rgba + 4 * i, 3);
    free(rgba);
    return status;
}

enum status painter_read(struct painter *p, uint8_t *rgb) { return read_rgb(p, p->composed, rgb); }

enum status painter_read_actor(struct painter *p, uint8_t *rgba)
{
    enum status status = gpu_target_read(p->actor, rgba);
    if (status != OK)
        return status;
    size_t pixels = (size_t)p->lens.width * (size_t)p->lens.height;
    for (size_t i = 0; i < pixels; i++) { // premultiplied to straight
        uint8_t *at = rgba + 4 * i;
        for (int c = 0; c < 3 && at[3] && at[3] < 255; c++) {
            int straight = (at[c] * 255 + at[3] / 2) / at[3];
            at[c] = (uint8_t)(straight < 255 ? straight : 255);
        }
    }
    return OK;
}

enum status painter_read_source(struct painter *p, uint8_t *rgb)
{
    assert(p->source);
    return read_rgb(p, p->source, rgb);
}

void painter_set_sources(struct painter *p, bool wanted) { p->coding = wanted && p->source; }

const struct gpu_texture *painter_actor_texture(struct painter *p) { return gpu_target_texture(p->actor); }

const struct gpu_texture *painter_texture(struct painter *p) { return gpu_target_texture(p->composed); }
