// Draws the actor: opening, level of detail, draw order.
#include "reenact/render/actor_renderer.h"

#include "base/clock.h"
#include "reenact/avatar/avatar.h"
#include "reenact/render/avatar_renderer.h"
#include "reenact/render/cylinder_renderer.h"
#include "reenact/render/occlusion_shadow.h"
#include "reenact/render/shaders.h"
#include "reenact/skeleton/skeleton_track.h"

#include <stdlib.h>
#include <string.h>

struct renderer {
    struct gpu *gpu;
    struct take *take;
    struct lens lens, drawn; // the viewer camera's; the same at `resolution_scale`, which is drawn with
    double resolution_scale; // per axis
    enum detail detail;
    bool may_draw_avatar;                 // opened for a level that needs one
    struct take_skeletons *own_skeletons; // NULL: the options gave them
    const struct take_skeletons *skeletons;
    struct skeleton_track *motion;
    struct cylinder_renderer *cylinders;
    struct source_rays *rays; // NULL: the take has no depth
    struct occlusion_shadow *occlusion;
    struct avatar_renderer *avatar; // NULL: the take shows too little for an avatar; rounded cylinders then
    struct gpu_program *compose_program;
    struct gpu_mesh *fullscreen; // one triangle over the whole target
    struct gpu_texture *camera;
    struct gpu_target *actor, *composed; // the actor alone, the composed image
    struct gpu_target *room_depth;       // occluder mesh's depth that hides an avatar; NULL: no room
    bool avatar_drawn;                   // in `actor`; else cylinders, which the room hides by the target's own depth
    bool room_drawn;                     // the room's depth is not empty
    struct gpu_target *shadow;           // NULL: not wanted
    struct gpu_texture *no_shadow;       // one transparent pixel
    bool shaded;                         // the image last drawn has a shadow
    struct depth_overlay *overlay;       // NULL: none was drawn yet, as the following
    struct gpu_target *strokes;
    bool stroked;              // the image last drawn has strokes
    struct gpu_target *source; // as renderer_read_source; NULL: not wanted
    bool writes_source;        // wanted for the next image
    bool upload_pending;       // waiting for the avatar or its upload
    bool avatar_later;         // renderer_set_avatar gives it
    double error_px;           // predicted error that DETAIL_AUTO accepts
    struct detail_costs costs;
    double unseen_share; // of the avatar's surface
};

// ---------------------------------------------------------------- lod error

// Predicted errors of the levels of detail.

// Of outlines drawn from all round. Cylinders: shares of the body's radius. The avatar: more where it was never seen.
// Fitted by hand to the small world's dancer, dance and a heavy figure's kata; docs/notes/retrieval-and-drawing.md has
// the errors on other films. SIMPLE_M: of 8 frames, as app/view/avatar_builder.c makes it.
static const double PAPER_SHARE = 0.325, PARTS_SHARE = 0.295;
static const double FUSED_M = 0.0054, FUSED_UNSEEN_M = 0.0038, FULL_M = 0.0045, FULL_UNSEEN_M = 0.005,
                    SIMPLE_M = 0.0135;

double lod_pixels_per_metre(const struct lens *lens, const struct skeleton *in_viewer)
{
    double sum = 0;
    int count = 0;
    for (int j = 0; j < JOINT_COUNT; j++)
        if (in_viewer->confidence[j] > 0 && in_viewer->joint[j].z > 0.05) {
            sum += lens->fx / in_viewer->joint[j].z;
            count++;
        }
    return count ? sum / count : 0;
}

double lod_body_radius_m(const struct body *body, const struct skeleton *skeleton)
{
    double sum = 0;
    int count = 0;
    for (int p = 0; p < PART_COUNT; p++)
        if (part_is_known(body, skeleton, (enum part)p)) {
            sum += body->radius_rate[p] *
                   v3_distance(skeleton->joint[part_ends[p].from], skeleton->joint[part_ends[p].to]);
            count++;
        }
    return count ? sum / count : 0;
}

double lod_simple_error_m(void) { return SIMPLE_M; }

double lod_unseen_share(const struct avatar *avatar)
{
    const int count = avatar->surface.point_count;
    int filled = 0;
    for (int i = 0; i < count; i++)
        filled += avatar->vertex_colors.filled[i] != 0;
    return count ? (double)filled / count : 0;
}

double lod_outline_error_m(enum detail level, double body_radius_m, double unseen_share)
{
    switch (level) {
    case DETAIL_PAPER: return PAPER_SHARE * body_radius_m;
    case DETAIL_PARTS: return PARTS_SHARE * body_radius_m;
    case DETAIL_FUSED: return FUSED_M + FUSED_UNSEEN_M * unseen_share;
    default: return FULL_M + FULL_UNSEEN_M * unseen_share;
    }
}

// ---------------------------------------------------------------- actor targets

// The actor renderer's render targets: sizes, resolution scale, lens, read-back.

enum { ROOM_SUPERSAMPLING = 2 }; // texels of the room's depth along a pixel's side
enum { SHADOW_PX = 2 };          // image pixels along a shadow pixel: it is soft, and each one visits the whole body

static void set_view_lens(struct renderer *renderer)
{
    cylinder_renderer_set_lens(renderer->cylinders, &renderer->drawn);
    if (renderer->avatar)
        avatar_renderer_set_lens(renderer->avatar, &renderer->drawn);
    occlusion_shadow_set_lens(renderer->occlusion, &renderer->drawn);
}

// Opens the render targets at the lens's size. ERR_DEVICE, ERR_MEMORY; close them then, too.
static enum status actor_targets_open(struct renderer *renderer, bool sources, bool shadow)
{
    int w = renderer->lens.width, h = renderer->lens.height;
    enum status status = gpu_texture_open(&renderer->camera, renderer->gpu,
                                          &(struct gpu_texture_layout){GPU_RGB8, w, h, GPU_NEAREST}, NULL);
    if (status == OK)
        status = gpu_target_open_comparable(&renderer->actor, renderer->gpu, w, h);
    if (status == OK)
        status = gpu_target_open_color(&renderer->composed, renderer->gpu, w, h);
    if (status == OK && sources)
        status = gpu_target_open(&renderer->source, renderer->gpu, w, h);
    if (status == OK && shadow)
        status = gpu_target_open(&renderer->shadow, renderer->gpu, (w + 1) / SHADOW_PX, (h + 1) / SHADOW_PX);
    renderer->writes_source = sources;
    return status;
}

static enum status actor_targets_open_room_depth(struct renderer *renderer)
{
    return gpu_target_open_depth(&renderer->room_depth, renderer->gpu, ROOM_SUPERSAMPLING * renderer->lens.width,
                                 ROOM_SUPERSAMPLING * renderer->lens.height);
}

static void actor_targets_close(struct renderer *renderer)
{
    gpu_target_close(&renderer->room_depth);
    gpu_target_close(&renderer->actor);
    gpu_target_close(&renderer->composed);
    gpu_target_close(&renderer->strokes);
    gpu_target_close(&renderer->source);
    gpu_target_close(&renderer->shadow);
    gpu_texture_close(&renderer->camera);
}

// Where the room's depth is drawn that hides renderer->actor: into renderer->room_depth, or into its own.
static struct gpu_target *actor_targets_room(const struct renderer *renderer)
{
    return renderer->avatar_drawn && renderer->room_depth ? renderer->room_depth : renderer->actor;
}

static void resize_target(struct gpu_target *target, int width, int height)
{
    if (target)
        gpu_target_resize(target, width, height);
}

// Applies the resolution scale and the lens to targets and renderers. Targets keep their allocation
// at the lens's size and use their top left, so that nothing is allocated when the scale changes.
static void actor_targets_apply_scale(struct renderer *renderer)
{
    renderer->drawn = lens_resized(&renderer->lens, renderer->resolution_scale);
    const int w = renderer->drawn.width, h = renderer->drawn.height;
    set_view_lens(renderer);
    resize_target(renderer->actor, w, h);
    resize_target(renderer->source, w, h);
    resize_target(renderer->strokes, w, h);
    resize_target(renderer->room_depth, ROOM_SUPERSAMPLING * w, ROOM_SUPERSAMPLING * h);
    resize_target(renderer->shadow, (w + 1) / SHADOW_PX, (h + 1) / SHADOW_PX);
}

void renderer_set_resolution_scale(struct renderer *renderer, double resolution_scale)
{
    if (resolution_scale == renderer->resolution_scale)
        return;
    renderer->resolution_scale = resolution_scale;
    actor_targets_apply_scale(renderer);
}

enum status renderer_set_lens(struct renderer *renderer, const struct lens *lens)
{
    enum status status = lens_check(lens, "tablet's");
    if (status != OK)
        return status;
    bool resized = lens->width != renderer->lens.width || lens->height != renderer->lens.height,
         sources = renderer->source, shadow = renderer->shadow, room_depth = renderer->room_depth,
         writes_source = renderer->writes_source;
    renderer->lens = *lens;
    if (resized) {
        actor_targets_close(renderer);
        status = actor_targets_open(renderer, sources, shadow);
        renderer->writes_source = writes_source;
    }
    if (resized && status == OK && room_depth)
        status = actor_targets_open_room_depth(renderer);
    actor_targets_apply_scale(renderer);
    return status;
}

// ---------------------------------------------------------------- read-back

static enum status read_rgb(const struct renderer *renderer, struct gpu_target *from, uint8_t *rgb)
{
    size_t pixels = (size_t)renderer->drawn.width * (size_t)renderer->drawn.height;
    uint8_t *rgba = malloc(pixels * 4);
    if (!rgba)
        return fail(ERR_MEMORY, "no memory for the renderer's targets");
    enum status status = gpu_target_read(from, rgba);
    for (size_t i = 0; i < pixels && status == OK; i++)
        memcpy(rgb + 3 * i, rgba + 4 * i, 3);
    free(rgba);
    return status;
}

enum status renderer_read(struct renderer *renderer, uint8_t *rgb)
{
    return read_rgb(renderer, renderer->composed, rgb);
}

enum status renderer_read_actor(struct renderer *renderer, uint8_t *rgba)
{
    enum status status = gpu_target_read(renderer->actor, rgba);
    if (status != OK)
        return status;
    size_t pixels = (size_t)renderer->drawn.width * (size_t)renderer->drawn.height;
    for (size_t i = 0; i < pixels; i++) { // premultiplied to straight
        uint8_t *at = rgba + 4 * i;
        for (int c = 0; c < 3 && at[3] && at[3] < 255; c++) {
            int straight = (at[c] * 255 + at[3] / 2) / at[3];
            at[c] = (uint8_t)(straight < 255 ? straight : 255);
        }
    }
    return OK;
}

enum status renderer_read_source(struct renderer *renderer, uint8_t *rgb)
{
    assert(renderer->source);
    return read_rgb(renderer, renderer->source, rgb);
}

const struct gpu_texture *renderer_actor_texture(struct renderer *renderer)
{
    return gpu_target_texture(renderer->actor);
}

const struct gpu_texture *renderer_shadow_texture(struct renderer *renderer)
{
    return renderer->shaded ? gpu_target_texture(renderer->shadow) : NULL;
}

// ---------------------------------------------------------------- actor overlay

// What is drawn over the actor's image at a depth of its own, and what is asked of it.

// Radii about strokes' ends and about points of which the room's depth is drawn. Chosen by hand.
static const double STROKE_M = 0.15, POINT_M = 0.02;

// Draws the room's depth where it may hide what is in the frustum. True: there is any.
static bool draw_room(struct renderer *renderer, const struct renderer_view *view,
                      const struct occlusion_frustum *hidden)
{
    return hidden->farthest_m > 0 && occlusion_shadow_draw_room(renderer->occlusion, actor_targets_room(renderer),
                                                                view->viewer_from_room, hidden);
}

static bool draw_rooms(struct renderer *renderer, const struct renderer_view *view)
{
    const struct overlay *o = view->overlay;
    struct occlusion_frustum strokes = {0};
    bool any = false;
    for (int i = 0; i < o->stroke_count; i++) {
        occlusion_frustum_add(&strokes, o->strokes[i].from, STROKE_M);
        occlusion_frustum_add(&strokes, o->strokes[i].to, STROKE_M);
    }
    any = draw_room(renderer, view, &strokes);
    for (int g = 0; g < o->group_count && g < OVERLAY_GROUPS_MAX; g++) { // each alone: they may be far apart
        struct occlusion_frustum points = {0};
        for (int i = 0; i < OVERLAY_POINTS; i++)
            occlusion_frustum_add(&points, o->groups[g].point[i], POINT_M);
        any |= draw_room(renderer, view, &points);
    }
    return any;
}

// Draws view->overlay over the actor just drawn, and the depth of the room that may hide it. ERR_DEVICE, ERR_MEMORY.
static enum status actor_overlay_draw(struct renderer *renderer, const struct renderer_view *view)
{
    enum status status = renderer->overlay ? OK : depth_overlay_open(&renderer->overlay, renderer->gpu);
    if (status == OK && view->overlay->stroke_count && !renderer->strokes) {
        status = gpu_target_open_color(&renderer->strokes, renderer->gpu, renderer->lens.width, renderer->lens.height);
        actor_targets_apply_scale(renderer);
    }
    if (status != OK)
        return status;
    if (view->viewer_from_room && draw_rooms(renderer, view))
        renderer->room_drawn = true;
    renderer->stroked = view->overlay->stroke_count > 0;
    if (renderer->stroked)
        gpu_target_clear(renderer->strokes);
    const bool apart = renderer->room_drawn && actor_targets_room(renderer) == renderer->room_depth;
    const struct overlay_picture picture = {gpu_target_depth(renderer->actor),
                                            apart ? gpu_target_texture(renderer->room_depth) : NULL, renderer->drawn,
                                            renderer->resolution_scale};
    depth_overlay_draw(renderer->overlay, renderer->strokes, &picture, view->overlay);
    return gpu_check(renderer->gpu);
}

const struct gpu_texture *renderer_overlay_texture(struct renderer *renderer)
{
    return renderer->stroked ? gpu_target_texture(renderer->strokes) : NULL;
}

enum status renderer_read_seen(struct renderer *renderer, float share[OVERLAY_GROUPS_MAX], int *count)
{
    *count = 0;
    return renderer->overlay ? depth_overlay_read(renderer->overlay, share, count) : OK;
}

// ---------------------------------------------------------------- actor renderer

enum { UPLOAD_BYTES = 512 << 10 }; // of the avatar with each image; chosen by hand
enum { FRAMES_FIRST = 400 };       // cylinder_renderer_open: 20 ms before the first image of a long take; by hand

struct renderer_options renderer_default_options(void)
{
    return (struct renderer_options){.detail = DETAIL_FULL, .texture_bytes = (size_t)64 << 20, .error_px = 1};
}

// ---------------------------------------------------------------- opening

static enum status open_programs(struct renderer *renderer)
{
    static const char *const compose_samplers[] = {"camera_image", "actor_image", "shadow_image"};
    const struct gpu_program_source compose = {.name = "compose",
                                               .vertex = shader_find("fullscreen.vert"),
                                               .fragment = shader_find("compose.frag"),
                                               .samplers = compose_samplers,
                                               .sampler_count = 3};
    enum status status = fullscreen_mesh_open(&renderer->fullscreen, renderer->gpu);
    if (status == OK)
        status = gpu_texture_open(&renderer->no_shadow, renderer->gpu,
                                  &(struct gpu_texture_layout){GPU_RGBA8, 1, 1, GPU_NEAREST}, (const uint8_t[4]){0});
    if (status == OK)
        status = occlusion_shadow_open(&renderer->occlusion, renderer->gpu, &renderer->lens);
    if (status == OK)
        status = gpu_program_open(&renderer->compose_program, renderer->gpu, &compose);
    if (status == OK)
        actor_targets_apply_scale(renderer);
    return status;
}

enum status renderer_set_avatar(struct renderer *renderer, struct avatar *avatar)
{
    renderer->upload_pending = false;
    if (!avatar || !renderer->avatar) {
        if (avatar)
            avatar_free(avatar);
        avatar_renderer_close(&renderer->avatar);
        return OK;
    }
    renderer->unseen_share = lod_unseen_share(avatar);
    enum status status = avatar_renderer_set_avatar(renderer->avatar, avatar);
    if (status != OK)
        avatar_renderer_close(&renderer->avatar);
    renderer->upload_pending = status == OK;
    return status;
}

void renderer_finish_upload(struct renderer *renderer)
{
    renderer->upload_pending =
        renderer->upload_pending && renderer->avatar && !avatar_renderer_upload_step(renderer->avatar, SIZE_MAX);
}

const struct avatar *renderer_avatar(const struct renderer *renderer)
{
    return renderer->avatar && !renderer->upload_pending ? avatar_renderer_avatar(renderer->avatar) : NULL;
}

enum status renderer_add_frame(struct renderer *renderer, struct frame_layer *loaded)
{
    if (renderer->avatar)
        return avatar_renderer_add_frame(renderer->avatar, loaded);
    frame_layer_free(loaded);
    return OK;
}

int64_t renderer_nearest_resident_frame(const struct renderer *renderer, int64_t frame, int64_t within_ns)
{
    return renderer->avatar ? avatar_renderer_nearest_resident(renderer->avatar, frame, within_ns) : -1;
}

enum status renderer_set_room(struct renderer *renderer, struct occluder_mesh *room)
{
    const bool any = room->corner_count > 0;
    enum status status = occlusion_shadow_set_room(renderer->occlusion, room);
    if (status == OK && any && renderer->may_draw_avatar && !renderer->room_depth)
        status = actor_targets_open_room_depth(renderer);
    actor_targets_apply_scale(renderer);
    return status;
}

bool renderer_upload_done(const struct renderer *renderer)
{
    return !renderer->upload_pending || !avatar_renderer_has_avatar(renderer->avatar);
}

static enum status open_avatar(struct renderer *renderer, const struct renderer_options *options)
{
    const struct calibration *c = take_calibration(renderer->take);
    if (!renderer->may_draw_avatar || !(c->depth.width > 0))
        return OK;
    enum status status = source_rays_open(&renderer->rays, c);
    const struct frame_source source = {renderer->take, renderer->skeletons, renderer->rays};
    if (status == OK)
        status = avatar_renderer_open(&renderer->avatar, renderer->gpu, &source, &renderer->lens,
                                      options->texture_bytes / 2);
    renderer->upload_pending = status == OK;
    if (status != OK || renderer->avatar_later)
        return status;
    struct avatar avatar;
    struct avatar_options how = avatar_default_options();
    how.watch = options->watch;
    status = avatar_obtain(&avatar, renderer->take, renderer->rays, &how);
    if (status < 0)
        return status;
    status = renderer_set_avatar(renderer, status == OK ? &avatar : NULL);
    renderer->upload_pending =
        status == OK && renderer->avatar && !avatar_renderer_upload_step(renderer->avatar, SIZE_MAX);
    return status;
}

enum status renderer_open(struct renderer **out, struct gpu *gpu, struct take *take, const struct lens *lens,
                          const struct renderer_options *options)
{
    *out = NULL;
    enum status status = lens_check(lens, "tablet's");
    if (status == OK && !take_calibration(take)->color.width)
        return fail(ERR_INPUT, "the take has no colour, so the actor cannot be drawn; "
                               "the movement can be compared and exported");
    if (status == OK)
        status = lens_check(&take_calibration(take)->color, "take's colour");
    if (status != OK)
        return status;
    if (take_body(take)->representative_frame < 0)
        return fail(ERR_INPUT, "the take has no measured body, so the actor cannot be drawn; "
                               "record again with the arms once held away from the body");
    struct renderer *p = calloc(1, sizeof *p);
    if (!p)
        return fail(ERR_MEMORY, "no memory for the actor's renderer");
    p->gpu = gpu;
    p->take = take;
    p->lens = p->drawn = *lens;
    p->resolution_scale = 1;
    p->detail = options->detail;
    p->error_px = options->error_px;
    p->may_draw_avatar = detail_needs_avatar(options->detail);
    p->avatar_later = options->avatar_later && p->may_draw_avatar;
    status = options->skeletons ? OK : take_skeletons_open(&p->own_skeletons, take);
    p->skeletons = options->skeletons ? options->skeletons : p->own_skeletons;
    if (status == OK)
        status = skeleton_track_open(&p->motion, take, p->skeletons);
    const size_t bytes = options->texture_bytes / (p->may_draw_avatar ? 2 : 1);
    if (status == OK)
        status = cylinder_renderer_open(&p->cylinders, gpu, take, bytes, p->avatar_later ? FRAMES_FIRST : 0);
    if (status == OK)
        status = open_avatar(p, options);
    if (status == OK)
        status = open_programs(p);
    if (status == OK) // only a place has a floor to cast a shadow on
        status = actor_targets_open(p, options->sources, options->shadow && take_is_located(take));
    if (status != OK) {
        renderer_close(&p);
        return status;
    }
    *out = p;
    return OK;
}

void renderer_close(struct renderer **out)
{
    struct renderer *renderer = *out;
    if (!renderer)
        return;
    avatar_renderer_close(&renderer->avatar);
    source_rays_close(&renderer->rays);
    occlusion_shadow_close(&renderer->occlusion);
    depth_overlay_close(&renderer->overlay);
    gpu_texture_close(&renderer->no_shadow);
    gpu_mesh_close(&renderer->fullscreen);
    actor_targets_close(renderer);
    gpu_program_close(&renderer->compose_program);
    cylinder_renderer_close(&renderer->cylinders);
    skeleton_track_close(&renderer->motion);
    take_skeletons_close(&renderer->own_skeletons);
    free(renderer);
    *out = NULL;
}

// ---------------------------------------------------------------- the actor

// The instant being drawn.
struct draw_state {
    int64_t shown;                // frame
    struct skeleton in_viewer;    // viewer camera's axes
    struct frame_selection whole; // source frame at DETAIL_PAPER
};

static void clear_targets(struct renderer *renderer)
{
    gpu_target_clear(renderer->actor);
    if (renderer->writes_source)
        gpu_target_clear(renderer->source);
    if (renderer->room_depth)
        gpu_target_clear(renderer->room_depth);
    renderer->room_drawn = false;
}

// Clears the targets and draws the depth of the room that may hide the actor.
static void begin_target(struct renderer *renderer, const struct renderer_view *view, const struct draw_state *state)
{
    const struct occlusion_frustum body = occlusion_frustum_body(&state->in_viewer);
    clear_targets(renderer);
    if (view->viewer_from_room)
        occlusion_shadow_set_front_only(renderer->occlusion, view->room_front);
    if (view->viewer_from_room)
        renderer->room_drawn = occlusion_shadow_draw_room(renderer->occlusion, actor_targets_room(renderer),
                                                          view->viewer_from_room, &body);
    if (view->viewer_from_room && renderer->writes_source)
        occlusion_shadow_draw_room(renderer->occlusion, renderer->source, view->viewer_from_room, &body);
}

static void draw_shadow(struct renderer *renderer, const struct renderer_view *view, const struct skeleton *skeleton)
{
    if (!renderer->shadow)
        return;
    const struct occlusion_shadow_view shadow_view = {view->world_from_camera, view->viewer_from_room, skeleton,
                                                      take_body(renderer->take)};
    gpu_target_clear(renderer->shadow);
    occlusion_shadow_draw(renderer->occlusion, renderer->shadow, &shadow_view);
    renderer->shaded = true;
}

// Uploads more of the avatar; once that is complete, warms up one more combination of program and state.
static enum status upload_more(struct renderer *renderer)
{
    if (!avatar_renderer_has_avatar(renderer->avatar) || !avatar_renderer_upload_step(renderer->avatar, UPLOAD_BYTES))
        return OK;
    bool done;
    enum status status =
        avatar_renderer_warm_up(renderer->avatar, renderer->actor,
                                renderer->room_depth ? gpu_target_texture(renderer->room_depth) : NULL, &done);
    if (status == OK && done && renderer->room_depth)
        occlusion_shadow_warm_up(renderer->occlusion, renderer->room_depth);
    renderer->upload_pending = !(status == OK && done);
    return status;
}

// Chooses the level and predicts its error.
static enum status choose_level(struct renderer *renderer, const struct draw_state *state,
                                struct renderer_result *result)
{
    const enum status status = renderer->upload_pending ? upload_more(renderer) : OK;
    const double px_per_m = lod_pixels_per_metre(&renderer->drawn, &state->in_viewer);
    const enum detail finest = renderer->avatar ? DETAIL_FULL : DETAIL_PARTS; // of those that can be drawn
    const double radius_m = lod_body_radius_m(take_body(renderer->take), &state->in_viewer);
    double error_px[DETAIL_LEVELS];
    for (int level = 0; level < DETAIL_LEVELS; level++)
        error_px[level] = px_per_m * lod_outline_error_m((enum detail)level, radius_m, renderer->unseen_share);
    result->level = renderer->detail;
    if (renderer->upload_pending && detail_needs_avatar(result->level))
        result->level = DETAIL_PAPER;
    else if (result->level == DETAIL_AUTO)
        result->level = detail_choose(&renderer->costs, error_px, px_per_m, renderer->error_px, finest);
    else if (result->level > finest)
        result->level = finest;
    result->error_px = error_px[result->level];
    result->share_of_full = detail_share_of_full(&renderer->costs, result->level, px_per_m);
    return status;
}

static enum status draw_cylinders(struct renderer *renderer, const struct draw_state *state,
                                  const struct frame_selection *whole, int *parts)
{
    const struct cylinder_view view = {whole, state->shown, &state->in_viewer, renderer->actor,
                                       renderer->writes_source ? renderer->source : NULL};
    return cylinder_renderer_draw(renderer->cylinders, &view, parts);
}

// At DETAIL_PAPER.
static enum status draw_paper(struct renderer *renderer, struct draw_state *state, struct renderer_result *result)
{
    enum status status = cylinder_renderer_select(renderer->cylinders, &state->in_viewer, &state->whole);
    if (status == OK)
        status = draw_cylinders(renderer, state, &state->whole, &result->parts);
    if (status >= 0)
        result->source = status == OK ? state->whole.frame : -1;
    return status;
}

// At DETAIL_FUSED or DETAIL_FULL.
static enum status draw_avatar(struct renderer *renderer, const struct renderer_view *view,
                               const struct track_sample *moment, struct renderer_result *result)
{
    const bool fused = result->level == DETAIL_FUSED;
    const int64_t resident =
        fused ? -1 : avatar_renderer_nearest_resident(renderer->avatar, moment->frame, view->within_ns);
    const struct avatar_view shown = {
        .frame = resident < 0 ? moment->frame : resident,
        .fused = fused,
        .skeleton = moment->skeleton,
        .world_from_viewer = view->world_from_camera,
        .actor = renderer->actor,
        .source = renderer->writes_source ? renderer->source : NULL,
        .room = renderer->room_drawn && renderer->room_depth ? gpu_target_texture(renderer->room_depth) : NULL};
    int parts;
    const enum status status = avatar_renderer_draw(renderer->avatar, &shown, &parts, &result->within);
    result->parts = status == OK ? parts : 0;
    return status;
}

static enum status draw_actor(struct renderer *renderer, const struct renderer_view *view,
                              struct renderer_result *result)
{
    struct track_sample moment;
    enum status status = skeleton_track_at(renderer->motion, view->time_ns, renderer->detail != DETAIL_PAPER, &moment);
    if (status != OK) {
        clear_targets(renderer);
        return status;
    }
    struct draw_state state = {.shown = moment.frame,
                               .in_viewer =
                                   skeleton_transform(pose_inverse(view->world_from_camera), &moment.skeleton)};
    result->shown = moment.frame;
    status = choose_level(renderer, &state, result);
    if (status != OK)
        return status;
    draw_shadow(renderer, view, &moment.skeleton);
    renderer->avatar_drawn = detail_needs_avatar(result->level);
    begin_target(renderer, view, &state);
    if (renderer->avatar_drawn)
        return draw_avatar(renderer, view, &moment, result);
    return result->level == DETAIL_PAPER ? draw_paper(renderer, &state, result)
                                         : draw_cylinders(renderer, &state, NULL, &result->parts);
}

// ---------------------------------------------------------------- images

static enum status compose_image(struct renderer *renderer, const uint8_t *color)
{
    assert(renderer->drawn.width == renderer->lens.width && renderer->drawn.height == renderer->lens.height);
    gpu_texture_write(renderer->camera, color);
    gpu_draw(
        &(struct gpu_job){.target = renderer->composed,
                          .program = renderer->compose_program,
                          .mesh = renderer->fullscreen,
                          .textures = {renderer->camera, gpu_target_texture(renderer->actor),
                                       renderer->shaded ? gpu_target_texture(renderer->shadow) : renderer->no_shadow}});
    return gpu_check(renderer->gpu);
}

enum status renderer_draw_background(struct renderer *renderer, const uint8_t *color)
{
    renderer->shaded = false;
    clear_targets(renderer);
    return compose_image(renderer, color);
}

enum status renderer_draw(struct renderer *renderer, const struct renderer_view *view, struct renderer_result *result)
{
    *result = (struct renderer_result){.level = renderer->detail,
                                       .share_of_full = NAN,
                                       .shown = -1,
                                       .source = -1,
                                       .width = renderer->drawn.width,
                                       .height = renderer->drawn.height};
    if (!pose_finite(view->world_from_camera))
        return fail(ERR_INPUT, "the camera's pose is not finite");
    renderer->shaded = renderer->stroked = false;
    enum status status = draw_actor(renderer, view, result);
    if (status >= 0 && view->overlay)
        status = actor_overlay_draw(renderer, view);
    if (status < 0)
        return status;
    return view->color ? compose_image(renderer, view->color) : gpu_check(renderer->gpu);
}

void renderer_set_detail(struct renderer *renderer, enum detail detail)
{
    assert(renderer->may_draw_avatar || !detail_needs_avatar(detail));
    renderer->detail = detail;
}

void renderer_set_error(struct renderer *renderer, double error_px) { renderer->error_px = error_px; }

void renderer_set_sources(struct renderer *renderer, bool wanted)
{
    renderer->writes_source = wanted && renderer->source;
}

// ---------------------------------------------------------------- costs

// Sizes at which costs are measured: the actor at these distances. An actor fills an image's height from the nearer
// one.
static const double MEASURED_M[2] = {1.5, 6};

enum { MEASURED_FRAMES = 3 }; // after one that is not timed

static double now_ms(const struct renderer *renderer)
{
    return (double)(gpu_is_software(renderer->gpu) ? clock_process_ns() : clock_now_ns()) * 1e-6;
}

// From the sensor's direction, that far from the person's middle. False: the frame shows no person.
static bool place_measured_view(const struct renderer *renderer, int64_t frame, double away_m,
                                struct renderer_view *view)
{
    const struct take_entry *e = take_entry(renderer->take, frame);
    if (!e->has_skeleton || !(e->skeleton.confidence[JOINT_WAIST] > 0))
        return false;
    const struct vec3 waist = pose_apply(e->world_from_camera, e->skeleton.joint[JOINT_WAIST]);
    const struct vec3 back = quat_rotate(e->world_from_camera.rotation, v3(0, 0, -away_m));
    *view = (struct renderer_view){.world_from_camera = {e->world_from_camera.rotation, v3_add(waist, back)},
                                   .time_ns = e->time_ns - take_entry(renderer->take, 0)->time_ns};
    return true;
}

static enum status time_drawing(struct renderer *renderer, const struct renderer_view *view, double *ms)
{
    struct renderer_result result;
    struct gpu_fence *fence;
    const double began_ms = now_ms(renderer);
    enum status status = renderer_draw(renderer, view, &result);
    if (status >= 0)
        status = gpu_fence_open(&fence, renderer->gpu);
    if (status != OK)
        return status;
    while (!gpu_fence_passed(fence, true))
        ; // a second more
    gpu_fence_close(&fence);
    *ms = now_ms(renderer) - began_ms;
    return gpu_check(renderer->gpu);
}

// One level at one size, from the take's frame `*next` on, which moves behind those that were drawn.
static enum status measure_level(struct renderer *renderer, int size, int64_t *next)
{
    struct detail_costs *costs = &renderer->costs;
    const int64_t frames = take_frame_count(renderer->take);
    double playing = 0, still = INFINITY;
    int timed = -1;
    enum status status = OK;
    for (int64_t tried = 0; tried < frames && timed < MEASURED_FRAMES && status == OK; tried++) {
        struct renderer_view view;
        double first_ms, again_ms = INFINITY;
        if (!place_measured_view(renderer, (*next)++ % frames, MEASURED_M[size], &view))
            continue;
        status = time_drawing(renderer, &view, &first_ms);
        if (status == OK)
            status = time_drawing(renderer, &view, &again_ms);
        if (++timed > 0) {
            playing += first_ms / MEASURED_FRAMES;
            still = fmin(still, again_ms);
        }
    }
    costs->playing_ms[renderer->detail][size] = timed == MEASURED_FRAMES ? playing : INFINITY;
    costs->still_ms[renderer->detail][size] = still;
    return status;
}

enum status renderer_measure_costs(struct renderer *renderer)
{
    const enum detail asked = renderer->detail, finest = renderer_avatar(renderer) ? DETAIL_FULL : DETAIL_PARTS;
    enum status status = OK;
    renderer->costs = (struct detail_costs){0};
    for (int level = 0; level < DETAIL_LEVELS; level++)
        for (int size = 0; size < 2; size++) {
            int64_t next = take_frame_count(renderer->take) / 2 + size * (MEASURED_FRAMES + 1); // all levels the same
            renderer->detail = (enum detail)level;
            renderer->costs.px_per_m[size] = renderer->drawn.fx / MEASURED_M[size];
            renderer->costs.still_ms[level][size] = renderer->costs.playing_ms[level][size] = INFINITY;
            if (status >= 0 && renderer->detail <= finest)
                status = measure_level(renderer, size, &next);
        }
    renderer->detail = asked;
    renderer->costs.measured = status >= 0;
    return status < 0 ? status : OK;
}

const struct detail_costs *renderer_costs(const struct renderer *renderer) { return &renderer->costs; }
