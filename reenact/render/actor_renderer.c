#include "reenact/render/actor_renderer.h"

#include "reenact/render/occlusion_shadow.h"
#include "reenact/render/cylinder_renderer.h"
#include "reenact/render/lod_error.h"
#include "reenact/render/avatar_renderer.h"
#include "reenact/skeleton/skeleton_track.h"
#include "reenact/render/shaders.h"

#include <stdlib.h>
#include <string.h>

enum { BROUGHT_BYTES = 512 << 10 };
enum { ROOM_FINER = 2 }; // texels of the room's depth along a pixel's side
enum { SHADOW_PX = 2 }; // pixels of the picture along one of the shadow's: it is soft, and each looks at the whole body

static const double CYLINDERS_OFF_M = 0.03; // of a person who is not known yet

struct painter {
    struct gpu *gpu;
    struct take *take;
    struct lens lens, drawn; // the tablet's; the one that is drawn for, with `fineness` of its pixels along a side
    double fineness;
    enum detail detail;
    struct motion *motion;
    struct cylinder_painter *cylinders;
    struct source_rays *rays; // NULL: the take has no depth
    struct around_painter *around;
    struct likeness_painter *likeness; // NULL: too little of the person was seen; rounded cylinders then
    struct gpu_program *compose_program;
    struct gpu_mesh *whole; // one triangle over everything
    struct gpu_texture *camera;
    struct gpu_target *plain, *smooth, *composed; // actor at paper, actor at full, result
    struct gpu_target *actor;                     // the one of the two last drawn into
    struct gpu_target *hidden;                    // the room's depth where it may hide him at full; NULL: no room
    bool hides;                                   // there is something in it
    struct gpu_target *shadow;                    // NULL: none is wanted
    struct gpu_texture *no_shadow;                // a transparent pixel
    bool shaded;                                  // the picture last drawn has a shadow
    struct gpu_target *source;                    // where each pixel is from; NULL: not asked for
    bool coding;                                  // it is asked for now
    bool waiting;                                 // for a likeness, or for it to be on the GPU
    bool later;                                   // it comes from somebody else
    double error_px;                              // that DETAIL_AUTO may be wrong by
    double cylinders_off_m;                       // from the person's surface
};

struct painter_options painter_default_options(void)
{
    return (struct painter_options){.detail = DETAIL_FULL, .texture_bytes = (size_t)64 << 20, .error_px = 1};
}

// ---------------------------------------------------------------- opening

static void set_view_lens(struct painter *p)
{
    cylinder_painter_set_lens(p->cylinders, &p->drawn);
    if (p->likeness)
        likeness_painter_set_lens(p->likeness, &p->drawn);
    around_painter_set_lens(p->around, &p->drawn);
}

static enum status open_programs(struct painter *p)
{
    static const float corners[] = {-1, -1, 3, -1, -1, 3};
    static const uint16_t order[] = {0, 1, 2};
    static const char *const compose_samplers[] = {"camera_picture", "actor_picture", "shadow_picture"};
    const struct gpu_program_text compose = {.name = "compose",
                                             .vertex = shader_find("fullscreen.vert"),
                                             .fragment = shader_find("compose.frag"),
                                             .samplers = compose_samplers,
                                             .sampler_count = 3};
    enum status status = gpu_mesh_open(&p->whole, p->gpu, corners, 2, 3, order, 3);
    if (status == OK)
        status = gpu_texture_open(&p->no_shadow, p->gpu, GPU_RGBA8, 1, 1, GPU_NEAREST, (const uint8_t[4]){0});
    if (status == OK)
        status = around_painter_open(&p->around, p->gpu, &p->lens);
    if (status == OK)
        status = gpu_program_open(&p->compose_program, p->gpu, &compose);
    if (status == OK)
        set_view_lens(p);
    return status;
}

static enum status open_targets(struct painter *p, bool sources, bool shadow)
{
    int w = p->lens.width, h = p->lens.height;
    enum status status = gpu_texture_open(&p->camera, p->gpu, GPU_RGB8, w, h, GPU_NEAREST, NULL);
    if (status == OK && (p->detail != DETAIL_FULL || p->later))
        status = gpu_target_open(&p->plain, p->gpu, w, h);
    if (status == OK && p->detail != DETAIL_PAPER)
        status = gpu_target_open(&p->smooth, p->gpu, w, h);
    if (status == OK)
        status = gpu_target_open_flat(&p->composed, p->gpu, w, h);
    if (status == OK && sources)
        status = gpu_target_open(&p->source, p->gpu, w, h);
    if (status == OK && shadow)
        status = gpu_target_open(&p->shadow, p->gpu, (w + 1) / SHADOW_PX, (h + 1) / SHADOW_PX);
    p->actor = p->plain ? p->plain : p->smooth;
    p->coding = sources;
    return status;
}

// What the room hides of him.
static enum status open_hidden(struct painter *p)
{
    return gpu_target_open_depth(&p->hidden, p->gpu, ROOM_FINER * p->lens.width, ROOM_FINER * p->lens.height);
}

static void close_targets(struct painter *p)
{
    gpu_target_close(&p->hidden);
    gpu_target_close(&p->plain);
    gpu_target_close(&p->smooth);
    gpu_target_close(&p->composed);
    gpu_target_close(&p->source);
    gpu_target_close(&p->shadow);
    gpu_texture_close(&p->camera);
}

static void use(struct gpu_target *t, int width, int height)
{
    if (t)
        gpu_target_use(t, width, height);
}

// As finely as is wanted, in the top left of targets of the lens's size: so nothing has to be made when that changes.
static void use_targets(struct painter *p)
{
    p->drawn = lens_coarser(&p->lens, p->fineness);
    const int w = p->drawn.width, h = p->drawn.height;
    set_view_lens(p);
    use(p->plain, w, h);
    use(p->smooth, w, h);
    use(p->source, w, h);
    use(p->hidden, ROOM_FINER * w, ROOM_FINER * h);
    use(p->shadow, (w + 1) / SHADOW_PX, (h + 1) / SHADOW_PX);
}

void painter_set_fineness(struct painter *p, double fineness)
{
    if (fineness == p->fineness)
        return;
    p->fineness = fineness;
    use_targets(p);
}

enum status painter_set_lens(struct painter *p, const struct lens *lens)
{
    enum status status = lens_check(lens, "tablet's");
    if (status != OK)
        return status;
    bool resized = lens->width != p->lens.width || lens->height != p->lens.height, sources = p->source,
         shadow = p->shadow, hidden = p->hidden, coding = p->coding;
    p->lens = *lens;
    if (resized) {
        close_targets(p);
        status = open_targets(p, sources, shadow);
        p->coding = coding;
    }
    if (resized && status == OK && hidden)
        status = open_hidden(p);
    use_targets(p);
    return status;
}

enum status painter_give_likeness(struct painter *p, struct likeness *likeness)
{
    p->waiting = false;
    if (!likeness || !p->likeness) {
        if (likeness)
            likeness_free(likeness);
        likeness_painter_close(&p->likeness);
        return OK;
    }
    p->cylinders_off_m = level_cylinders_off_m(likeness);
    enum status status = likeness_painter_give(p->likeness, likeness);
    if (status != OK)
        likeness_painter_close(&p->likeness);
    p->waiting = status == OK;
    return status;
}

const struct likeness *painter_likeness(const struct painter *p)
{
    return p->likeness && !p->waiting ? likeness_painter_likeness(p->likeness) : NULL;
}

enum status painter_give_frame(struct painter *p, struct loaded_frame *loaded)
{
    if (p->likeness)
        return likeness_painter_give_frame(p->likeness, loaded);
    loaded_frame_free(loaded);
    return OK;
}

int64_t painter_near(const struct painter *p, int64_t frame, int64_t within_ns)
{
    return p->likeness ? likeness_painter_near(p->likeness, frame, within_ns) : -1;
}

enum status painter_give_room(struct painter *p, struct room *room)
{
    const bool any = room->corner_count > 0;
    enum status status = around_painter_give(p->around, room);
    if (status == OK && any && p->smooth && !p->hidden)
        status = open_hidden(p);
    use_targets(p);
    return status;
}

bool painter_settled(const struct painter *p) { return !p->waiting || !likeness_painter_given(p->likeness); }

static enum status open_likeness(struct painter *p, const struct painter_options *options)
{
    const struct calibration *c = take_calibration(p->take);
    if (p->detail == DETAIL_PAPER || !(c->depth.width > 0))
        return OK;
    enum status status = source_rays_open(&p->rays, c);
    if (status == OK)
        status = likeness_painter_open(&p->likeness, p->gpu, p->take, p->rays, &p->lens, options->texture_bytes / 2);
    p->waiting = status == OK;
    if (status != OK || p->later)
        return status;
    struct likeness likeness;
    status = likeness_make(&likeness, p->take, p->rays, LIKENESS_FRAMES, options->watch);
    if (status < 0)
        return status;
    status = painter_give_likeness(p, status == OK ? &likeness : NULL);
    p->waiting = status == OK && p->likeness && !likeness_painter_bring(p->likeness, SIZE_MAX);
    return status;
}

static bool has_floor(const struct take *take)
{
    bool located = false;
    for (int64_t i = 0; i < take_frame_count(take) && !located; i++)
        located = take_entry(take, i)->located;
    return located;
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
    p->lens = p->drawn = *lens;
    p->fineness = 1;
    p->detail = options->detail;
    p->error_px = options->error_px;
    p->cylinders_off_m = CYLINDERS_OFF_M;
    p->later = options->likeness_later && options->detail != DETAIL_PAPER;
    status = motion_open(&p->motion, take);
    const size_t bytes = options->texture_bytes / (p->detail == DETAIL_PAPER ? 1 : 2);
    if (status == OK)
        status = cylinder_painter_open(&p->cylinders, gpu, take, bytes);
    if (status == OK)
        status = open_likeness(p, options);
    if (status == OK)
        status = open_programs(p);
    if (status == OK)
        status = open_targets(p, options->sources, options->shadow && has_floor(take));
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
    likeness_painter_close(&p->likeness);
    source_rays_close(&p->rays);
    around_painter_close(&p->around);
    gpu_texture_close(&p->no_shadow);
    gpu_mesh_close(&p->whole);
    close_targets(p);
    gpu_program_close(&p->compose_program);
    cylinder_painter_close(&p->cylinders);
    motion_close(&p->motion);
    free(p);
    *out = NULL;
}

// ---------------------------------------------------------------- the actor

// What is being drawn.
struct scene {
    int64_t shown;
    struct skeleton in_viewer;
    struct selection whole; // at paper
};

static void clear(struct painter *p)
{
    gpu_target_clear(p->actor);
    if (p->coding)
        gpu_target_clear(p->source);
}

// An empty picture, but for the room that may hide the actor.
static void begin(struct painter *p, const struct painter_view *view, const struct scene *scene)
{
    const struct room_hidden body = room_hidden_body(&scene->in_viewer);
    const bool smoothly = p->actor == p->smooth && p->likeness && p->hidden;
    clear(p);
    if (smoothly)
        gpu_target_clear(p->hidden);
    p->hides = false;
    if (view->viewer_from_room)
        p->hides = around_painter_room(p->around, smoothly ? p->hidden : p->actor, view->viewer_from_room, &body);
    if (view->viewer_from_room && p->coding)
        around_painter_room(p->around, p->source, view->viewer_from_room, &body);
}

static void draw_shadow(struct painter *p, const struct painter_view *view, const struct skeleton *skeleton)
{
    if (!p->shadow)
        return;
    const struct around_view about = {view->world_from_camera, view->viewer_from_room, skeleton, take_body(p->take)};
    gpu_target_clear(p->shadow);
    around_painter_shadow(p->around, p->shadow, &about);
    p->shaded = true;
}

// A little more of the likeness comes to the GPU, and then what it is drawn with is tried out, with nobody to be seen.
static enum status wait_less(struct painter *p)
{
    if (!likeness_painter_given(p->likeness) || !likeness_painter_bring(p->likeness, BROUGHT_BYTES))
        return OK;
    bool done;
    enum status status =
        likeness_painter_rehearse(p->likeness, p->smooth, p->hidden ? gpu_target_texture(p->hidden) : NULL, &done);
    if (status == OK && done && p->hidden)
        around_painter_rehearse(p->around, p->hidden);
    p->waiting = !(status == OK && done);
    return status;
}

// The level that is drawn now, and how wrong it will be.
static enum status choose_level(struct painter *p, struct scene *scene, struct painter_result *result)
{
    enum status status = p->waiting ? wait_less(p) : OK;
    if (status != OK)
        return status;
    double px_a_m = level_pixels_a_metre(&p->drawn, &scene->in_viewer);
    double full_m = p->likeness ? level_full_error_m() : p->cylinders_off_m;
    result->level = p->waiting ? DETAIL_PAPER : p->detail;
    result->error_px = px_a_m * full_m;
    if (result->level == DETAIL_FULL)
        return OK;
    status = cylinder_painter_select(p->cylinders, &scene->in_viewer, &scene->whole);
    double paper_px = px_a_m * level_paper_error_m(p->cylinders_off_m, scene->whole.cost_m);
    if (status < 0)
        return status;
    if (result->level == DETAIL_AUTO)
        result->level = status == OK && paper_px <= p->error_px ? DETAIL_PAPER : DETAIL_FULL;
    if (result->level == DETAIL_PAPER)
        result->error_px = paper_px;
    return OK;
}

static enum status draw_cylinders(struct painter *p, const struct scene *scene, const struct selection *whole,
                                  int *parts)
{
    const struct cylinder_view view = {whole, scene->shown, &scene->in_viewer, p->actor, p->coding ? p->source : NULL};
    return cylinder_painter_draw(p->cylinders, &view, parts);
}

// At paper, into p->plain.
static enum status draw_paper(struct painter *p, struct scene *scene, int *parts)
{
    p->actor = p->plain;
    enum status status = cylinder_painter_select(p->cylinders, &scene->in_viewer, &scene->whole);
    return status == OK ? draw_cylinders(p, scene, &scene->whole, parts) : status;
}

static enum status draw_actor(struct painter *p, const struct painter_view *view, struct painter_result *result)
{
    struct moment moment;
    enum status status = motion_at(p->motion, view->time_ns, p->detail != DETAIL_PAPER, &moment);
    if (status != OK) {
        clear(p);
        return status;
    }
    struct scene scene = {.shown = moment.frame,
                          .in_viewer = skeleton_transform(pose_inverse(view->world_from_camera), &moment.skeleton)};
    result->shown = moment.frame;
    status = choose_level(p, &scene, result);
    if (status != OK)
        return status;
    draw_shadow(p, view, &moment.skeleton);
    bool coding = p->coding;
    if (result->level == DETAIL_PAPER || view->also_paper) {
        p->coding = coding && result->level == DETAIL_PAPER;
        p->actor = p->plain;
        begin(p, view, &scene);
        status = draw_paper(p, &scene, &result->parts);
        p->coding = coding;
        if (status < 0)
            return status;
        if (result->level == DETAIL_PAPER) {
            result->source = status == OK ? scene.whole.frame : -1;
            return status;
        }
    }
    p->actor = p->smooth;
    begin(p, view, &scene);
    if (!p->likeness)
        return draw_cylinders(p, &scene, NULL, &result->parts);
    const int64_t near = likeness_painter_near(p->likeness, moment.frame, view->within_ns);
    struct likeness_view shown = {
        near < 0 ? moment.frame : near, moment.skeleton,
        view->world_from_camera,        p->actor,
        p->coding ? p->source : NULL,   p->hides && p->hidden ? gpu_target_texture(p->hidden) : NULL};
    int parts;
    status = likeness_painter_draw(p->likeness, &shown, &parts, &result->within);
    result->parts = status == OK ? parts : 0;
    return status;
}

// ---------------------------------------------------------------- pictures

static enum status compose(struct painter *p, const uint8_t *color)
{
    assert(p->drawn.width == p->lens.width && p->drawn.height == p->lens.height);
    gpu_texture_write(p->camera, color);
    gpu_draw(&(struct gpu_job){.target = p->composed,
                               .program = p->compose_program,
                               .mesh = p->whole,
                               .textures = {p->camera, gpu_target_texture(p->actor),
                                            p->shaded ? gpu_target_texture(p->shadow) : p->no_shadow}});
    return gpu_check(p->gpu);
}

enum status painter_draw_nobody(struct painter *p, const uint8_t *color)
{
    p->shaded = false;
    clear(p);
    return compose(p, color);
}

enum status painter_draw(struct painter *p, const struct painter_view *view, struct painter_result *result)
{
    *result = (struct painter_result){
        .level = p->detail, .shown = -1, .source = -1, .width = p->drawn.width, .height = p->drawn.height};
    if (!pose_finite(view->world_from_camera))
        return fail(ERR_INPUT, "the camera's pose is not finite");
    p->shaded = false;
    enum status status = draw_actor(p, view, result);
    if (status < 0)
        return status;
    return view->color ? compose(p, view->color) : gpu_check(p->gpu);
}

static enum status read_rgb(const struct painter *p, struct gpu_target *from, uint8_t *rgb)
{
    size_t pixels = (size_t)p->drawn.width * (size_t)p->drawn.height;
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
    size_t pixels = (size_t)p->drawn.width * (size_t)p->drawn.height;
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

void painter_set_error(struct painter *p, double error_px) { p->error_px = error_px; }

void painter_set_sources(struct painter *p, bool wanted) { p->coding = wanted && p->source; }

const struct gpu_texture *painter_actor_texture(struct painter *p) { return gpu_target_texture(p->actor); }

const struct gpu_texture *painter_shadow_texture(struct painter *p)
{
    return p->shaded ? gpu_target_texture(p->shadow) : NULL;
}

const struct gpu_texture *painter_paper_texture(struct painter *p) { return gpu_target_texture(p->plain); }
