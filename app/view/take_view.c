#include "app/view/take_view.h"

#include "app/state/playback_clock.h"
#include "app/view/avatar_builder.h"
#include "app/view/frame_prefetch.h"
#include "base/clock.h"
#include "reenact/render/actor_renderer.h"
#include "reenact/skeleton/skeleton_track.h"

#include <stdlib.h>
#include <string.h>

struct take_view {
    char *path;
    struct gpu *gpu;
    struct recording *recording;
    struct take *take;
    struct recording *inset_recording; // a second handle: the renderer reads from the first
    struct take *inset_take;
    struct take_skeletons *skeletons;
    struct skeleton_track *track;
    struct renderer *renderer;       // opened with the first drawing, whose lens it needs
    struct avatar_builder *builder;  // NULL: it has finished
    bool has_full, has_room;         // were taken from the builder
    bool drawn;                      // the actor was, once
    bool stood_in;                   // what the sensor saw, for the body; until it is not asked for any more
    bool outdated;                   // another avatar or room was set since the last drawing
    enum detail detail;              // asked for
    enum detail level;               // drawn last
    enum avatar_wanted wanted;       // for what is drawn now
    struct frame_prefetch *prefetch; // NULL: the renderer has no avatar yet
    int64_t next[PREFETCH_MAX];      // frames predicted to be shown
    int next_count;
    struct playback_predictor predictor;
    int64_t awaited, awaited_ns; // the shown frame whose layer is not resident, and since when
    bool substituted;            // another frame's layer stood in for it in the last drawing
    struct lens drawn_lens;
    struct gpu_texture *sources, *inset;
    int64_t inset_frame;
    uint8_t *codes, *colors;                            // scratch for `sources`
    struct overlay_stroke strokes[OVERLAY_STROKES_MAX]; // scratch
    struct overlay_group groups[OVERLAY_GROUPS_MAX];
    struct vec3 pivot, right; // the actor's first position on the floor; the sensor's x axis, horizontal
    struct orbit orbit;
};

// The orbit's initial distance, and what is then visible at that distance: an actor with a hand raised or reached out
// sideways. Chosen by hand.
static const double FARTHEST_M = 3.4, TALL_M = 2.3, WIDE_M = 2.1;
// A frame whose layer is not resident is drawn with another frame's: while playing, always, since waiting for the load
// would stall; when paused, as after a jump along the timeline, for at most AWAIT_NS, which a load usually takes, and
// then drawing waits for it. Chosen by hand.
static const int64_t ANY_NS = INT64_MAX, AWAIT_NS = 300000000;
// The first drawing waits so long for the avatar that the recording keeps, if there is one. Chosen by hand.
static const int64_t KEPT_NS = 300000000;

static void init_orbit(struct take_view *view)
{
    view->orbit = (struct orbit){v3(0, 0, 1), 0, 0.1, 3};
    view->right = v3(1, 0, 0);
    for (int64_t i = 0; i < take_frame_count(view->take); i++) {
        struct track_sample sample;
        const struct take_entry *entry = take_entry(view->take, i);
        int64_t since_ns = entry->time_ns - take_entry(view->take, 0)->time_ns;
        if (!entry->has_skeleton || skeleton_track_at(view->track, since_ns, false, &sample) != OK)
            continue;
        enum joint middle = sample.skeleton.confidence[JOINT_WAIST] > 0 ? JOINT_WAIST : JOINT_NECK;
        struct vec3 body = sample.skeleton.joint[middle];
        struct vec3 from = v3_sub(sample.world_from_camera.translation, body);
        view->pivot = v3(body.x, body.y, 0);
        view->orbit = (struct orbit){body, atan2(from.x, -from.y), 0.12,
                                     fmin(fmax(ORBIT_NEAREST_M, hypot(from.x, from.y)), FARTHEST_M)};
        struct vec3 right = quat_rotate(sample.world_from_camera.rotation, v3(1, 0, 0));
        view->right = v3_unit(v3(right.x, right.y, 0));
        return;
    }
}

enum status take_view_open(struct take_view **out, struct gpu *gpu, const struct take_view_options *options)
{
    const char *path = options->path;
    *out = NULL;
    struct take_view *s = calloc(1, sizeof *s);
    if (!s)
        return fail(ERR_MEMORY, "no memory for the take");
    s->gpu = gpu;
    s->inset_frame = s->awaited = -1;
    s->path = strdup(path);
    enum status status = s->path ? OK : fail(ERR_MEMORY, "no memory for the take");
    if (status == OK)
        status = recording_open(&s->recording, path);
    if (status == OK)
        status = take_open_drawn(&s->take, s->recording, options->take);
    if (status == OK)
        status = recording_open(&s->inset_recording, path);
    if (status == OK)
        status = take_open_shared(&s->inset_take, s->inset_recording, s->take);
    if (status == OK)
        status = take_skeletons_open(&s->skeletons, s->take);
    if (status == OK)
        status = skeleton_track_open(&s->track, s->take, s->skeletons);
    const struct avatar_builder_options how = {path, s->take, options->notify, options->notify_self};
    if (status == OK)
        status = avatar_builder_start(&s->builder, &how);
    if (status != OK) {
        take_view_close(&s);
        return status;
    }
    init_orbit(s);
    *out = s;
    return OK;
}

void take_view_close(struct take_view **out)
{
    struct take_view *view = *out;
    if (!view)
        return;
    avatar_builder_close(&view->builder);
    prefetch_close(&view->prefetch); // before the renderer, whose avatar it uses
    gpu_texture_close(&view->sources);
    gpu_texture_close(&view->inset);
    renderer_close(&view->renderer);
    skeleton_track_close(&view->track);
    take_skeletons_close(&view->skeletons);
    take_close(&view->inset_take);
    recording_free(&view->inset_recording);
    take_close(&view->take);
    recording_free(&view->recording);
    free(view->codes);
    free(view->colors);
    free(view->path);
    free(view);
    *out = NULL;
}

int64_t take_view_frames_decoded(const struct take_view *view) { return take_frames_decoded(view->take); }

int64_t take_view_frames(const struct take_view *view) { return take_frame_count(view->take); }

bool take_view_is_located(const struct take_view *view) { return view && take_is_located(view->take); }

int64_t take_view_length_ns(const struct take_view *view)
{
    return take_entry(view->take, take_view_frames(view) - 1)->time_ns - take_entry(view->take, 0)->time_ns;
}

// Mean time from one recorded frame to the next.
static int64_t frame_step_ns(const struct take_view *view)
{
    int64_t frames = take_view_frames(view);
    return frames > 1 ? take_view_length_ns(view) / (frames - 1) : 1;
}

struct orbit take_view_orbit(const struct take_view *view) { return view->orbit; }

struct lens take_view_orbit_lens(int width, int height, struct ui_box free)
{
    const double f = ORBIT_NEAREST_M * fmax(1, fmin(free.h / TALL_M, free.w / WIDE_M));
    const double x = free.x + free.w / 2 - 0.5, y = free.y + free.h / 2 - 0.5; // (0, 0) is the centre of a pixel
    return (struct lens){width, height, f, f, x, y, 0, 0, 0, 0, 0, 0, 0};
}

// ---------------------------------------------------------------- request

static bool pose_equal(const struct pose *a, const struct pose *b)
{
    const struct quat p = a->rotation, q = b->rotation;
    const struct vec3 s = a->translation, t = b->translation;
    return p.w == q.w && p.x == q.x && p.y == q.y && p.z == q.z && s.x == t.x && s.y == t.y && s.z == t.z;
}

bool take_view_request_equal(const struct take_view_request *a, const struct take_view_request *b)
{
    const struct placement *p = &a->placement, *q = &b->placement;
    return lens_equal(&a->lens, &b->lens) && pose_equal(&a->world_from_camera, &b->world_from_camera) &&
           a->time_ns == b->time_ns && a->playing == b->playing && a->loop == b->loop && p->x_m == q->x_m &&
           p->y_m == q->y_m && p->yaw_rad == q->yaw_rad && p->mirrored == q->mirrored &&
           a->resolution_scale == b->resolution_scale && a->detail == b->detail && a->error_px == b->error_px &&
           a->sources == b->sources && a->inset == b->inset && a->camera_lost == b->camera_lost &&
           a->in_room == b->in_room && a->sensor == b->sensor && a->overlay == b->overlay && a->camera == b->camera &&
           a->camera_number == b->camera_number;
}

// ---------------------------------------------------------------- placement

static struct vec3 reflect_point(const struct take_view *view, struct vec3 p)
{
    return v3_sub(p, v3_scale(view->right, 2 * v3_dot(view->right, v3_sub(p, view->pivot))));
}

// The camera pose in the take's world. Mirrored: of the camera reflected in the mirror plane; its image flipped left to
// right shows the actor mirrored.
static struct pose take_from_camera(const struct take_view *view, const struct take_view_request *request)
{
    struct pose world_from_take = placement_pose(&request->placement, view->pivot);
    struct pose camera = pose_multiply(pose_inverse(world_from_take), request->world_from_camera);
    if (!request->placement.mirrored)
        return camera;
    double m[3][3], r[3][3];
    quat_to_matrix(camera.rotation, m);
    const double n[3] = {view->right.x, view->right.y, view->right.z};
    for (int column = 0; column < 3; column++) {
        double along = 0;
        for (int i = 0; i < 3; i++)
            along += n[i] * m[i][column];
        for (int i = 0; i < 3; i++)
            r[i][column] = (m[i][column] - 2 * n[i] * along) * (column == 0 ? -1 : 1);
    }
    return (struct pose){quat_from_matrix(r), reflect_point(view, camera.translation)};
}

static struct lens lens_for(const struct take_view_request *request)
{
    struct lens l = request->lens;
    if (request->placement.mirrored) {
        l.cx = l.width - 1 - l.cx;
        l.p2 = -l.p2;
    }
    return l;
}

// The request's overlay in the axes of the camera whose image is flipped later where it is mirrored.
static struct overlay place_overlay(struct take_view *view, const struct take_view_request *request)
{
    const struct overlay *from = request->overlay;
    const struct pose camera_from_world = pose_inverse(request->world_from_camera);
    const double sign = request->placement.mirrored ? -1 : 1;
    struct overlay out = {.strokes = view->strokes, .groups = view->groups};
    for (int i = 0; i < from->stroke_count && i < OVERLAY_STROKES_MAX; i++) {
        struct overlay_stroke *to = &view->strokes[out.stroke_count++];
        *to = from->strokes[i];
        to->from = pose_apply(camera_from_world, to->from);
        to->to = pose_apply(camera_from_world, to->to);
        to->from.x *= sign, to->to.x *= sign;
    }
    for (int g = 0; g < from->group_count && g < OVERLAY_GROUPS_MAX; g++) {
        struct overlay_group *to = &view->groups[out.group_count++];
        for (int i = 0; i < OVERLAY_POINTS; i++) {
            to->point[i] = pose_apply(camera_from_world, from->groups[g].point[i]);
            to->point[i].x *= sign;
        }
    }
    return out;
}

static void place_skeleton(const struct take_view *view, const struct take_view_request *request,
                           const struct track_sample *sample, struct take_view_image *out)
{
    struct pose world_from_take = placement_pose(&request->placement, view->pivot);
    out->has_skeleton = true;
    out->frame = sample->frame;
    out->skeleton = sample->skeleton;
    struct vec3 sum = v3(0, 0, 0);
    int feet = 0;
    for (int j = 0; j < JOINT_COUNT; j++) {
        struct vec3 p = sample->skeleton.joint[j];
        p = pose_apply(world_from_take, request->placement.mirrored ? reflect_point(view, p) : p);
        out->skeleton.joint[j] = p;
        bool low = j == JOINT_LEFT_FOOT || j == JOINT_RIGHT_FOOT;
        if (low && sample->skeleton.confidence[j] > 0) {
            sum = v3_add(sum, p);
            feet++;
        }
    }
    out->floor_point = feet ? v3_scale(sum, 1.0 / feet) : out->skeleton.joint[JOINT_WAIST];
    out->floor_point.z = 0;
}

// ---------------------------------------------------------------- images

// Converts the renderer's source codes to colours: green is from the shown frame, blue to violet from frames ever
// farther away in time, orange is inpainted.
static void color_code(const uint8_t code[3], uint8_t rgba[4])
{
    static const uint8_t now[3] = {52, 211, 153}, filled[3] = {251, 146, 60}, recent[3] = {56, 189, 248},
                         distant[3] = {167, 62, 240};
    const int opacity = 205;
    double away_s = (256 * code[1] + code[2]) / 100.0, t = away_s / (away_s + 1);
    for (int c = 0; c < 3; c++) {
        double borrowed = recent[c] + t * (distant[c] - recent[c]);
        double color = filled[c];
        if (code[0] < 40)
            color = 0;
        else if (code[0] < 128)
            color = now[c];
        else if (code[0] < 212)
            color = borrowed;
        rgba[c] = (uint8_t)(color * opacity / 255);
    }
    rgba[3] = code[0] < 40 ? 0 : (uint8_t)opacity;
}

static enum status draw_sources(struct take_view *view, int width, int height, struct take_view_image *out)
{
    size_t pixels = (size_t)width * (size_t)height;
    uint8_t *codes = realloc(view->codes, 3 * pixels);
    view->codes = codes ? codes : view->codes;
    uint8_t *colors = realloc(view->colors, 4 * pixels);
    view->colors = colors ? colors : view->colors;
    if (!codes || !colors)
        return fail(ERR_MEMORY, "no memory for the take");
    enum status status = renderer_read_source(view->renderer, codes);
    if (status != OK)
        return status;
    for (size_t i = 0; i < pixels; i++)
        color_code(codes + 3 * i, colors + 4 * i);
    const struct gpu_texture_layout layout = {GPU_RGBA8, width, height, GPU_LINEAR};
    status = gpu_texture_put(&view->sources, view->gpu, &layout, colors);
    out->sources = view->sources;
    return status;
}

// The sensor's image, into what was asked for.
static enum status upload_inset(struct take_view *view, const struct take_view_request *request, int64_t frame,
                                struct take_view_image *out)
{
    const struct lens *color = &take_calibration(view->inset_take)->color;
    if (frame < 0 || !take_entry(view->inset_take, frame)->has_color)
        return OK;
    if (frame != view->inset_frame) {
        struct take_images images;
        enum status status = take_read(view->inset_take, frame, TAKE_COLOR, &images);
        const struct gpu_texture_layout layout = {GPU_RGB8, color->width, color->height, GPU_LINEAR};
        if (status == OK && images.color)
            status = gpu_texture_put(&view->inset, view->gpu, &layout, images.color);
        if (status != OK && status != ERR_CORRUPT) // a damaged frame costs itself alone
            return status;
        view->inset_frame = frame;
    }
    out->inset = request->inset ? view->inset : NULL;
    out->sensor = view->stood_in ? view->inset : NULL;
    out->inset_aspect = out->sensor_aspect = (double)color->width / color->height;
    return OK;
}

static bool are_lenses_same(const struct lens *a, const struct lens *b) { return !memcmp(a, b, sizeof *a); }

static enum status ensure_renderer(struct take_view *view, const struct lens *lens)
{
    enum status status = OK;
    if (!view->renderer) {
        struct renderer_options options = renderer_default_options();
        options.skeletons = view->skeletons;
        options.detail = DETAIL_AUTO;
        options.sources = options.shadow = options.avatar_later = true;
        status = renderer_open(&view->renderer, view->gpu, view->take, lens, &options);
        if (status == OK && view->builder) {
            avatar_builder_await_kept(view->builder, KEPT_NS);
            status = take_view_adopt_avatar(view);
        }
    } else if (!are_lenses_same(lens, &view->drawn_lens)) {
        status = renderer_set_lens(view->renderer, lens);
    }
    view->drawn_lens = *lens;
    return status;
}

// Nothing whole can be drawn: not yet, or, once the full avatar should be there, never. Who asks for cylinders gets
// them.
static bool lacks_body(const struct take_view *view)
{
    return detail_needs_avatar(view->detail) && !(view->renderer && renderer_avatar(view->renderer));
}

double take_view_progress(const struct take_view *view)
{
    const bool body = view->wanted == AVATAR_WANTED_NONE || (view->wanted == AVATAR_WANTED_SIMPLE && !lacks_body(view));
    const bool awaited = view->builder && !view->has_full && !body;
    return awaited ? avatar_builder_progress(view->builder) : 1;
}

bool take_view_waiting(const struct take_view *view) { return view->substituted; }

// Until the layer is resident nothing better can be drawn, and drawing again would take processor time from its
// loading.
bool take_view_final(const struct take_view *view)
{
    const bool better = view->substituted &&
                        (prefetch_has(view->prefetch, view->awaited) || clock_now_ns() - view->awaited_ns >= AWAIT_NS);
    return !view->renderer || (renderer_upload_done(view->renderer) && !better && !view->outdated);
}

// The prefetch works with the avatar before, so it ends first. The upload of a few megabytes is a hitch of some
// milliseconds; in steps it would show cylinders for many images, also between the simple avatar and the full one.
static enum status adopt_avatar(struct take_view *view, struct avatar *avatar, enum status made)
{
    if (made != OK && !lacks_body(view))
        return made < 0 ? made : OK; // the simple one remains
    prefetch_close(&view->prefetch);
    const enum status given = renderer_set_avatar(view->renderer, made == OK ? avatar : NULL);
    if (given == OK)
        renderer_finish_upload(view->renderer);
    return made < 0 ? made : given;
}

enum status take_view_adopt_avatar(struct take_view *view)
{
    struct avatar avatar;
    struct occluder_mesh occluders;
    enum status made, status = OK;
    if (!view->builder || !view->renderer)
        return OK;
    const enum avatar_news news = avatar_builder_take(view->builder, &avatar, &made);
    if (news != AVATAR_NO_NEWS)
        status = adopt_avatar(view, &avatar, made);
    view->has_full |= news == AVATAR_FULL;
    view->outdated |= news != AVATAR_NO_NEWS;
    if (avatar_builder_take_occluders(view->builder, &occluders)) {
        const enum status occluded = renderer_set_room(view->renderer, &occluders);
        status = status < 0 ? status : occluded;
        view->has_room = view->outdated = true;
    }
    if (view->has_full && view->has_room && avatar_builder_ended(view->builder)) {
        status = status < 0 ? status : avatar_builder_kept(view->builder);
        avatar_builder_close(&view->builder);
    }
    return status;
}

// The frames that the next drawings are predicted to show and the renderer does not hold.
static int predict_frames(struct take_view *view, const struct take_view_request *request, int64_t frames[PREFETCH_MAX])
{
    const struct playback_now now = {.at_ns = request->time_ns,
                                     .length_ns = take_view_length_ns(view),
                                     .frame_ns = frame_step_ns(view),
                                     .playing = request->playing,
                                     .loop = request->loop,
                                     .clock_ns = clock_now_ns(),
                                     .load_ns = prefetch_load_ns(view->prefetch)};
    int64_t at_ns[PREDICTED_MAX];
    int predicted = playback_predict(&view->predictor, &now, at_ns), count = 0;
    for (int i = 0; i < predicted && count < PREFETCH_MAX; i++) {
        struct track_sample sample;
        bool listed = skeleton_track_at(view->track, at_ns[i], false, &sample) != OK ||
                      renderer_nearest_resident_frame(view->renderer, sample.frame, 0) >= 0;
        for (int k = 0; k < count; k++)
            listed |= frames[k] == sample.frame;
        if (!listed)
            frames[count++] = sample.frame;
    }
    return count;
}

// How far in time a resident frame may be from the shown one to stand in for it.
static int64_t frame_tolerance_ns(struct take_view *view, const struct take_view_request *request, int64_t frame)
{
    const int64_t now_ns = clock_now_ns();
    if (request->sources)
        return 0;
    if (request->playing)
        return ANY_NS;
    if (frame != view->awaited)
        view->awaited = frame, view->awaited_ns = now_ns;
    return now_ns - view->awaited_ns < AWAIT_NS ? ANY_NS : 0;
}

// Puts the frame before those wanted already, which are kept: while a user drags along the timeline the shown frame can
// change before a load ends.
static void request_first(struct take_view *view, int64_t frame)
{
    int64_t before[PREFETCH_MAX];
    const int count = view->next_count;
    memcpy(before, view->next, sizeof before);
    view->next[0] = frame;
    view->next_count = 1;
    for (int i = 0; i < count && view->next_count < PREFETCH_MAX; i++)
        if (before[i] != frame && renderer_nearest_resident_frame(view->renderer, before[i], 0) < 0)
            view->next[view->next_count++] = before[i];
}

// Gives loaded layers to the renderer. Waits for the shown frame's only where no resident frame within `within_ns` can
// stand in for it.
static enum status use_prefetched(struct take_view *view, const struct take_view_request *request, int64_t frame,
                                  int64_t within_ns)
{
    const struct avatar *avatar = renderer_avatar(view->renderer);
    const struct frame_prefetch_options options = {view->path, view->take, view->skeletons, avatar};
    struct frame_layer loaded;
    enum status status = OK;
    if (!avatar)
        return OK;
    if (!view->prefetch)
        status = prefetch_start(&view->prefetch, &options);
    while (status == OK && prefetch_take_any(view->prefetch, &loaded))
        status = renderer_add_frame(view->renderer, &loaded);
    if (status != OK)
        return status;
    playback_predictor_report(&view->predictor, renderer_nearest_resident_frame(view->renderer, frame, 0) >= 0);
    if (renderer_nearest_resident_frame(view->renderer, frame, within_ns) < 0 &&
        prefetch_take(view->prefetch, frame, &loaded))
        status = renderer_add_frame(view->renderer, &loaded);
    if (status != OK)
        return status;
    int64_t predicted[PREFETCH_MAX];
    const int count = predict_frames(view, request, predicted);
    view->substituted = !request->playing && renderer_nearest_resident_frame(view->renderer, frame, 0) < 0 &&
                        renderer_nearest_resident_frame(view->renderer, frame, within_ns) >= 0;
    if (view->substituted) {
        request_first(view, frame);
    } else {
        view->next_count = count;
        memcpy(view->next, predicted, sizeof view->next);
    }
    return OK;
}

enum status take_view_read_seen(struct take_view *view, float share[OVERLAY_GROUPS_MAX], int *count)
{
    *count = 0;
    return view->renderer ? renderer_read_seen(view->renderer, share, count) : OK;
}

void take_view_presented(struct take_view *view)
{
    if (view->builder && view->drawn)
        avatar_builder_begin(view->builder, view->wanted);
    if (view->prefetch && view->level == DETAIL_FULL)
        prefetch_request(view->prefetch, view->next, view->next_count);
}

// Pixels as shares of the image, which is flipped later.
static struct ui_uv_rect part_within(const struct renderer_result *drawn, bool flip_x)
{
    const struct gpu_box *box = &drawn->within;
    if (!box->width)
        return (struct ui_uv_rect){0, 0, 1, 1};
    const double left = (double)box->left / drawn->width, right = left + (double)box->width / drawn->width;
    const double top = (double)box->top / drawn->height, bottom = top + (double)box->height / drawn->height;
    return (struct ui_uv_rect){flip_x ? 1 - right : left, top, flip_x ? 1 - left : right, bottom};
}

static void set_body(const struct take_view *view, struct take_view_image *out)
{
    out->making = lacks_body(view) && !view->has_full;
    out->bodiless = lacks_body(view) && view->has_full;
}

// Nothing is prepared that is not seen: from afar the simple avatar's outline is good enough. in_world: the skeleton
// that is shown.
static enum avatar_wanted avatar_wanted_for(const struct take_view_request *request, const struct skeleton *in_world)
{
    if (!detail_needs_avatar(request->detail))
        return AVATAR_WANTED_NONE;
    const struct lens lens = lens_resized(&request->lens, request->resolution_scale);
    const struct skeleton in_viewer = skeleton_transform(pose_inverse(request->world_from_camera), in_world);
    const double error_px = lod_pixels_per_metre(&lens, &in_viewer) * lod_simple_error_m();
    return request->detail == DETAIL_AUTO && error_px <= request->error_px ? AVATAR_WANTED_SIMPLE : AVATAR_WANTED_FULL;
}

static enum status draw_actor(struct take_view *take_view, const struct take_view_request *request, int64_t frame,
                              struct take_view_image *out)
{
    struct lens lens = lens_for(request);
    struct affine_map viewer_from_room = affine_from_pose(pose_inverse(request->world_from_camera));
    for (int i = 0; i < 4 && request->placement.mirrored; i++)
        viewer_from_room.row[0][i] = -viewer_from_room.row[0][i]; // the image is flipped later
    struct renderer_view view = {.world_from_camera = take_from_camera(take_view, request),
                                 .time_ns = request->time_ns,
                                 .viewer_from_room = request->camera || request->in_room
                                                         ? &viewer_from_room
                                                         : NULL, // an empty ground shows none
                                 .room_front = !request->camera,
                                 .within_ns = frame_tolerance_ns(take_view, request, frame)};
    struct renderer_result result;
    struct overlay overlay;
    if (request->overlay) {
        overlay = place_overlay(take_view, request);
        view.overlay = &overlay;
    }
    enum status status = ensure_renderer(take_view, &lens);
    if (status != OK)
        return status;
    renderer_set_resolution_scale(take_view->renderer, request->resolution_scale);
    renderer_set_sources(take_view->renderer, request->sources);
    renderer_set_detail(take_view->renderer, request->detail);
    renderer_set_error(take_view->renderer, request->error_px);
    const bool layered = request->detail == DETAIL_FULL || take_view->level == DETAIL_FULL;
    status = frame >= 0 && layered && request->detail >= DETAIL_FULL
                 ? use_prefetched(take_view, request, frame, view.within_ns)
                 : OK;
    if (status == OK)
        status = renderer_draw(take_view->renderer, &view, &result);
    if (status != OK)
        return status;
    take_view->drawn = true;
    out->actor = renderer_actor_texture(take_view->renderer);
    out->shadow = renderer_shadow_texture(take_view->renderer);
    out->overlay = renderer_overlay_texture(take_view->renderer);
    out->level = take_view->level = result.level;
    out->prepared = detail_needs_avatar(result.level);
    out->full = out->prepared && take_view->has_full;
    out->actor_part = part_within(&result, request->placement.mirrored);
    out->flip_x = request->placement.mirrored;
    out->parts = result.parts;
    set_body(take_view, out);
    if (out->making || out->bodiless) { // parts with gaps between them are no body
        out->actor = out->shadow = NULL;
        out->prepared = out->full = false;
        out->parts = 0;
        return OK;
    }
    return request->sources ? draw_sources(take_view, result.width, result.height, out) : OK;
}

enum status take_view_draw(struct take_view *view, const struct take_view_request *request, struct take_view_image *out)
{
    *out = (struct take_view_image){
        .lens = request->lens, .world_from_camera = request->world_from_camera, .camera = request->camera, .frame = -1};
    enum status status = OK;
    struct track_sample sample;
    bool has_skeleton = skeleton_track_at(view->track, request->time_ns, true, &sample) == OK;
    view->substituted = view->outdated = false;
    view->detail = request->detail;
    if (!request->camera_lost)
        set_body(view, out);
    if (has_skeleton)
        place_skeleton(view, request, &sample, out);
    if (has_skeleton && !request->camera_lost)
        view->wanted = avatar_wanted_for(request, &out->skeleton);
    if (!request->camera_lost)
        status = draw_actor(view, request, has_skeleton ? sample.frame : -1, out);
    view->stood_in = out->making || out->bodiless || (view->stood_in && request->sensor);
    if (status == OK && (request->inset || view->stood_in) && has_skeleton)
        status = upload_inset(view, request, sample.frame, out);
    return status;
}
