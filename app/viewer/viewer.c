#include "app/viewer/viewer.h"

#include "app/ui/view_compositor.h"
#include "app/viewer/take_judge.h"
#include "base/clock.h"
#include "platform/files/file.h"
#include "reenact/render/shaders.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

// Chosen by hand.
static const int64_t CHECK_NS = 1000000000; // interval of looking whether the file is still there
static const int64_t POLL_NS = 4000000;     // interval of looking for frame data that is being loaded
static const int64_t REST_NS = 500000000;   // how long the camera's images must be unneeded before it is closed
static const double EASE_S = 0.07;          // time constant of the free box
static const double MAX_STEP_S = 1 / 30.0;  // a longer time between two frames counts as this

double viewer_px_per_dp(double dpi) { return fmax(dpi / 160, 0.85); } // a desk's screen is farther from the eye

double viewer_px_per_dp_with_text(double px_per_dp, double text_size, int width, int height)
{
    static const double MIN_DP = 376;
    const double max = fmin(width, height) / MIN_DP;
    return fmin(px_per_dp * text_size, fmax(px_per_dp, max));
}

// ---------------------------------------------------------------- opening

static enum status open_recording(struct viewer *viewer)
{
    enum status status = recording_open(&viewer->recording, viewer->options.file);
    if (status == OK)
        status = take_list_open(&viewer->takes, viewer->recording, viewer->options.file);
    if (status == OK && viewer->takes.count == 0)
        status = fail(ERR_MISSING, "%s holds no take. Film one with reenact-capture record.", viewer->options.file);
    if (status != OK)
        return status;
    status = recording_read_map(viewer->recording, &viewer->place);
    viewer->has_place = status == OK && viewer->place.tag_count + viewer->place.point_count > 0;
    return status < 0 && status != ERR_CORRUPT ? status : OK; // a take can be watched without its place
}

static void read_settings(struct viewer *viewer, int64_t now_ns)
{
    struct settings settings = settings_of(&viewer->state);
    settings_keeper_open(&viewer->settings, viewer->options.settings, &settings, viewer->options.light,
                         viewer->options.text_size);
    settings_apply(&settings, &viewer->state, now_ns);
}

static void keep_settings(struct viewer *viewer)
{
    const struct settings now = settings_of(&viewer->state);
    settings_keeper_update(&viewer->settings, &now);
}

static void choose_first_take(struct viewer *viewer, int64_t now_ns)
{
    viewer->state = view_state_start(viewer->takes.count, true, now_ns);
    viewer->state.trim.offered = viewer->options.offer_trim;
    viewer->state.developer = viewer->options.developer;
    read_settings(viewer, now_ns);
    for (int i = 0; viewer->options.take && i < viewer->takes.count; i++)
        if (!strcmp(viewer->takes.cards[i].name, viewer->options.take))
            view_state_choose_take(&viewer->state, i);
    if (viewer->options.take && !viewer->state.take_wanted) {
        fail(ERR_MISSING, "%s has no take named '%s'", viewer->options.file, viewer->options.take);
        snprintf(viewer->trouble, sizeof viewer->trouble, "%s", status_message());
        view_state_fail(&viewer->state, viewer->trouble);
    }
}

enum status viewer_open(struct viewer *v, struct gpu *gpu, const struct viewer_options *options)
{
    *v = (struct viewer){.options = *options, .gpu = gpu};
    const struct gpu_draw2d_shaders shaders = {shader_find("draw2d.vert"), shader_find("draw2d.frag")};
    v->governor = governor_start(1000 / options->refresh_hz);
    enum status status = ui_open(&v->ui, gpu, &shaders, theme_faces(), FACE_COUNT);
    if (status != OK)
        return status;
    int64_t now_ns = clock_now_ns();
    if (options->opening)
        options->opening(options->wake_self);
    status = open_recording(v);
    if (status == ERR_DEVICE || status == ERR_MEMORY)
        return status;
    if (status != OK)
        snprintf(v->trouble, sizeof v->trouble, "%s", status_message());
    choose_first_take(v, now_ns);
    if (options->sensor)
        v->state.live = live_state_start(options->camera);
    v->state.live.mirrored = options->mirrored;
    if (status != OK)
        view_state_fail(&v->state, v->trouble);
    status = viewer_room_open(v);
    if (status != OK)
        return status;
    if (!options->camera)
        return OK;
    status = camera_texture_open(&v->camera_texture, gpu);
    if (status != OK)
        return status;
    const struct camera_feed_options feed = {options->camera, v->has_place ? &v->place : NULL, options->wake,
                                             options->wake_self, camera_texture_can_import(v->camera_texture)};
    return camera_feed_open(&v->feed, &feed);
}

void viewer_close(struct viewer *viewer)
{
    camera_texture_close(&viewer->camera_texture);
    camera_feed_close(&viewer->feed);
    viewer_live_close(viewer);
    viewer_room_close(viewer);
    take_view_close(&viewer->take_view);
    take_judge_close(&viewer->judge);
    take_list_close(&viewer->takes);
    place_free(&viewer->place);
    recording_free(&viewer->recording);
    ui_close(&viewer->ui);
    *viewer = (struct viewer){0};
}

static void open_take(struct viewer *viewer, int64_t now_ns)
{
    const char *name = viewer->takes.cards[viewer->state.take].name;
    take_view_close(&viewer->take_view);
    viewer->has_image = false;
    const struct take_view_options options = {viewer->options.file, name, viewer->options.wake,
                                              viewer->options.wake_self};
    enum status status = take_view_open(&viewer->take_view, viewer->gpu, &options);
    if (status == OK && viewer->options.sensor)
        status = viewer_live_open_take(viewer, name);
    if (status != OK) {
        snprintf(viewer->trouble, sizeof viewer->trouble, "%s", status_message());
        view_state_fail(&viewer->state, viewer->trouble);
        return;
    }
    struct orbit orbit = take_view_orbit(viewer->take_view);
    view_state_open_take(&viewer->state, take_view_length_ns(viewer->take_view), take_view_frames(viewer->take_view),
                         &orbit, now_ns);
    viewer->state.placement.mirrored = viewer->options.mirrored;
}

// ---------------------------------------------------------------- time

static void update_camera(struct viewer *viewer, int64_t now_ns)
{
    struct view_camera camera = {.requested = viewer->feed,
                                 .has_place = viewer->has_place,
                                 .has_tags = viewer->place.tag_count > 0,
                                 .take_located = !viewer->take_view || take_view_is_located(viewer->take_view),
                                 .trouble = ""};
    if (viewer->feed) {
        const struct camera_frame *frame = viewer->frame = camera_feed_latest(viewer->feed);
        viewer->feed_state = camera_feed_query(viewer->feed);
        camera.seeing = viewer->feed_state.seeing || viewer->camera_rests;
        camera.received_ns = viewer->camera_rests ? now_ns : viewer->feed_state.received_ns;
        camera.frame = frame ? frame->number : 0;
        camera.placed = frame && frame->placed;
        camera.moved_tags = frame ? frame->moved_tags : 0;
        camera.first_moved = frame ? frame->first_moved : -1;
        camera.trouble = viewer->feed_state.trouble;
    }
    view_state_on_camera(&viewer->state, &camera, now_ns);
}

// The camera is not read while its images would change nothing: while the user walks round by hand, while the take is
// paused and the last image has its pose (that image then stays), and on live screens that do not show them.
static void rest_camera(struct viewer *viewer, int64_t now_ns)
{
    const struct view_state *s = &viewer->state;
    const bool paused = !s->playback.playing && !s->scrubbing && viewer->frame && viewer->frame->placed;
    const bool live = s->page == PAGE_LIVE && (s->live.screen != LIVE_ROOM || s->live.phase == LIVE_SUMMARY);
    const bool unneeded =
        live || (s->page == PAGE_WATCH && viewer->take_view && (s->orbit_requested || paused) && !s->moving);
    if (!viewer->feed)
        return;
    if (!unneeded)
        viewer->camera_unneeded_ns = 0;
    else if (!viewer->camera_unneeded_ns)
        viewer->camera_unneeded_ns = now_ns;
    const bool rest = unneeded && now_ns - viewer->camera_unneeded_ns >= REST_NS;
    if (rest != viewer->camera_rests && !viewer->suspended)
        camera_feed_suspend(viewer->feed, rest);
    viewer->camera_rests = rest;
}

static void apply_gesture(struct viewer *viewer, int64_t now_ns)
{
    struct gesture g = gesture_take(&viewer->input.gesture);
    double wheel = viewer->input.wheel;
    viewer->input.wheel = 0;
    const struct ui_point at = {viewer->input.pointer_x, viewer->input.pointer_y};
    if (wheel != 0 && viewer->state.page == PAGE_TAKES)
        screen_takes_wheel(&viewer->screens, wheel);
    if (wheel != 0 && screens_wheel(&viewer->screens, &viewer->state, at, wheel))
        wheel = 0;
    const bool on_map = viewer->state.page == PAGE_WATCH && viewer->state.room.map && viewer->screens.map_held;
    if (wheel != 0 && !on_map)
        view_state_wheel(&viewer->state, wheel, now_ns);
    const double shorter = fmin(ui_width(viewer->ui), ui_height(viewer->ui));
    if (on_map) {
        g.drag_x /= shorter, g.drag_y /= shorter, g.push_x /= shorter, g.push_y /= shorter;
        if (wheel != 0 || viewer->input.pointer_down)
            view_state_map_gesture(&viewer->state, &g, wheel, now_ns);
        return;
    }
    if (!viewer->screens.image_held || !viewer->has_image)
        return;
    struct ui_box all = layout_of(ui_width(viewer->ui), ui_height(viewer->ui), &viewer->state, &viewer->image).picture;
    struct cover cover = cover_of(&viewer->image.lens, all);
    struct vec3 from, to;
    double x = viewer->input.pointer_x, y = viewer->input.pointer_y, by_x = g.drag_x + g.push_x,
           by_y = g.drag_y + g.push_y;
    struct floor_drag drag;
    bool floor = cover_floor(&viewer->image, cover, (struct ui_point){x - by_x, y - by_y}, &from) &&
                 cover_floor(&viewer->image, cover, (struct ui_point){x, y}, &to);
    if (floor)
        drag = (struct floor_drag){from.x, from.y, to.x, to.y};
    g.drag_x /= all.h, g.drag_y /= all.h, g.push_x /= all.h, g.push_y /= all.h;
    view_state_gesture(&viewer->state, &g, floor ? &drag : NULL, now_ns);
}

// The progress of building the avatar, and why it failed if it did.
static void update_take_view(struct viewer *viewer, int64_t now_ns)
{
    if (!viewer->take_view)
        return;
    if (take_view_adopt_avatar(viewer->take_view) != OK)
        view_state_warn(&viewer->state, status_message(), now_ns);
    view_state_set_progress(&viewer->state, take_view_progress(viewer->take_view));
    viewer->state.changed |= !take_view_final(viewer->take_view);
}

// A removed recording plays on, for it is open; a sentence says so.
static void check_file(struct viewer *viewer, int64_t now_ns)
{
    if (now_ns - viewer->checked_ns < CHECK_NS || !viewer->take_view)
        return;
    viewer->checked_ns = now_ns;
    bool gone = !file_exists(viewer->options.file);
    if (gone)
        snprintf(viewer->problem, sizeof viewer->problem, "%.200s was removed; it can be watched until it is closed",
                 viewer->takes.file);
    view_state_set_problem(&viewer->state, gone ? viewer->problem : NULL);
}

void viewer_suspend(struct viewer *viewer, bool suspend, int64_t now_ns)
{
    if (suspend == viewer->suspended)
        return;
    viewer->suspended = suspend;
    if (viewer->feed)
        camera_feed_suspend(viewer->feed, suspend || viewer->camera_rests);
    viewer_live_suspend(viewer, suspend);
    if (suspend)
        viewer->suspended_ns = now_ns;
    else
        view_state_resume(&viewer->state, viewer->suspended_ns, now_ns);
}

int64_t viewer_update(struct viewer *viewer, int64_t now_ns)
{
    struct view_state *s = &viewer->state;
    update_camera(viewer, now_ns);
    rest_camera(viewer, now_ns);
    apply_gesture(viewer, now_ns);
    bool sticks = input_map_pad(&viewer->input, s, fmin((double)(now_ns - viewer->pad_ns) * 1e-9, 0.1), now_ns);
    viewer->pad_ns = now_ns;
    if (s->take_wanted)
        open_take(viewer, now_ns);
    const bool cards_left = viewer_takes_update(viewer);
    check_file(viewer, now_ns);
    update_take_view(viewer, now_ns);
    viewer_live_update(viewer, now_ns);
    viewer_room_update(viewer, now_ns);
    keep_settings(viewer);
    int64_t next_ns = view_state_tick(s, now_ns);
    viewer_live_after_tick(viewer, now_ns);
    int64_t check_ns = viewer->checked_ns + CHECK_NS;
    if (s->page == PAGE_WATCH && viewer->take_view && check_ns < next_ns)
        next_ns = check_ns;
    if (s->page == PAGE_WATCH && viewer->take_view && take_view_waiting(viewer->take_view) &&
        now_ns + POLL_NS < next_ns)
        next_ns = now_ns + POLL_NS;
    if (s->page == PAGE_WATCH && viewer->take_view && !take_view_final(viewer->take_view))
        next_ns = now_ns;
    if (s->page == PAGE_WATCH && s->sheet == SHEET_CARD)
        next_ns = now_ns; // the thing turns
    if (viewer->camera_unneeded_ns && !viewer->camera_rests && viewer->camera_unneeded_ns + REST_NS < next_ns)
        next_ns = viewer->camera_unneeded_ns + REST_NS;
    return sticks || cards_left ? now_ns : next_ns;
}

// ---------------------------------------------------------------- drawing

static bool pose_equal(const struct pose *a, const struct pose *b)
{
    const struct quat p = a->rotation, q = b->rotation;
    const struct vec3 s = a->translation, t = b->translation;
    return p.w == q.w && p.x == q.x && p.y == q.y && p.z == q.z && s.x == t.x && s.y == t.y && s.z == t.z;
}

bool view_request_equal(const struct take_view_request *a, const struct take_view_request *b)
{
    const struct placement *p = &a->placement, *q = &b->placement;
    return lens_equal(&a->lens, &b->lens) && pose_equal(&a->world_from_camera, &b->world_from_camera) &&
           a->time_ns == b->time_ns && a->playing == b->playing && a->loop == b->loop && p->x_m == q->x_m &&
           p->y_m == q->y_m && p->yaw_rad == q->yaw_rad && p->mirrored == q->mirrored &&
           a->resolution_scale == b->resolution_scale && a->error_px == b->error_px && a->sources == b->sources &&
           a->inset == b->inset && a->camera_lost == b->camera_lost && a->in_room == b->in_room &&
           a->sensor == b->sensor && a->overlay == b->overlay && a->camera == b->camera &&
           a->camera_number == b->camera_number;
}

// The part of the screen that the controls leave free.
static struct ui_box free_box(const struct viewer *viewer, const struct viewer_surface *surface)
{
    return layout_of(surface->width / surface->px_per_dp, surface->height / surface->px_per_dp, &viewer->state,
                     &viewer->image)
        .free;
}

static double box_difference(struct ui_box a, struct ui_box b)
{
    return fmax(fmax(fabs(a.x - b.x), fabs(a.y - b.y)), fmax(fabs(a.w - b.w), fabs(a.h - b.h)));
}

// Moves the orbit's free box towards what the controls leave free now: exponentially, with time constant EASE_S.
static void ease_free_box(struct viewer *viewer, const struct viewer_surface *surface, int64_t now_ns)
{
    const struct ui_box to = free_box(viewer, surface), from = viewer->free;
    const double passed_s = fmin((double)(now_ns - viewer->eased_ns) * 1e-9, MAX_STEP_S);
    const double share = 1 - exp(-fmax(passed_s, 0) / EASE_S);
    viewer->eased_ns = now_ns;
    viewer->free = (struct ui_box){from.x + share * (to.x - from.x), from.y + share * (to.y - from.y),
                                   from.w + share * (to.w - from.w), from.h + share * (to.h - from.h)};
    if (!viewer->has_image || box_difference(viewer->free, to) < 0.5)
        viewer->free = to;
}

static struct take_view_request make_request(struct viewer *viewer, const struct viewer_surface *surface,
                                             int64_t now_ns)
{
    struct view_state *s = &viewer->state;
    const struct camera_frame *frame = s->orbiting ? NULL : viewer->frame;
    struct take_view_request request = {
        .playing = s->playback.playing,
        .loop = s->playback.loop,
        .placement = s->placement,
        .resolution_scale = viewer->options.fixed_resolution ? 1 : governor_scale(&viewer->governor),
        .error_px = s->error_px,
        .sources = s->sources,
        .inset = s->inset,
        .sensor = s->crossfade < 1,
    };
    if (frame) {
        request.lens = frame->lens;
        request.camera = camera_texture_current(viewer->camera_texture);
        request.camera_number = frame->number;
        request.time_ns = playback_at(&s->playback, frame->received_ns); // at the instant of this image
        // Without a pose, the actor fades at the last known one.
        if (frame->placed)
            viewer->last_placed = frame->world_from_camera;
        request.world_from_camera = viewer->last_placed;
        request.camera_lost = !s->ever_placed || s->presence <= 0;
        return request;
    }
    const double px = surface->px_per_dp;
    const struct ui_box free = {viewer->free.x * px, viewer->free.y * px, viewer->free.w * px, viewer->free.h * px};
    const struct ui_box picture = layout_of(surface->width / px, surface->height / px, s, &viewer->image).picture;
    request.lens = take_view_orbit_lens((int)(picture.w * px + 0.5), (int)(picture.h * px + 0.5), free);
    request.in_room = (viewer->image.filmed || viewer->image.surface) && viewer_room_wants_filmed(viewer);
    request.time_ns = playback_at(&s->playback, now_ns);
    request.world_from_camera = orbit_world_from_camera(&s->orbit);
    return request;
}

// From the hips: where the front is.
static void note_facing(struct viewer *viewer)
{
    const struct skeleton *skeleton = &viewer->image.skeleton;
    if (!viewer->image.has_skeleton ||
        !(skeleton->confidence[JOINT_LEFT_HIP] > 0 && skeleton->confidence[JOINT_RIGHT_HIP] > 0))
        return;
    const struct vec3 across = v3_sub(skeleton->joint[JOINT_LEFT_HIP], skeleton->joint[JOINT_RIGHT_HIP]);
    const double left = viewer->state.placement.mirrored ? -1 : 1; // the joints keep their names
    if (hypot(across.x, across.y) > 0.02)
        view_state_set_facing(&viewer->state, atan2(left * across.y, left * across.x));
}

// Moves the orbit's centre with the actor.
static void follow_actor(struct viewer *viewer)
{
    struct view_state *s = &viewer->state;
    note_facing(viewer);
    if (!s->orbiting || s->moving || !viewer->image.has_skeleton ||
        !(viewer->image.skeleton.confidence[JOINT_WAIST] > 0))
        return;
    const struct vec3 waist = viewer->image.skeleton.joint[JOINT_WAIST];
    if (v3_distance(s->orbit.centre, waist) < 0.002)
        return;
    s->orbit.centre = v3_mix(s->orbit.centre, waist, s->playback.playing ? 0.05 : 0.25);
    s->changed = true;
}

// Puts the camera frame's image into the texture, once.
static enum status upload_camera_frame(struct viewer *viewer)
{
    if (!viewer->frame || viewer->frame->number == viewer->uploaded_number)
        return OK;
    struct dmabuf_image *dmabuf = camera_feed_take_dmabuf(viewer->feed);
    enum status status = camera_texture_update(viewer->camera_texture, viewer->frame, &dmabuf);
    viewer->uploaded_number = status == OK ? viewer->frame->number : 0;
    return status;
}

// A frame that cannot be read is said, and costs itself alone: others may be readable.
static enum status forgive_frame(struct viewer *viewer, enum status status, int64_t now_ns)
{
    if (status != ERR_CORRUPT && status != ERR_IO && status != ERR_INPUT)
        return status;
    view_state_warn(&viewer->state, status_message(), now_ns);
    return OK;
}

static void set_room(struct take_view_image *to, const struct take_view_image *from)
{
    to->filmed = from->filmed;
    to->surface = from->surface;
    to->room_low = from->room_low;
    to->room_high = from->room_high;
}

static enum status draw_take(struct viewer *viewer, const struct viewer_surface *surface, int64_t now_ns)
{
    enum status status = viewer->state.orbiting ? OK : upload_camera_frame(viewer);
    if (status == OK)
        status = viewer_room_read_seen(viewer);
    if (status != OK)
        return status;
    ease_free_box(viewer, surface, now_ns);
    struct take_view_request request = make_request(viewer, surface, now_ns);
    const struct gpu_texture *filmed;
    status = viewer_room_draw_filmed(viewer, &request, now_ns, &filmed);
    if (status != OK)
        return status;
    struct take_view_image room = {.filmed = filmed};
    status = viewer_room_draw_surface(viewer, &request, &room);
    if (status != OK)
        return status;
    set_room(&viewer->image, &room);
    viewer_room_ask_seen(viewer, &request);
    if (viewer->has_image && view_request_equal(&request, &viewer->request) && take_view_final(viewer->take_view))
        return OK; // nothing has changed
    bool steady = viewer->has_image;
    viewer->request = request;
    viewer->has_image = true;
    status = take_view_draw(viewer->take_view, &request, &viewer->image);
    set_room(&viewer->image, &room);
    viewer->room.seen_comes = status == OK && request.overlay;
    // The answer is read with the next drawing, which comes by itself while images follow one another.
    viewer->state.changed |= viewer->room.seen_comes && !(request.camera && request.playing);
    view_state_set_avatar_shown(&viewer->state, viewer->image.prepared);
    viewer->state.changed |= request.camera == NULL && box_difference(viewer->free, free_box(viewer, surface)) > 0;
    if (steady)
        follow_actor(viewer);
    return forgive_frame(viewer, status, now_ns);
}

// The actor and what the live screens draw from. The camera's image only where they are in the room.
static enum status draw_live(struct viewer *viewer, const struct viewer_surface *surface, int64_t now_ns)
{
    const struct live_state *l = &viewer->state.live;
    const bool room = l->screen == LIVE_ROOM && l->phase != LIVE_SUMMARY && !viewer->state.orbiting && viewer->frame;
    enum status status = room ? upload_camera_frame(viewer) : OK;
    if (status != OK)
        return status;
    struct take_view_request request = make_request(viewer, surface, now_ns);
    if (!room)
        viewer_live_request(viewer, surface, &request);
    status = viewer_live_draw(viewer, surface, &request);
    viewer->has_image = true;
    view_state_set_avatar_shown(&viewer->state, viewer->image.prepared);
    return forgive_frame(viewer, status, now_ns);
}

static enum status draw_screen(struct viewer *viewer, int64_t now_ns)
{
    const struct brush brush = {viewer->ui, theme_of(viewer->state.dark), NULL};
    if (viewer->state.page == PAGE_TAKES) {
        const struct takes_page page = {viewer->takes.file, viewer->takes.cards, viewer->takes.count};
        screen_takes(&brush, &viewer->screens, &viewer->state, &page, now_ns);
    } else if (viewer->state.page == PAGE_TROUBLE || !viewer->take_view) {
        screen_trouble(&brush, &viewer->state, now_ns);
    } else if (viewer->state.page == PAGE_LIVE && viewer->state.live.phase == LIVE_SUMMARY) {
        screen_summary(&brush, &viewer->screens, &viewer->state, &viewer->live.page, now_ns);
    } else if (viewer->state.page == PAGE_LIVE) {
        screen_live(&brush, &viewer->screens, &viewer->state, &viewer->live.page, now_ns);
    } else {
        const struct watch_page page = {viewer->takes.file,
                                        viewer->takes.cards[viewer->state.take].name,
                                        &viewer->image,
                                        &viewer->times,
                                        viewer->governor.budget_ms,
                                        &viewer->room.page};
        screen_watch(&brush, &viewer->screens, &viewer->state, &page, now_ns);
    }
    screen_message(&brush, &viewer->state);
    return OK;
}

static enum status take_screenshot(struct viewer *viewer, int64_t now_ns)
{
    const struct brush brush = {viewer->ui, theme_of(viewer->state.dark), NULL};
    char path[600], notice[160];
    viewer->state.screenshot_wanted = false;
    enum status status = screenshot_path(viewer->options.photos, path, sizeof path);
    if (status == OK)
        status = screenshot_take(&brush, viewer->gpu, &viewer->image, &viewer->state, path);
    if (status == ERR_DEVICE)
        return status;
    const char *name = strrchr(path, '/');
    snprintf(notice, sizeof notice, "%s%.120s", status == OK ? "Saved " : "",
             status == OK ? name + 1 : status_message());
    if (status == OK)
        view_state_notify(&viewer->state, notice, now_ns);
    else
        view_state_warn(&viewer->state, notice, now_ns);
    return OK;
}

static struct ui_input input_of(const struct viewer *viewer, const struct viewer_surface *surface, int64_t now_ns)
{
    return (struct ui_input){
        surface->width,          surface->height,         surface->px_per_dp,         now_ns,
        viewer->input.pointer_x, viewer->input.pointer_y, viewer->input.pointer_down, viewer->input.pointer_there};
}

enum status viewer_draw_opening(struct viewer *v, const struct viewer_surface *surface)
{
    const struct ui_input input = input_of(v, surface, clock_now_ns());
    const struct brush brush = {v->ui, theme_of(!v->options.light), NULL};
    const char *slash = strrchr(v->options.file, '/');
    enum status status = ui_begin(v->ui, &input);
    if (status != OK)
        return status;
    screen_opening(&brush, slash ? slash + 1 : v->options.file);
    ui_end(v->ui);
    return ui_draw(v->ui, surface->target, surface->quarter_turns);
}

enum status viewer_draw(struct viewer *v, const struct viewer_surface *surface, int64_t now_ns)
{
    struct view_state *s = &v->state;
    const int page = (int)s->page; // a control that is touched while it is drawn may lead to another
    enum status status = OK;
    v->drawing_ns = clock_now_ns();
    s->changed = false;
    if (s->page == PAGE_WATCH && v->take_view)
        status = draw_take(v, surface, now_ns);
    else if (s->page == PAGE_LIVE && v->take_view)
        status = draw_live(v, surface, now_ns);
    if (status == OK && s->page == PAGE_WATCH && v->take_view)
        status = viewer_room_draw(v, surface, now_ns);
    if (status == OK && s->screenshot_wanted && v->take_view)
        status = take_screenshot(v, now_ns);
    if (status != OK)
        return status;
    v->drawn_ns = clock_now_ns();
    const struct ui_input input = input_of(v, surface, now_ns);
    status = ui_begin(v->ui, &input);
    if (status != OK)
        return status;
    status = draw_screen(v, now_ns);
    ui_end(v->ui);
    if (status == OK)
        status = ui_draw(v->ui, surface->target, surface->quarter_turns);
    s->changed |= v->input.leaving || ui_letters_wanted(v->ui) || ui_comes_to_rest(v->ui);
    input_map_frame_done(&v->input, page);
    v->controls_ns = clock_now_ns();
    double took_ms = (double)(v->controls_ns - v->drawing_ns) * 1e-6;
    if (s->page == PAGE_WATCH && s->playback.playing && governor_update(&v->governor, took_ms))
        s->changed = true;
    return status;
}

bool viewer_event(struct viewer *viewer, const struct window_event *event, double px_per_dp, int64_t now_ns)
{
    if (input_map_is_meant(&viewer->input, (int)viewer->state.page, event))
        return input_map_event(&viewer->input, &viewer->state, event, px_per_dp, now_ns);
    input_map_forget(&viewer->input);
    return false;
}

void viewer_presented(struct viewer *viewer, int64_t now_ns)
{
    const struct camera_frame *frame = viewer->state.orbiting ? NULL : viewer->frame;
    double ms[FRAME_STAGES] = {0};
    if (viewer->take_view)
        take_view_presented(viewer->take_view);
    if (viewer->feed)
        camera_feed_presented(viewer->feed);
    viewer_live_presented(viewer, now_ns);
    if (viewer->state.page != PAGE_WATCH || (frame && frame->number == viewer->timed_frame))
        return;
    if (frame) {
        viewer->timed_frame = frame->number;
        viewer->placed += frame->placed && viewer->image.parts > 0;
        ms[FRAME_LOCATE] = (double)(frame->located_ns - frame->locating_ns) * 1e-6;
        ms[FRAME_WAIT] =
            (double)(frame->locating_ns - frame->received_ns + viewer->drawing_ns - frame->located_ns) * 1e-6;
    }
    ms[FRAME_ACTOR] = (double)(viewer->drawn_ns - viewer->drawing_ns) * 1e-6;
    ms[FRAME_CONTROLS] = (double)(viewer->controls_ns - viewer->drawn_ns) * 1e-6;
    ms[FRAME_SHOW] = (double)(now_ns - viewer->controls_ns) * 1e-6;
    frame_times_add(&viewer->times, ms);
}
