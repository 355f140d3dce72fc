#include "reenact/render/actor_renderer.h"

#include "reenact/render/occlusion_shadow.h"
#include "reenact/render/cylinder_renderer.h"
#include "reenact/render/lod_error.h"
#include "reenact/render/avatar_renderer.h"
#include "reenact/skeleton/skeleton_track.h"
#include "reenact/render/shaders.h"

#include <stdlib.h>
#include <string.h>

enum { UPLOAD_BYTES = 512 << 10 };
enum { ROOM_SUPERSAMPLING = 2 }; // texels of the room's depth along a pixel's side
enum { SHADOW_PX = 2 }; // pixels of the picture along one of the shadow's: it is soft, and each looks at the whole body

static const double TYPICAL_CYLINDER_ERROR_M = 0.03; // of a person who is not known yet

struct renderer {
    struct gpu *gpu;
    struct take *take;
    struct lens lens,
        drawn; // the tablet's; the one that is drawn for, with `resolution_scale` of its pixels along a side
    double resolution_scale;
    enum detail detail;
    struct take_skeletons *own_skeletons; // NULL: options gave them
    const struct take_skeletons *skeletons;
    struct skeleton_track *motion;
    struct cylinder_renderer *cylinders;
    struct source_rays *rays; // NULL: the take has no depth
    struct occlusion_shadow *occlusion;
    struct avatar_renderer *avatar; // NULL: too little of the person was seen; rounded cylinders then
    struct gpu_program *compose_program;
    struct gpu_mesh *fullscreen; // one triangle over everything
    struct gpu_texture *camera;
    struct gpu_target *plain, *smooth, *composed; // actor at paper, actor at full, result
    struct gpu_target *actor;                     // the one of the two last drawn into
    struct gpu_target *hidden;                    // the room's depth where it may hide him at full; NULL: no room
    bool hides;                                   // there is something in it
    struct gpu_target *shadow;                    // NULL: none is wanted
    struct gpu_texture *no_shadow;                // a transparent pixel
    bool shaded;                                  // the picture last drawn has a shadow
    struct gpu_target *source;                    // where each pixel is from; NULL: not asked for
    bool writes_source;                           // it is asked for now
    bool upload_pending;                          // for a avatar, or for it to be on the GPU
    bool avatar_later;                            // it comes from somebody else
    double error_px;                              // that DETAIL_AUTO may be wrong by
    double cylinder_error_m;                      // from the person's surface
};

struct renderer_options renderer_default_options(void)
{
    return (struct renderer_options){.detail = DETAIL_FULL, .texture_bytes = (size_t)64 << 20, .error_px = 1};
}

// ---------------------------------------------------------------- opening

static void set_view_lens(struct renderer *p)
{
    cylinder_renderer_set_lens(p->cylinders, &p->drawn);
    if (p->avatar)
        avatar_renderer_set_lens(p->avatar, &p->drawn);
    occlusion_shadow_set_lens(p->occlusion, &p->drawn);
}

static enum status open_programs(struct renderer *p)
{
    static const float corners[] = {-1, -1, 3, -1, -1, 3};
    static const uint16_t order[] = {0, 1, 2};
    static const char *const compose_samplers[] = {"camera_image", "actor_image", "shadow_image"};
    const struct gpu_program_source compose = {.name = "compose",
                                               .vertex = shader_find("fullscreen.vert"),
                                               .fragment = shader_find("compose.frag"),
                                               .samplers = compose_samplers,
                                               .sampler_count = 3};
    enum status status = gpu_mesh_open(&p->fullscreen, p->gpu, corners, 2, 3, order, 3);
    if (status == OK)
        status = gpu_texture_open(&p->no_shadow, p->gpu, GPU_RGBA8, 1, 1, GPU_NEAREST, (const uint8_t[4]){0});
    if (status == OK)
        status = occlusion_shadow_open(&p->occlusion, p->gpu, &p->lens);
    if (status == OK)
        status = gpu_program_open(&p->compose_program, p->gpu, &compose);
    if (status == OK)
        set_view_lens(p);
    return status;
}

static enum status open_targets(struct renderer *p, bool sources, bool shadow)
{
    int w = p->lens.width, h = p->lens.height;
    enum status status = gpu_texture_open(&p->camera, p->gpu, GPU_RGB8, w, h, GPU_NEAREST, NULL);
    if (status == OK && (p->detail != DETAIL_FULL || p->avatar_later))
        status = gpu_target_open(&p->plain, p->gpu, w, h);
    if (status == OK && p->detail != DETAIL_PAPER)
        status = gpu_target_open(&p->smooth, p->gpu, w, h);
    if (status == OK)
        status = gpu_target_open_color(&p->composed, p->gpu, w, h);
    if (status == OK && sources)
        status = gpu_target_open(&p->source, p->gpu, w, h);
    if (status == OK && shadow)
        status = gpu_target_open(&p->shadow, p->gpu, (w + 1) / SHADOW_PX, (h + 1) / SHADOW_PX);
    p->actor = p->plain ? p->plain : p->smooth;
    p->writes_source = sources;
    return status;
}

// What the room hides of him.
static enum status open_hidden(struct renderer *p)
{
    return gpu_target_open_depth(&p->hidden, p->gpu, ROOM_SUPERSAMPLING * p->lens.width,
                                 ROOM_SUPERSAMPLING * p->lens.height);
}

static void close_targets(struct renderer *p)
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
        gpu_target_resize(t, width, height);
}

// As finely as is wanted, in the top left of targets of the lens's size: so nothing has to be made when that changes.
static void use_targets(struct renderer *p)
{
    p->drawn = lens_resized(&p->lens, p->resolution_scale);
    const int w = p->drawn.width, h = p->drawn.height;
    set_view_lens(p);
    use(p->plain, w, h);
    use(p->smooth, w, h);
    use(p->source, w, h);
    use(p->hidden, ROOM_SUPERSAMPLING * w, ROOM_SUPERSAMPLING * h);
    use(p->shadow, (w + 1) / SHADOW_PX, (h + 1) / SHADOW_PX);
}

void renderer_set_resolution_scale(struct renderer *p, double resolution_scale)
{
    if (resolution_scale == p->resolution_scale)
        return;
    p->resolution_scale = resolution_scale;
    use_targets(p);
}

enum status renderer_set_lens(struct renderer *p, const struct lens *lens)
{
    enum status status = lens_check(lens, "tablet's");
    if (status != OK)
        return status;
    bool resized = lens->width != p->lens.width || lens->height != p->lens.height, sources = p->source,
         shadow = p->shadow, hidden = p->hidden, writes_source = p->writes_source;
    p->lens = *lens;
    if (resized) {
        close_targets(p);
        status = open_targets(p, sources, shadow);
        p->writes_source = writes_source;
    }
    if (resized && status == OK && hidden)
        status = open_hidden(p);
    use_targets(p);
    return status;
}

enum status renderer_set_avatar(struct renderer *p, struct avatar *avatar)
{
    p->upload_pending = false;
    if (!avatar || !p->avatar) {
        if (avatar)
            avatar_free(avatar);
        avatar_renderer_close(&p->avatar);
        return OK;
    }
    p->cylinder_error_m = lod_cylinder_error_m(avatar);
    enum status status = avatar_renderer_set_avatar(p->avatar, avatar);
    if (status != OK)
        avatar_renderer_close(&p->avatar);
    p->upload_pending = status == OK;
    return status;
}

const struct avatar *renderer_avatar(const struct renderer *p)
{
    return p->avatar && !p->upload_pending ? avatar_renderer_avatar(p->avatar) : NULL;
}

enum status renderer_add_frame(struct renderer *p, struct frame_layer *loaded)
{
    if (p->avatar)
        return avatar_renderer_add_frame(p->avatar, loaded);
    frame_layer_free(loaded);
    return OK;
}

int64_t renderer_nearest_resident_frame(const struct renderer *p, int64_t frame, int64_t within_ns)
{
    return p->avatar ? avatar_renderer_nearest_resident(p->avatar, frame, within_ns) : -1;
}

enum status renderer_set_room(struct renderer *p, struct occluder_mesh *room)
{
    const bool any = room->corner_count > 0;
    enum status status = occlusion_shadow_set_room(p->occlusion, room);
    if (status == OK && any && p->smooth && !p->hidden)
        status = open_hidden(p);
    use_targets(p);
    return status;
}

bool renderer_upload_done(const struct renderer *p)
{
    return !p->upload_pending || !avatar_renderer_has_avatar(p->avatar);
}

static enum status open_avatar(struct renderer *p, const struct renderer_options *options)
{
    const struct calibration *c = take_calibration(p->take);
    if (p->detail == DETAIL_PAPER || !(c->depth.width > 0))
        return OK;
    enum status status = source_rays_open(&p->rays, c);
    const struct frame_source source = {p->take, p->skeletons, p->rays};
    if (status == OK)
        status = avatar_renderer_open(&p->avatar, p->gpu, &source, &p->lens, options->texture_bytes / 2);
    p->upload_pending = status == OK;
    if (status != OK || p->avatar_later)
        return status;
    struct avatar avatar;
    struct avatar_options how = avatar_default_options();
    how.watch = options->watch;
    status = avatar_make(&avatar, p->take, p->rays, &how);
    if (status < 0)
        return status;
    status = renderer_set_avatar(p, status == OK ? &avatar : NULL);
    p->upload_pending = status == OK && p->avatar && !avatar_renderer_upload_step(p->avatar, SIZE_MAX);
    return status;
}

static bool has_floor(const struct take *take)
{
    bool located = false;
    for (int64_t i = 0; i < take_frame_count(take) && !located; i++)
        located = take_entry(take, i)->located;
    return located;
}

enum status renderer_open(struct renderer **out, struct gpu *gpu, struct take *take, const struct lens *lens,
                          const struct renderer_options *options)
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
    struct renderer *p = calloc(1, sizeof *p);
    if (!p)
        return fail(ERR_MEMORY, "out of memory");
    p->gpu = gpu;
    p->take = take;
    p->lens = p->drawn = *lens;
    p->resolution_scale = 1;
    p->detail = options->detail;
    p->error_px = options->error_px;
    p->cylinder_error_m = TYPICAL_CYLINDER_ERROR_M;
    p->avatar_later = options->avatar_later && options->detail != DETAIL_PAPER;
    status = options->skeletons ? OK : take_skeletons_open(&p->own_skeletons, take);
    p->skeletons = options->skeletons ? options->skeletons : p->own_skeletons;
    if (status == OK)
        status = skeleton_track_open(&p->motion, take, p->skeletons);
    const size_t bytes = options->texture_bytes / (p->detail == DETAIL_PAPER ? 1 : 2);
    if (status == OK)
        status = cylinder_renderer_open(&p->cylinders, gpu, take, bytes);
    if (status == OK)
        status = open_avatar(p, options);
    if (status == OK)
        status = open_programs(p);
    if (status == OK)
        status = open_targets(p, options->sources, options->shadow && has_floor(take));
    if (status != OK) {
        renderer_close(&p);
        return status;
    }
    *out = p;
    return OK;
}

void renderer_close(struct renderer **out)
{
    struct renderer *p = *out;
    if (!p)
        return;
    avatar_renderer_close(&p->avatar);
    source_rays_close(&p->rays);
    occlusion_shadow_close(&p->occlusion);
    gpu_texture_close(&p->no_shadow);
    gpu_mesh_close(&p->fullscreen);
    close_targets(p);
    gpu_program_close(&p->compose_program);
    cylinder_renderer_close(&p->cylinders);
    skeleton_track_close(&p->motion);
    take_skeletons_close(&p->own_skeletons);
    free(p);
    *out = NULL;
}

// ---------------------------------------------------------------- the actor

// What is being drawn.
struct draw_state {
    int64_t shown;
    struct skeleton in_viewer;
    struct frame_selection whole; // at paper
};

static void clear(struct renderer *p)
{
    gpu_target_clear(p->actor);
    if (p->writes_source)
        gpu_target_clear(p->source);
}

// An empty picture, but for the room that may hide the actor.
static void begin_target(struct renderer *p, const struct renderer_view *view, const struct draw_state *state)
{
    const struct occlusion_frustum body = occlusion_frustum_body(&state->in_viewer);
    const bool smoothly = p->actor == p->smooth && p->avatar && p->hidden;
    clear(p);
    if (smoothly)
        gpu_target_clear(p->hidden);
    p->hides = false;
    if (view->viewer_from_room)
        p->hides =
            occlusion_shadow_draw_room(p->occlusion, smoothly ? p->hidden : p->actor, view->viewer_from_room, &body);
    if (view->viewer_from_room && p->writes_source)
        occlusion_shadow_draw_room(p->occlusion, p->source, view->viewer_from_room, &body);
}

static void draw_shadow(struct renderer *p, const struct renderer_view *view, const struct skeleton *skeleton)
{
    if (!p->shadow)
        return;
    const struct occlusion_shadow_view about = {view->world_from_camera, view->viewer_from_room, skeleton,
                                                take_body(p->take)};
    gpu_target_clear(p->shadow);
    occlusion_shadow_draw(p->occlusion, p->shadow, &about);
    p->shaded = true;
}

// A little more of the avatar comes to the GPU, and then what it is drawn with is tried out, with nobody to be seen.
static enum status upload_more(struct renderer *p)
{
    if (!avatar_renderer_has_avatar(p->avatar) || !avatar_renderer_upload_step(p->avatar, UPLOAD_BYTES))
        return OK;
    bool done;
    enum status status =
        avatar_renderer_warm_up(p->avatar, p->smooth, p->hidden ? gpu_target_texture(p->hidden) : NULL, &done);
    if (status == OK && done && p->hidden)
        occlusion_shadow_warm_up(p->occlusion, p->hidden);
    p->upload_pending = !(status == OK && done);
    return status;
}

// The level that is drawn now, and how wrong it will be.
static enum status choose_level(struct renderer *p, struct draw_state *state, struct renderer_result *result)
{
    enum status status = p->upload_pending ? upload_more(p) : OK;
    if (status != OK)
        return status;
    double px_a_m = lod_pixels_per_metre(&p->drawn, &state->in_viewer);
    double full_m = p->avatar ? lod_full_error_m() : p->cylinder_error_m;
    result->level = p->upload_pending ? DETAIL_PAPER : p->detail;
    result->error_px = px_a_m * full_m;
    if (result->level == DETAIL_FULL)
        return OK;
    status = cylinder_renderer_select(p->cylinders, &state->in_viewer, &state->whole);
    double paper_px = px_a_m * lod_paper_error_m(p->cylinder_error_m, state->whole.cost_m);
    if (status < 0)
        return status;
    if (result->level == DETAIL_AUTO)
        result->level = status == OK && paper_px <= p->error_px ? DETAIL_PAPER : DETAIL_FULL;
    if (result->level == DETAIL_PAPER)
        result->error_px = paper_px;
    return OK;
}

static enum status draw_cylinders(struct renderer *p, const struct draw_state *state,
                                  const struct frame_selection *whole, int *parts)
{
    const struct cylinder_view view = {whole, state->shown, &state->in_viewer, p->actor,
                                       p->writes_source ? p->source : NULL};
    return cylinder_renderer_draw(p->cylinders, &view, parts);
}

// At paper, into p->plain.
static enum status draw_paper(struct renderer *p, struct draw_state *state, int *parts)
{
    p->actor = p->plain;
    enum status status = cylinder_renderer_select(p->cylinders, &state->in_viewer, &state->whole);
    return status == OK ? draw_cylinders(p, state, &state->whole, parts) : status;
}

static enum status draw_actor(struct renderer *p, const struct renderer_view *view, struct renderer_result *result)
{
    struct track_sample moment;
    enum status status = skeleton_track_at(p->motion, view->time_ns, p->detail != DETAIL_PAPER, &moment);
    if (status != OK) {
        clear(p);
        return status;
    }
    struct draw_state state = {.shown = moment.frame,
                               .in_viewer =
                                   skeleton_transform(pose_inverse(view->world_from_camera), &moment.skeleton)};
    result->shown = moment.frame;
    status = choose_level(p, &state, result);
    if (status != OK)
        return status;
    draw_shadow(p, view, &moment.skeleton);
    bool writes_source = p->writes_source;
    if (result->level == DETAIL_PAPER || view->also_paper) {
        p->writes_source = writes_source && result->level == DETAIL_PAPER;
        p->actor = p->plain;
        begin_target(p, view, &state);
        status = draw_paper(p, &state, &result->parts);
        p->writes_source = writes_source;
        if (status < 0)
            return status;
        if (result->level == DETAIL_PAPER) {
            result->source = status == OK ? state.whole.frame : -1;
            return status;
        }
    }
    p->actor = p->smooth;
    begin_target(p, view, &state);
    if (!p->avatar)
        return draw_cylinders(p, &state, NULL, &result->parts);
    const int64_t resident = avatar_renderer_nearest_resident(p->avatar, moment.frame, view->within_ns);
    struct avatar_view shown = {resident < 0 ? moment.frame : resident,
                                moment.skeleton,
                                view->world_from_camera,
                                p->actor,
                                p->writes_source ? p->source : NULL,
                                p->hides && p->hidden ? gpu_target_texture(p->hidden) : NULL};
    int parts;
    status = avatar_renderer_draw(p->avatar, &shown, &parts, &result->within);
    result->parts = status == OK ? parts : 0;
    return status;
}

// ---------------------------------------------------------------- pictures

static enum status compose(struct renderer *p, const uint8_t *color)
{
    assert(p->drawn.width == p->lens.width && p->drawn.height == p->lens.height);
    gpu_texture_write(p->camera, color);
    gpu_draw(&(struct gpu_job){.target = p->composed,
                               .program = p->compose_program,
                               .mesh = p->fullscreen,
                               .textures = {p->camera, gpu_target_texture(p->actor),
                                            p->shaded ? gpu_target_texture(p->shadow) : p->no_shadow}});
    return gpu_check(p->gpu);
}

enum status renderer_draw_background(struct renderer *p, const uint8_t *color)
{
    p->shaded = false;
    clear(p);
    return compose(p, color);
}

enum status renderer_draw(struct renderer *p, const struct renderer_view *view, struct renderer_result *result)
{
    *result = (struct renderer_result){
        .level = p->detail, .shown = -1, .source = -1, .width = p->drawn.width, .height = p->drawn.height};
    if (!pose_finite(view->world_from_camera))
        return fail(ERR_INPUT, "the camera's pose is not finite");
    p->shaded = false;
    enum status status = draw_actor(p, view, result);
    if (status < 0)
        return status;
    return view->color ? compose(p, view->color) : gpu_check(p->gpu);
}

static enum status read_rgb(const struct renderer *p, struct gpu_target *from, uint8_t *rgb)
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

enum status renderer_read(struct renderer *p, uint8_t *rgb) { return read_rgb(p, p->composed, rgb); }

enum status renderer_read_actor(struct renderer *p, uint8_t *rgba)
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

enum status renderer_read_source(struct renderer *p, uint8_t *rgb)
{
    assert(p->source);
    return read_rgb(p, p->source, rgb);
}

void renderer_set_error(struct renderer *p, double error_px) { p->error_px = error_px; }

void renderer_set_sources(struct renderer *p, bool wanted) { p->writes_source = wanted && p->source; }

const struct gpu_texture *renderer_actor_texture(struct renderer *p) { return gpu_target_texture(p->actor); }

const struct gpu_texture *renderer_shadow_texture(struct renderer *p)
{
    return p->shaded ? gpu_target_texture(p->shadow) : NULL;
}

const struct gpu_texture *renderer_paper_texture(struct renderer *p) { return gpu_target_texture(p->plain); }
