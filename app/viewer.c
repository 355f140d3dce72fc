#include "app/viewer.h"

#include "app/ui/screenshot.h"
#include "base/clock.h"
#include "platform/file.h"
#include "reenact/render/shaders.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const int64_t CHECK_NS = 1000000000;
static const int64_t AWAITED_NS = 4000000;                    // what will be there in a moment is looked for so often
static const double EASE_S = 0.07, LONGEST_STEP_S = 1 / 30.0; // of making room: its pace; a picture's time, at most

double viewer_px_per_dp(double dpi) { return fmax(dpi / 160, 0.85); } // a desk's screen is looked at from farther away

// ---------------------------------------------------------------- opening

static enum status open_recording(struct viewer *t)
{
    enum status status = recording_open(&t->recording, t->options.file);
    if (status == OK)
        status = take_list_open(&t->takes, t->gpu, t->recording, t->options.file);
    if (status == OK && t->takes.count == 0)
        status = fail(ERR_MISSING, "%s holds no take. Film one with reenact-capture record.", t->options.file);
    if (status != OK)
        return status;
    status = recording_read_place(t->recording, &t->place);
    t->has_place = status == OK && t->place.tag_count + t->place.point_count > 0;
    return status < 0 ? status : OK;
}

static void choose_at_first(struct viewer *t, int64_t now_ns)
{
    t->state = view_state_start(t->takes.count, !t->options.light, now_ns);
    for (int i = 0; t->options.take && i < t->takes.count; i++)
        if (!strcmp(t->takes.cards[i].name, t->options.take))
            view_state_choose_take(&t->state, i);
    if (t->options.take && !t->state.take_wanted) {
        fail(ERR_MISSING, "%s has no take named '%s'", t->options.file, t->options.take);
        snprintf(t->trouble, sizeof t->trouble, "%s", status_message());
        view_state_fail(&t->state, t->trouble);
    }
}

enum status viewer_open(struct viewer *t, struct gpu *gpu, const struct viewer_options *options)
{
    *t = (struct viewer){.options = *options, .gpu = gpu};
    const struct gpu_draw2d_shaders shaders = {shader_find("draw2d.vert"), shader_find("draw2d.frag")};
    t->governor = governor_start(1000 / options->refresh_hz);
    enum status status = ui_open(&t->ui, gpu, &shaders, theme_faces(), FACE_COUNT);
    if (status != OK)
        return status;
    int64_t now_ns = clock_now_ns();
    status = open_recording(t);
    if (status == ERR_DEVICE || status == ERR_MEMORY)
        return status;
    if (status != OK)
        snprintf(t->trouble, sizeof t->trouble, "%s", status_message());
    choose_at_first(t, now_ns);
    if (status != OK)
        view_state_fail(&t->state, t->trouble);
    if (!options->camera)
        return OK;
    status = camera_texture_open(&t->camera_texture, gpu);
    if (status != OK)
        return status;
    const struct camera_feed_options feed = {options->camera, t->has_place ? &t->place : NULL, options->wake,
                                             options->wake_self, camera_texture_can_import(t->camera_texture)};
    return camera_feed_open(&t->feed, &feed);
}

void viewer_close(struct viewer *t)
{
    camera_texture_close(&t->camera_texture);
    camera_feed_close(&t->feed);
    take_view_close(&t->take_view);
    take_list_close(&t->takes);
    place_free(&t->place);
    recording_free(&t->recording);
    ui_close(&t->ui);
    *t = (struct viewer){0};
}

static void open_take(struct viewer *t, int64_t now_ns)
{
    const char *name = t->takes.cards[t->state.take].name;
    take_view_close(&t->take_view);
    t->has_image = false;
    const struct take_view_options how = {t->options.file, name, t->options.wake, t->options.wake_self};
    enum status status = take_view_open(&t->take_view, t->gpu, &how);
    if (status != OK) {
        snprintf(t->trouble, sizeof t->trouble, "%s", status_message());
        view_state_fail(&t->state, t->trouble);
        return;
    }
    struct orbit orbit = take_view_orbit(t->take_view);
    view_state_open_take(&t->state, take_view_length_ns(t->take_view), take_view_frames(t->take_view), &orbit, now_ns);
}

// ---------------------------------------------------------------- time

static void update_camera(struct viewer *t, int64_t now_ns)
{
    struct view_camera camera = {
        .there = t->feed, .knows_place = t->has_place, .knows_tags = t->place.tag_count > 0, .trouble = ""};
    if (t->feed) {
        const struct camera_frame *frame = t->frame = camera_feed_latest(t->feed);
        t->feed_state = camera_feed_query(t->feed);
        camera.seeing = t->feed_state.seeing;
        camera.came_ns = t->feed_state.came_ns;
        camera.frame = frame ? frame->number : 0;
        camera.placed = frame && frame->placed;
        camera.moved_tags = frame ? frame->moved_tags : 0;
        camera.first_moved = frame ? frame->first_moved : -1;
        camera.trouble = t->feed_state.trouble;
    }
    view_state_on_camera(&t->state, &camera, now_ns);
}

static void apply_fingers(struct viewer *t, int64_t now_ns)
{
    struct gesture g = gesture_take(&t->input.gesture);
    double wheel = t->input.wheel;
    t->input.wheel = 0;
    if (wheel != 0)
        view_state_wheel(&t->state, wheel, now_ns);
    if (!t->screens.image_held || !t->has_image)
        return;
    struct ui_box all = {0, 0, ui_width(t->ui), ui_height(t->ui)};
    struct cover cover = cover_of(&t->image.lens, all);
    struct vec3 from, to;
    double x = t->input.pointer_x, y = t->input.pointer_y, by_x = g.drag_x + g.push_x, by_y = g.drag_y + g.push_y;
    struct floor_drag drag;
    bool floor = cover_floor(&t->image, cover, (struct ui_point){x - by_x, y - by_y}, &from) &&
                 cover_floor(&t->image, cover, (struct ui_point){x, y}, &to);
    if (floor)
        drag = (struct floor_drag){from.x, from.y, to.x, to.y};
    g.drag_x /= all.h, g.drag_y /= all.h, g.push_x /= all.h, g.push_y /= all.h;
    view_state_gesture(&t->state, &g, floor ? &drag : NULL, now_ns);
}

// What is being prepared: how far it is, and where it came to nothing, why.
static void update_take_view(struct viewer *t)
{
    if (!t->take_view)
        return;
    if (take_view_adopt_avatar(t->take_view) != OK) {
        snprintf(t->problem, sizeof t->problem, "%s", status_message());
        view_state_set_problem(&t->state, t->problem);
    }
    view_state_set_progress(&t->state, take_view_progress(t->take_view));
    t->state.changed |= !take_view_final(t->take_view);
}

// A recording that somebody took away plays on, for it is open; but it is said.
static void check_file(struct viewer *t, int64_t now_ns)
{
    if (now_ns - t->checked_ns < CHECK_NS || !t->take_view)
        return;
    t->checked_ns = now_ns;
    bool gone = !file_exists(t->options.file);
    if (gone)
        snprintf(t->problem, sizeof t->problem, "%.200s was taken away; it can be watched until it is closed",
                 t->takes.file);
    if (gone || t->state.problem == t->problem)
        view_state_set_problem(&t->state, gone ? t->problem : NULL);
}

void viewer_suspend(struct viewer *t, bool suspend, int64_t now_ns)
{
    if (suspend == t->suspended)
        return;
    t->suspended = suspend;
    if (t->feed)
        camera_feed_suspend(t->feed, suspend);
    if (suspend)
        t->suspended_ns = now_ns;
    else
        view_state_resume(&t->state, t->suspended_ns, now_ns);
}

int64_t viewer_update(struct viewer *t, int64_t now_ns)
{
    struct view_state *s = &t->state;
    update_camera(t, now_ns);
    apply_fingers(t, now_ns);
    bool sticks = input_map_pad(&t->input, s, fmin((double)(now_ns - t->pad_ns) * 1e-9, 0.1), now_ns);
    t->pad_ns = now_ns;
    if (s->take_wanted)
        open_take(t, now_ns);
    check_file(t, now_ns);
    update_take_view(t);
    int64_t next_ns = view_state_tick(s, now_ns);
    int64_t check_ns = t->checked_ns + CHECK_NS;
    if (s->page == PAGE_WATCH && t->take_view && check_ns < next_ns)
        next_ns = check_ns;
    if (s->page == PAGE_WATCH && t->take_view && take_view_waiting(t->take_view) && now_ns + AWAITED_NS < next_ns)
        next_ns = now_ns + AWAITED_NS;
    if (s->page == PAGE_WATCH && t->take_view && !take_view_final(t->take_view))
        next_ns = now_ns;
    return sticks ? now_ns : next_ns;
}

// ---------------------------------------------------------------- drawing

// What the controls leave of the screen.
static struct ui_box free_now(const struct viewer *t, const struct viewer_surface *glass)
{
    return layout_of(glass->width / glass->px_per_dp, glass->height / glass->px_per_dp, &t->state, &t->image).free;
}

static double distance_between(struct ui_box a, struct ui_box b)
{
    return fmax(fmax(fabs(a.x - b.x), fabs(a.y - b.y)), fmax(fabs(a.w - b.w), fabs(a.h - b.h)));
}

// The orbit's picture makes room for what was opened, and takes it back.
static void ease_free_box(struct viewer *t, const struct viewer_surface *glass, int64_t now_ns)
{
    const struct ui_box to = free_now(t, glass), from = t->free;
    const double passed_s = fmin((double)(now_ns - t->freed_ns) * 1e-9, LONGEST_STEP_S);
    const double share = 1 - exp(-fmax(passed_s, 0) / EASE_S);
    t->freed_ns = now_ns;
    t->free = (struct ui_box){from.x + share * (to.x - from.x), from.y + share * (to.y - from.y),
                              from.w + share * (to.w - from.w), from.h + share * (to.h - from.h)};
    if (!t->has_image || distance_between(t->free, to) < 0.5)
        t->free = to;
}

static struct take_view_request make_request(struct viewer *t, const struct viewer_surface *glass, int64_t now_ns)
{
    struct view_state *s = &t->state;
    const struct camera_frame *frame = s->orbiting ? NULL : t->frame;
    struct take_view_request request;
    memset(&request, 0, sizeof request); // it is compared byte by byte
    request.playing = s->playback.playing;
    request.loop = s->playback.loop;
    request.placement = s->placement;
    request.resolution_scale = t->options.fixed_resolution ? 1 : governor_scale(&t->governor);
    request.error_px = s->error_px;
    request.sources = s->sources;
    request.inset = s->inset;
    request.former = s->crossfade < 1;
    if (frame) {
        request.lens = frame->lens;
        request.camera = camera_texture_current(t->camera_texture);
        request.camera_number = frame->number;
        request.time_ns = playback_at(&s->playback, frame->came_ns); // the instant of this very picture
        // While it does not know, the actor fades where he was last; he does not jump.
        if (frame->placed)
            t->last_placed = frame->world_from_camera;
        request.world_from_camera = t->last_placed;
        request.camera_lost = !s->ever_placed || s->presence <= 0;
        return request;
    }
    const double px = glass->px_per_dp;
    const struct ui_box free = {t->free.x * px, t->free.y * px, t->free.w * px, t->free.h * px};
    request.lens = take_view_orbit_lens(glass->width, glass->height, free);
    request.time_ns = playback_at(&s->playback, now_ns);
    request.world_from_camera = orbit_world_from_camera(&s->orbit);
    return request;
}

// The orbit goes along with whoever walks.
static void follow_actor(struct viewer *t)
{
    struct view_state *s = &t->state;
    if (!s->orbiting || s->moving || !t->image.has_skeleton || !(t->image.skeleton.confidence[JOINT_WAIST] > 0))
        return;
    const struct vec3 waist = t->image.skeleton.joint[JOINT_WAIST];
    if (v3_distance(s->orbit.centre, waist) < 0.002)
        return;
    s->orbit.centre = v3_mix(s->orbit.centre, waist, s->playback.playing ? 0.05 : 0.25);
    s->changed = true;
}

// The sight's picture goes to the graphics chip, once.
static enum status upload_camera_frame(struct viewer *t)
{
    if (!t->frame || t->frame->number == t->uploaded_number)
        return OK;
    struct dmabuf_image *dmabuf = camera_feed_take_dmabuf(t->feed);
    enum status status = camera_texture_update(t->camera_texture, t->frame, &dmabuf);
    t->uploaded_number = status == OK ? t->frame->number : 0;
    return status;
}

static enum status draw_take(struct viewer *t, const struct viewer_surface *glass, int64_t now_ns)
{
    enum status status = t->state.orbiting ? OK : upload_camera_frame(t);
    if (status != OK)
        return status;
    ease_free_box(t, glass, now_ns);
    struct take_view_request request = make_request(t, glass, now_ns);
    if (t->has_image && !memcmp(&request, &t->request, sizeof request) && take_view_final(t->take_view))
        return OK; // the same again
    bool steady = t->has_image;
    t->request = request;
    t->has_image = true;
    status = take_view_draw(t->take_view, &request, &t->image);
    view_state_set_avatar_shown(&t->state, t->image.prepared);
    t->state.changed |= request.camera == NULL && distance_between(t->free, free_now(t, glass)) > 0;
    if (steady)
        follow_actor(t);
    if (status == ERR_CORRUPT || status == ERR_IO || status == ERR_INPUT) { // this frame cannot be read; others may be
        snprintf(t->problem, sizeof t->problem, "%s", status_message());
        view_state_set_problem(&t->state, t->problem);
        return OK;
    }
    return status;
}

static enum status draw_screen(struct viewer *t, int64_t now_ns)
{
    const struct brush brush = {t->ui, theme_of(t->state.dark)};
    if (t->state.page == PAGE_TAKES) {
        const struct takes_page page = {t->takes.file, t->takes.cards, t->takes.count};
        screen_takes(&brush, &t->screens, &t->state, &page, now_ns);
    } else if (t->state.page == PAGE_TROUBLE || !t->take_view) {
        screen_trouble(&brush, &t->state, now_ns);
    } else {
        const struct watch_page page = {t->takes.file, t->takes.cards[t->state.take].name, &t->image, &t->times,
                                        t->governor.budget_ms};
        screen_watch(&brush, &t->screens, &t->state, &page, now_ns);
    }
    screen_message(&brush, &t->state);
    return OK;
}

static enum status take_screenshot(struct viewer *t, int64_t now_ns)
{
    const struct brush brush = {t->ui, theme_of(t->state.dark)};
    char path[600], notice[160];
    t->state.screenshot_wanted = false;
    enum status status = screenshot_path(t->options.photos, path, sizeof path);
    if (status == OK)
        status = screenshot_take(&brush, t->gpu, &t->image, &t->state, path);
    if (status == ERR_DEVICE)
        return status;
    const char *name = strrchr(path, '/');
    snprintf(notice, sizeof notice, "%s%.120s", status == OK ? "Photographed: " : "",
             status == OK ? name + 1 : status_message());
    if (status == OK)
        view_state_notify(&t->state, notice, now_ns);
    else
        view_state_warn(&t->state, notice, now_ns);
    return OK;
}

enum status viewer_draw(struct viewer *t, const struct viewer_surface *glass, int64_t now_ns)
{
    struct view_state *s = &t->state;
    enum status status = OK;
    t->drawing_ns = clock_now_ns();
    s->changed = false;
    if (s->page == PAGE_WATCH && t->take_view)
        status = draw_take(t, glass, now_ns);
    if (status == OK && s->screenshot_wanted && t->take_view)
        status = take_screenshot(t, now_ns);
    if (status != OK)
        return status;
    t->drawn_ns = clock_now_ns();
    const struct ui_input input = {
        glass->width,       glass->height,      glass->px_per_dp,      now_ns,
        t->input.pointer_x, t->input.pointer_y, t->input.pointer_down, t->input.pointer_there};
    status = ui_begin(t->ui, &input);
    if (status != OK)
        return status;
    status = draw_screen(t, now_ns);
    ui_end(t->ui);
    if (status == OK)
        status = ui_draw(t->ui, glass->target, glass->quarter_turns);
    s->changed |= t->input.leaving;
    input_map_frame_done(&t->input);
    t->controls_ns = clock_now_ns();
    double took_ms = (double)(t->controls_ns - t->drawing_ns) * 1e-6;
    if (s->page == PAGE_WATCH && s->playback.playing && governor_update(&t->governor, took_ms))
        s->changed = true;
    return status;
}

void viewer_presented(struct viewer *t, int64_t now_ns)
{
    const struct camera_frame *frame = t->state.orbiting ? NULL : t->frame;
    double ms[FRAME_STAGES] = {0};
    if (t->take_view)
        take_view_presented(t->take_view);
    if (t->feed)
        camera_feed_presented(t->feed);
    if (t->state.page != PAGE_WATCH || (frame && frame->number == t->timed_frame))
        return;
    if (frame) {
        t->timed_frame = frame->number;
        t->placed += frame->placed && t->image.parts > 0;
        ms[FRAME_LOCATE] = (double)(frame->located_ns - frame->locating_ns) * 1e-6;
        ms[FRAME_WAIT] = (double)(frame->locating_ns - frame->came_ns + t->drawing_ns - frame->located_ns) * 1e-6;
    }
    ms[FRAME_ACTOR] = (double)(t->drawn_ns - t->drawing_ns) * 1e-6;
    ms[FRAME_CONTROLS] = (double)(t->controls_ns - t->drawn_ns) * 1e-6;
    ms[FRAME_SHOW] = (double)(now_ns - t->controls_ns) * 1e-6;
    frame_times_add(&t->times, ms);
}
