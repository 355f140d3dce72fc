#include "app/viewer/viewer.h"

#include "app/ui/input_map.h"
#include "app/ui/screen_live.h"
#include "app/ui/view_compositor.h"
#include "app/viewer/settings.h"
#include "app/viewer/take_judge.h"
#include "app/viewer/viewer_inside.h"
#include "app/viewer/viewer_parts.h"
#include "base/clock.h"
#include "platform/files/file.h"
#include "reenact/render/shaders.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

// Chosen by hand.
static const int64_t CHECK_NS = 1000000000; // interval of looking whether the file is still there
static const int64_t CARDS_NS = 50000000;   // how long one update may complete cards of the list
static const int64_t POLL_NS = 4000000;     // interval of looking for frame data that is being loaded
static const double EASE_S = 0.07;          // time constant of the free box
static const double MAX_STEP_S = 1 / 30.0;  // a longer time between two frames counts as this

struct viewer {
    struct viewer_shared shared;
    struct ui *ui;
    struct input_map input;
    struct take_judge *judge; // of takes whose file keeps no verdict; NULL: there was none yet
    struct viewer_camera *camera;
    struct viewer_live *live;
    struct viewer_room *room;

    // the picture
    struct take_view_request request; // what shared.image was drawn for
    struct pose last_placed;
    struct ui_box free; // dp: where an orbit shows the actor; moves smoothly to what the controls leave free
    int64_t eased_ns;   // when `free` last moved
    struct resolution_governor governor;

    // what was shown
    struct frame_times times;
    int64_t drawing_ns, drawn_ns, controls_ns; // when the last frame's stages began and ended
    int64_t timed_frame;                       // camera_frame.number of the last one in `times`
    int64_t placed;                            // frames drawn with the actor at a known camera pose
    int presented_page;

    char trouble[512], problem[300];
    struct settings_keeper settings;
    int64_t checked_ns, pad_ns; // when the file was looked for, and the game pad's sticks applied
    bool suspended;
    int64_t suspended_ns; // when it was suspended
};

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
    enum status status = recording_open(&viewer->shared.recording, viewer->shared.options.file);
    if (status == OK)
        status = take_list_open(&viewer->shared.takes, viewer->shared.recording, viewer->shared.options.file);
    if (status == OK && viewer->shared.takes.count == 0)
        status =
            fail(ERR_MISSING, "%s holds no take. Film one with reenact-capture record.", viewer->shared.options.file);
    if (status != OK)
        return status;
    status = recording_read_map(viewer->shared.recording, &viewer->shared.place);
    viewer->shared.has_place = status == OK && viewer->shared.place.tag_count + viewer->shared.place.point_count > 0;
    return status < 0 && status != ERR_CORRUPT ? status : OK; // a take can be watched without its place
}

// The other recording of two that are compared.
static enum status open_other(struct viewer *viewer)
{
    struct viewer_shared *shared = &viewer->shared;
    const char *with = shared->options.compare_with;
    if (!with || file_is_same(with, shared->options.file))
        return OK;
    enum status status = recording_open(&shared->other, with);
    if (status == OK)
        status = take_list_open(&shared->attempts, shared->other, with);
    if (status == OK && !shared->attempts.count)
        status = fail(ERR_MISSING, "%s holds no take. Film one first.", with);
    return status;
}

static void read_settings(struct viewer *viewer, int64_t now_ns)
{
    struct settings settings = settings_of(&viewer->shared.state);
    settings_keeper_open(&viewer->settings, viewer->shared.options.settings, &settings, viewer->shared.options.light,
                         viewer->shared.options.text_size);
    if (viewer->shared.options.detail_given)
        settings.detail = viewer->settings.kept.detail = viewer->shared.options.detail;
    settings_apply(&settings, &viewer->shared.state, now_ns);
}

static void keep_settings(struct viewer *viewer)
{
    const struct settings now = settings_of(&viewer->shared.state);
    settings_keeper_update(&viewer->settings, &now);
}

static void choose_first_take(struct viewer *viewer, int64_t now_ns)
{
    viewer->shared.state = view_state_start(viewer->shared.takes.count, true, now_ns);
    viewer->shared.state.trim.offered = viewer->shared.options.offer_trim;
    viewer->shared.state.developer = viewer->shared.options.developer;
    viewer->shared.state.fullscreen = viewer->shared.options.fullscreen;
    read_settings(viewer, now_ns);
    for (int i = 0; viewer->shared.options.take && i < viewer->shared.takes.count; i++)
        if (!strcmp(viewer->shared.takes.cards[i].name, viewer->shared.options.take))
            view_state_choose_take(&viewer->shared.state, i);
    if (viewer->shared.options.take && !viewer->shared.state.take_wanted) {
        fail(ERR_MISSING, "%s has no take named '%s'", viewer->shared.options.file, viewer->shared.options.take);
        snprintf(viewer->trouble, sizeof viewer->trouble, "%s", status_message());
        view_state_fail(&viewer->shared.state, viewer->trouble);
    }
}

static enum status open_parts(struct viewer *viewer)
{
    enum status status = viewer_room_open(&viewer->room, &viewer->shared);
    if (status == OK)
        status = viewer_live_open(&viewer->live, &viewer->shared);
    return status == OK ? viewer_camera_open(&viewer->camera, &viewer->shared) : status;
}

static enum status open_viewer(struct viewer *viewer)
{
    const struct viewer_options *options = &viewer->shared.options;
    const struct gpu_draw2d_shaders shaders = {shader_find("draw2d.vert"), shader_find("draw2d.frag")};
    viewer->governor = governor_start(1000 / options->refresh_hz);
    enum status status = ui_open(&viewer->ui, viewer->shared.gpu, &shaders, theme_faces(), FACE_COUNT);
    if (status != OK)
        return status;
    int64_t now_ns = clock_now_ns();
    if (options->opening)
        options->opening(options->wake_self);
    status = open_recording(viewer);
    if (status == OK)
        status = open_other(viewer);
    if (status == ERR_DEVICE || status == ERR_MEMORY)
        return status;
    if (status != OK)
        snprintf(viewer->trouble, sizeof viewer->trouble, "%s", status_message());
    choose_first_take(viewer, now_ns);
    if (options->sensor)
        viewer->shared.state.live = live_state_start(options->camera);
    viewer->shared.state.live.mirrored = options->mirrored;
    if (options->compare_with && status == OK)
        view_state_compare(&viewer->shared.state, viewer->shared.attempts.count);
    if (status != OK)
        view_state_fail(&viewer->shared.state, viewer->trouble);
    return open_parts(viewer);
}

enum status viewer_open(struct viewer **out, struct gpu *gpu, const struct viewer_options *options)
{
    struct viewer *v = *out = calloc(1, sizeof *v);
    if (!v)
        return fail(ERR_MEMORY, "no memory for the viewer");
    v->shared.options = *options;
    v->shared.gpu = gpu;
    const enum status status = open_viewer(v);
    if (status != OK)
        viewer_close(out);
    return status;
}

void viewer_close(struct viewer **viewer)
{
    struct viewer *v = *viewer;
    if (!v)
        return;
    viewer_camera_close(&v->camera);
    viewer_live_close(&v->live);
    viewer_room_close(&v->room);
    take_view_close(&v->shared.take_view);
    take_judge_close(&v->judge);
    take_list_close(&v->shared.takes);
    take_list_close(&v->shared.attempts);
    recording_free(&v->shared.other);
    place_free(&v->shared.place);
    recording_free(&v->shared.recording);
    ui_close(&v->ui);
    free(v);
    *viewer = NULL;
}

static void open_take(struct viewer *viewer, int64_t now_ns)
{
    const char *name = viewer->shared.takes.cards[viewer->shared.state.take].name;
    take_view_close(&viewer->shared.take_view);
    viewer->shared.has_image = false;
    const struct take_view_options options = {viewer->shared.options.file, name, viewer->shared.options.wake,
                                              viewer->shared.options.wake_self};
    enum status status = take_view_open(&viewer->shared.take_view, viewer->shared.gpu, &options);
    if (status == OK && viewer->shared.options.sensor)
        status = viewer_live_open_take(viewer->live, name);
    if (status != OK) {
        snprintf(viewer->trouble, sizeof viewer->trouble, "%s", status_message());
        view_state_fail(&viewer->shared.state, viewer->trouble);
        return;
    }
    struct orbit orbit = take_view_orbit(viewer->shared.take_view);
    view_state_open_take(&viewer->shared.state, take_view_length_ns(viewer->shared.take_view),
                         take_view_frames(viewer->shared.take_view), &orbit, now_ns);
    viewer->shared.state.placement.mirrored = viewer->shared.options.mirrored;
}

// ---------------------------------------------------------------- the list of takes

static void adopt_verdict(struct viewer *viewer)
{
    struct take_verdict verdict;
    int number;
    bool good;
    if (!viewer->judge || !take_judge_take(viewer->judge, &number, &verdict, &good))
        return;
    if (good)
        take_list_say(&viewer->shared.takes.cards[number], &verdict);
    else
        viewer->shared.takes.cards[number].unjudgeable = true;
    viewer->shared.state.changed = true;
}

// A thread for which there is no memory is tried again with the next update.
static void ask_for_verdict(struct viewer *viewer)
{
    const int wanted = take_list_unjudged(&viewer->shared.takes, viewer->shared.screens.first_in_sight,
                                          viewer->shared.screens.end_in_sight);
    if (wanted < 0)
        return;
    if (viewer->judge || take_judge_start(&viewer->judge, viewer->shared.options.file, viewer->shared.options.wake,
                                          viewer->shared.options.wake_self) == OK)
        status_ignore(take_judge_ask(viewer->judge, wanted,
                                     viewer->shared.takes.cards[wanted].name)); // asked again with the next update
}

// Call while the takes are listed. True: there are cards left to complete.
static bool update_takes(struct viewer *viewer)
{
    if (viewer->shared.state.page != PAGE_TAKES || !viewer->shared.recording)
        return false;
    const int64_t until_ns = clock_now_ns() + CARDS_NS;
    const bool other = view_state_lists_other(&viewer->shared.state);
    enum status status = OK;
    while (status == OK && clock_now_ns() < until_ns) {
        status = take_list_load(other ? &viewer->shared.attempts : &viewer->shared.takes, viewer->shared.gpu,
                                other ? viewer->shared.other : viewer->shared.recording,
                                viewer->shared.screens.first_in_sight, viewer->shared.screens.end_in_sight);
        viewer->shared.state.changed |= status == OK;
    }
    adopt_verdict(viewer);
    if (status == NOTHING && !other)
        ask_for_verdict(viewer);
    return status == OK;
}

// ---------------------------------------------------------------- time

static void apply_gesture(struct viewer *viewer, int64_t now_ns)
{
    struct gesture g = gesture_take(&viewer->input.gesture);
    double wheel = viewer->input.wheel;
    viewer->input.wheel = 0;
    const struct ui_point at = {viewer->input.pointer_x, viewer->input.pointer_y};
    if (wheel != 0 && viewer->shared.state.page == PAGE_TAKES)
        screen_takes_wheel(&viewer->shared.screens, wheel);
    if (wheel != 0 && screens_wheel(&viewer->shared.screens, &viewer->shared.state, at, wheel))
        wheel = 0;
    const bool on_map =
        viewer->shared.state.page == PAGE_WATCH && viewer->shared.state.room.map && viewer->shared.screens.map_held;
    if (wheel != 0 && !on_map)
        view_state_wheel(&viewer->shared.state, wheel, now_ns);
    const double shorter = fmin(ui_width(viewer->ui), ui_height(viewer->ui));
    if (on_map) {
        g.drag_x /= shorter, g.drag_y /= shorter, g.push_x /= shorter, g.push_y /= shorter;
        if (wheel != 0 || viewer->input.pointer_down)
            view_state_map_gesture(&viewer->shared.state, &g, wheel, now_ns);
        return;
    }
    if (!viewer->shared.screens.image_held || !viewer->shared.has_image)
        return;
    struct ui_box all =
        layout_of(ui_width(viewer->ui), ui_height(viewer->ui), &viewer->shared.state, &viewer->shared.image).picture;
    struct cover cover = cover_of(&viewer->shared.image.lens, all);
    struct vec3 from, to;
    double x = viewer->input.pointer_x, y = viewer->input.pointer_y, by_x = g.drag_x + g.push_x,
           by_y = g.drag_y + g.push_y;
    struct floor_drag drag;
    bool floor = cover_floor(&viewer->shared.image, cover, (struct ui_point){x - by_x, y - by_y}, &from) &&
                 cover_floor(&viewer->shared.image, cover, (struct ui_point){x, y}, &to);
    if (floor)
        drag = (struct floor_drag){from.x, from.y, to.x, to.y};
    g.drag_x /= all.h, g.drag_y /= all.h, g.push_x /= all.h, g.push_y /= all.h;
    view_state_gesture(&viewer->shared.state, &g, floor ? &drag : NULL, now_ns);
}

// The progress of building the avatar, and why it failed if it did.
static void update_take_view(struct viewer *viewer, int64_t now_ns)
{
    if (!viewer->shared.take_view)
        return;
    if (take_view_adopt_avatar(viewer->shared.take_view) != OK)
        view_state_warn(&viewer->shared.state, status_message(), now_ns);
    view_state_set_progress(&viewer->shared.state, take_view_progress(viewer->shared.take_view));
    viewer->shared.state.changed |= !take_view_final(viewer->shared.take_view);
}

// A removed recording plays on, for it is open; a sentence says so.
static void check_file(struct viewer *viewer, int64_t now_ns)
{
    if (now_ns - viewer->checked_ns < CHECK_NS || !viewer->shared.take_view)
        return;
    viewer->checked_ns = now_ns;
    bool gone = !file_exists(viewer->shared.options.file);
    if (gone)
        snprintf(viewer->problem, sizeof viewer->problem, "%.200s was removed; it can be watched until it is closed",
                 viewer->shared.takes.file);
    view_state_set_problem(&viewer->shared.state, gone ? viewer->problem : NULL);
}

void viewer_suspend(struct viewer *viewer, bool suspend, int64_t now_ns)
{
    if (suspend == viewer->suspended)
        return;
    viewer->suspended = suspend;
    viewer_camera_suspend(viewer->camera, suspend);
    viewer_live_suspend(viewer->live, suspend);
    if (suspend)
        viewer->suspended_ns = now_ns;
    else
        view_state_resume(&viewer->shared.state, viewer->suspended_ns, now_ns);
}

int64_t viewer_update(struct viewer *viewer, int64_t now_ns)
{
    struct view_state *s = &viewer->shared.state;
    viewer_camera_update(viewer->camera, now_ns);
    apply_gesture(viewer, now_ns);
    bool sticks = input_map_pad(&viewer->input, s, fmin((double)(now_ns - viewer->pad_ns) * 1e-9, 0.1), now_ns);
    viewer->pad_ns = now_ns;
    if (s->take_wanted)
        open_take(viewer, now_ns);
    const bool cards_left = update_takes(viewer);
    check_file(viewer, now_ns);
    update_take_view(viewer, now_ns);
    viewer_live_update(viewer->live, now_ns);
    viewer_room_update(viewer->room);
    keep_settings(viewer);
    int64_t next_ns = view_state_tick(s, now_ns);
    viewer_live_after_tick(viewer->live, now_ns);
    int64_t check_ns = viewer->checked_ns + CHECK_NS;
    if (s->page == PAGE_WATCH && viewer->shared.take_view && check_ns < next_ns)
        next_ns = check_ns;
    if (s->page == PAGE_WATCH && viewer->shared.take_view && take_view_waiting(viewer->shared.take_view) &&
        now_ns + POLL_NS < next_ns)
        next_ns = now_ns + POLL_NS;
    if (s->page == PAGE_WATCH && viewer->shared.take_view && !take_view_final(viewer->shared.take_view))
        next_ns = now_ns;
    if (s->page == PAGE_WATCH && s->sheet == SHEET_CARD)
        next_ns = now_ns; // the thing turns
    if (viewer_camera_due_ns(viewer->camera) < next_ns)
        next_ns = viewer_camera_due_ns(viewer->camera);
    return sticks || cards_left ? now_ns : next_ns;
}

// ---------------------------------------------------------------- drawing

// The part of the screen that the controls leave free.
static struct ui_box free_box(const struct viewer *viewer, const struct viewer_surface *surface)
{
    return layout_of(surface->width / surface->px_per_dp, surface->height / surface->px_per_dp, &viewer->shared.state,
                     &viewer->shared.image)
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
    if (!viewer->shared.has_image || box_difference(viewer->free, to) < 0.5)
        viewer->free = to;
}

static struct take_view_request make_request(struct viewer *viewer, const struct viewer_surface *surface,
                                             int64_t now_ns)
{
    struct view_state *s = &viewer->shared.state;
    const struct camera_frame *frame = s->orbiting ? NULL : viewer->shared.frame;
    struct take_view_request request = {
        .playing = s->playback.playing,
        .loop = s->playback.loop,
        .placement = s->placement,
        .resolution_scale = viewer->shared.options.fixed_resolution ? 1 : governor_scale(&viewer->governor),
        .detail = s->detail,
        .error_px = s->error_px,
        .sources = s->sources,
        .inset = s->inset,
        .sensor = s->crossfade < 1,
    };
    if (frame) {
        request.lens = frame->lens;
        request.camera = viewer_camera_texture(viewer->camera);
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
    const struct ui_box picture =
        layout_of(surface->width / px, surface->height / px, s, &viewer->shared.image).picture;
    request.lens = take_view_orbit_lens((int)(picture.w * px + 0.5), (int)(picture.h * px + 0.5), free);
    request.in_room =
        (viewer->shared.image.filmed || viewer->shared.image.surface) && viewer_room_wants_filmed(viewer->room);
    request.time_ns = playback_at(&s->playback, now_ns);
    request.world_from_camera = orbit_world_from_camera(&s->orbit);
    return request;
}

// From the hips: where the front is.
static void note_facing(struct viewer *viewer)
{
    const struct skeleton *skeleton = &viewer->shared.image.skeleton;
    if (!viewer->shared.image.has_skeleton ||
        !(skeleton->confidence[JOINT_LEFT_HIP] > 0 && skeleton->confidence[JOINT_RIGHT_HIP] > 0))
        return;
    const struct vec3 across = v3_sub(skeleton->joint[JOINT_LEFT_HIP], skeleton->joint[JOINT_RIGHT_HIP]);
    const double left = viewer->shared.state.placement.mirrored ? -1 : 1; // the joints keep their names
    if (hypot(across.x, across.y) > 0.02)
        view_state_set_facing(&viewer->shared.state, atan2(left * across.y, left * across.x));
}

// Moves the orbit's centre with the actor.
static void follow_actor(struct viewer *viewer)
{
    struct view_state *s = &viewer->shared.state;
    note_facing(viewer);
    if (!s->orbiting || s->moving || !viewer->shared.image.has_skeleton ||
        !(viewer->shared.image.skeleton.confidence[JOINT_WAIST] > 0))
        return;
    const struct vec3 waist = viewer->shared.image.skeleton.joint[JOINT_WAIST];
    if (v3_distance(s->orbit.centre, waist) < 0.002)
        return;
    s->orbit.centre = v3_mix(s->orbit.centre, waist, s->playback.playing ? 0.05 : 0.25);
    s->changed = true;
}

// A frame that cannot be read is said, and costs itself alone: others may be readable.
static enum status forgive_frame(struct viewer *viewer, enum status status, int64_t now_ns)
{
    if (status != ERR_CORRUPT && status != ERR_IO && status != ERR_INPUT)
        return status;
    view_state_warn(&viewer->shared.state, status_message(), now_ns);
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
    enum status status = viewer->shared.state.orbiting ? OK : viewer_camera_upload(viewer->camera);
    if (status == OK)
        status = viewer_room_read_seen(viewer->room);
    if (status != OK)
        return status;
    ease_free_box(viewer, surface, now_ns);
    struct take_view_request request = make_request(viewer, surface, now_ns);
    const struct gpu_texture *filmed;
    status = viewer_room_draw_filmed(viewer->room, &request, now_ns, &filmed);
    if (status != OK)
        return status;
    struct take_view_image room = {.filmed = filmed};
    status = viewer_room_draw_surface(viewer->room, &request, &room);
    if (status != OK)
        return status;
    set_room(&viewer->shared.image, &room);
    viewer_room_ask_seen(viewer->room, &request);
    if (viewer->shared.has_image && take_view_request_equal(&request, &viewer->request) &&
        take_view_final(viewer->shared.take_view))
        return OK; // nothing has changed
    bool steady = viewer->shared.has_image;
    viewer->request = request;
    viewer->shared.has_image = true;
    status = take_view_draw(viewer->shared.take_view, &request, &viewer->shared.image);
    set_room(&viewer->shared.image, &room);
    const bool asked = status == OK && request.overlay;
    viewer_room_expect_seen(viewer->room, asked);
    // The answer is read with the next drawing, which comes by itself while images follow one another.
    viewer->shared.state.changed |= asked && !(request.camera && request.playing);
    view_state_set_avatar_shown(&viewer->shared.state, viewer->shared.image.prepared);
    viewer->shared.state.changed |=
        request.camera == NULL && box_difference(viewer->free, free_box(viewer, surface)) > 0;
    if (steady)
        follow_actor(viewer);
    return forgive_frame(viewer, status, now_ns);
}

// The actor and what the live screens draw from. The camera's image only where they are in the room.
static enum status draw_live(struct viewer *viewer, const struct viewer_surface *surface, int64_t now_ns)
{
    const struct live_state *l = &viewer->shared.state.live;
    const bool room =
        l->screen == LIVE_ROOM && l->phase != LIVE_SUMMARY && !viewer->shared.state.orbiting && viewer->shared.frame;
    enum status status = room ? viewer_camera_upload(viewer->camera) : OK;
    if (status != OK)
        return status;
    struct take_view_request request = make_request(viewer, surface, now_ns);
    if (!room)
        viewer_live_request(viewer->live, surface, &request);
    status = viewer_live_draw(viewer->live, surface, &request);
    viewer->shared.has_image = true;
    view_state_set_avatar_shown(&viewer->shared.state, viewer->shared.image.prepared);
    return forgive_frame(viewer, status, now_ns);
}

static enum status draw_screen(struct viewer *viewer, int64_t now_ns)
{
    const struct brush brush = {viewer->ui, theme_of(viewer->shared.state.dark), NULL};
    if (viewer->shared.state.page == PAGE_TAKES) {
        const struct take_list *list =
            view_state_lists_other(&viewer->shared.state) ? &viewer->shared.attempts : &viewer->shared.takes;
        const struct takes_page page = {list->file, list->cards, list->count};
        screen_takes(&brush, &viewer->shared.screens, &viewer->shared.state, &page, now_ns);
    } else if (viewer->shared.state.page == PAGE_TROUBLE ||
               (!viewer->shared.take_view && !viewer->shared.state.live.of_takes)) {
        screen_trouble(&brush, &viewer->shared.state, now_ns);
    } else if (viewer->shared.state.page == PAGE_LIVE && viewer->shared.state.live.phase == LIVE_SUMMARY) {
        screen_summary(&brush, &viewer->shared.screens, &viewer->shared.state, viewer_live_page(viewer->live), now_ns);
    } else if (viewer->shared.state.page == PAGE_LIVE) {
        screen_live(&brush, &viewer->shared.screens, &viewer->shared.state, viewer_live_page(viewer->live), now_ns);
    } else {
        const struct watch_page page = {
            viewer->shared.takes.file,  viewer->shared.takes.cards[viewer->shared.state.take].name,
            &viewer->shared.image,      &viewer->times,
            viewer->governor.budget_ms, viewer_room_page(viewer->room)};
        screen_watch(&brush, &viewer->shared.screens, &viewer->shared.state, &page, now_ns);
    }
    screen_message(&brush, &viewer->shared.state);
    return OK;
}

static enum status take_screenshot(struct viewer *viewer, int64_t now_ns)
{
    const struct brush brush = {viewer->ui, theme_of(viewer->shared.state.dark), NULL};
    char path[600], notice[160];
    viewer->shared.state.screenshot_wanted = false;
    enum status status = screenshot_path(viewer->shared.options.photos, path, sizeof path);
    if (status == OK)
        status = screenshot_take(&brush, viewer->shared.gpu, &viewer->shared.image, &viewer->shared.state, path);
    if (status == ERR_DEVICE)
        return status;
    const char *name = strrchr(path, '/');
    snprintf(notice, sizeof notice, "%s%.120s", status == OK ? "Saved " : "",
             status == OK ? name + 1 : status_message());
    if (status == OK)
        view_state_notify(&viewer->shared.state, notice, now_ns);
    else
        view_state_warn(&viewer->shared.state, notice, now_ns);
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
    const struct brush brush = {v->ui, theme_of(!v->shared.options.light), NULL};
    const char *slash = strrchr(v->shared.options.file, '/');
    enum status status = ui_begin(v->ui, &input);
    if (status != OK)
        return status;
    screen_opening(&brush, slash ? slash + 1 : v->shared.options.file);
    ui_end(v->ui);
    return ui_draw(v->ui, surface->target, surface->quarter_turns);
}

enum status viewer_draw(struct viewer *v, const struct viewer_surface *surface, int64_t now_ns)
{
    struct view_state *s = &v->shared.state;
    const int page = (int)s->page; // a control that is touched while it is drawn may lead to another
    enum status status = OK;
    v->drawing_ns = clock_now_ns();
    s->changed = false;
    if (s->page == PAGE_WATCH && v->shared.take_view)
        status = draw_take(v, surface, now_ns);
    else if (s->page == PAGE_LIVE && (v->shared.take_view || s->live.of_takes))
        status = draw_live(v, surface, now_ns);
    if (status == OK && s->page == PAGE_WATCH && v->shared.take_view)
        status = viewer_room_draw(v->room, surface, now_ns);
    if (status == OK && s->screenshot_wanted && v->shared.take_view)
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
    if (input_map_is_meant(&viewer->input, (int)viewer->shared.state.page, event))
        return input_map_event(&viewer->input, &viewer->shared.state, event, px_per_dp, now_ns);
    input_map_forget(&viewer->input);
    return false;
}

static void note_times(struct viewer *viewer, int64_t now_ns)
{
    const struct camera_frame *frame = viewer->shared.state.orbiting ? NULL : viewer->shared.frame;
    double ms[FRAME_STAGES] = {0};
    if (viewer->shared.state.page != PAGE_WATCH || (frame && frame->number == viewer->timed_frame))
        return;
    if (frame) {
        viewer->timed_frame = frame->number;
        viewer->placed += frame->placed && viewer->shared.image.parts > 0;
        ms[FRAME_LOCATE] = (double)(frame->located_ns - frame->locating_ns) * 1e-6;
        ms[FRAME_WAIT] =
            (double)(frame->locating_ns - frame->received_ns + viewer->drawing_ns - frame->located_ns) * 1e-6;
    }
    ms[FRAME_ACTOR] = (double)(viewer->drawn_ns - viewer->drawing_ns) * 1e-6;
    ms[FRAME_CONTROLS] = (double)(viewer->controls_ns - viewer->drawn_ns) * 1e-6;
    ms[FRAME_SHOW] = (double)(now_ns - viewer->controls_ns) * 1e-6;
    frame_times_add(&viewer->times, ms);
}

bool viewer_presented(struct viewer *viewer, int64_t now_ns)
{
    const bool other_page = viewer->input.shown_page != viewer->presented_page;
    if (other_page)
        input_map_forget(&viewer->input);
    viewer->presented_page = viewer->input.shown_page;
    if (viewer->shared.take_view)
        take_view_presented(viewer->shared.take_view);
    viewer_camera_presented(viewer->camera);
    note_times(viewer, now_ns);
    return other_page;
}

// ---------------------------------------------------------------- queries

struct viewer_wishes viewer_query(const struct viewer *viewer)
{
    const struct view_state *s = &viewer->shared.state;
    return (struct viewer_wishes){.draw = s->changed,
                                  .type = view_state_types(s),
                                  .fullscreen = s->fullscreen,
                                  .quit = s->quit,
                                  .to_takes = s->page == PAGE_TAKES,
                                  .trim = s->trim.wanted,
                                  .trim_from_ns = s->trim.from_ns,
                                  .trim_to_ns = s->trim.to_ns,
                                  .text_size = s->text_size > 0 ? s->text_size : 1, // 0: while it is being opened
                                  .dark = s->dark,
                                  .keeps = &viewer->settings};
}

struct viewer_shown viewer_shown(const struct viewer *viewer)
{
    const struct take_view_image *image = &viewer->shared.image;
    const bool actor = viewer->shared.has_image && image->parts > 0;
    return (struct viewer_shown){.sensor = actor || (viewer->shared.has_image && image->sensor),
                                 .body = actor && image->prepared,
                                 .full = actor && image->full,
                                 .hint = view_state_hint(&viewer->shared.state),
                                 .frames = viewer->times.frames,
                                 .with_actor = viewer->placed};
}

void viewer_print_stats(const struct viewer *viewer, FILE *out)
{
    const struct frame_times *t = &viewer->times;
    const struct camera_feed_state feed = viewer_camera_query(viewer->camera);
    fprintf(out, "pictures  %lld from the camera, %lld skipped, %lld drawn, %lld with the actor in place\n",
            (long long)feed.received, (long long)feed.dropped, (long long)t->frames, (long long)viewer->placed);
    if (viewer->shared.take_view)
        fprintf(out, "take      %lld frames decoded, of %lld\n",
                (long long)take_view_frames_decoded(viewer->shared.take_view),
                (long long)take_view_frames(viewer->shared.take_view));
    viewer_camera_print_stats(viewer->camera, out);
    viewer_live_print_stats(viewer->live, out);
    for (int i = 0; i < FRAME_STAGES && t->frames > 0; i++)
        fprintf(out, "%-9s %7.2f ms\n", frame_stage_names[i], t->sum_ms[i] / (double)t->frames);
    fprintf(out, "in all    %7.2f ms in the median, %.2f ms at most\n", frame_times_median(t), t->total_worst_ms);
}

struct viewer_options viewer_options_again(const struct viewer *viewer)
{
    const struct view_state *s = &viewer->shared.state;
    struct viewer_options again = viewer->shared.options;
    if (viewer->shared.take_view)
        again.take = viewer->shared.takes.cards[s->take].name;
    again.compare_with = NULL; // one of the two takes may have been chosen, which is chosen again by hand
    again.light = !s->dark;
    again.text_size = s->text_size;
    again.detail_given = true;
    again.detail = s->detail;
    again.mirrored = again.sensor ? s->live.mirrored : s->placement.mirrored;
    again.fullscreen = s->fullscreen;
    return again;
}

// ---------------------------------------------------------------- from within

struct view_state *viewer_state(struct viewer *viewer) { return &viewer->shared.state; }
const struct screens *viewer_screens(const struct viewer *viewer) { return &viewer->shared.screens; }
const struct input_map *viewer_input(const struct viewer *viewer) { return &viewer->input; }
struct ui *viewer_ui(struct viewer *viewer) { return viewer->ui; }
const struct take_list *viewer_takes(const struct viewer *viewer) { return &viewer->shared.takes; }
const struct take_view_image *viewer_image(const struct viewer *viewer) { return &viewer->shared.image; }
const struct take_view_request *viewer_request(const struct viewer *viewer) { return &viewer->request; }
struct take_view *viewer_take_view(struct viewer *viewer) { return viewer->shared.take_view; }
struct ui_box viewer_free_box(const struct viewer *viewer) { return viewer->free; }
void viewer_redraw(struct viewer *viewer) { viewer->shared.has_image = false; }
const struct frame_times *viewer_times(const struct viewer *viewer) { return &viewer->times; }
int64_t viewer_drawing_ns(const struct viewer *viewer) { return viewer->drawing_ns; }
struct resolution_governor *viewer_governor(struct viewer *viewer) { return &viewer->governor; }
void viewer_set_checked(struct viewer *viewer, int64_t checked_ns) { viewer->checked_ns = checked_ns; }
const struct camera_frame *viewer_camera_frame(const struct viewer *viewer) { return viewer->shared.frame; }
struct camera_feed_state viewer_feed_state(const struct viewer *viewer) { return viewer_camera_query(viewer->camera); }
bool viewer_camera_rests(const struct viewer *viewer) { return viewer_camera_is_resting(viewer->camera); }
struct viewer_live_view viewer_live_view(struct viewer *viewer) { return viewer_live_view_of(viewer->live); }
struct viewer_room_view viewer_room_view(struct viewer *viewer) { return viewer_room_view_of(viewer->room); }
