#include "app/commands/drive_window.h"

#include "app/camera/camera_feed.h"
#include "app/commands/command.h"
#include "app/drive/drive_screen.h"
#include "base/clock.h"
#include "platform/screen/window.h"
#include "surround/drive/head_tracker.h"

#define RADIANS_PER_DP 0.006    // chosen by hand
#define STEP_NS        50000000 // what drives is sent 20 times a second

struct drive_window {
    struct drive_session *session;
    struct window *screen;
    struct gpu *gpu;
    struct drive_screen shown;
    struct camera_feed *feed; // NULL: no head tracker
    struct head_tracker head;
    struct drive_controls controls;
    bool down, quit; // down: by the pointer that turns the view
    int64_t turning; // that pointer
    int pointed;     // the pane on which the pointer is, or went down
    double last_x, last_y;
};

static double px_per_dp(const struct drive_window *w) { return viewer_px_per_dp(window_dpi(w->screen)); }

static int pane_at(const struct drive_window *w, double x, double y)
{
    const struct ui_box map = drive_screen_box(&w->shown, w->controls.width, w->controls.height, DRIVE_MAP);
    return w->shown.map && x >= map.x && y >= map.y ? DRIVE_MAP : DRIVE_PICTURE;
}

static void turn_view(struct drive_window *w, int pane, double dx, double dy)
{
    struct drive_eye *eye = drive_screen_eye(&w->shown, pane);
    eye->orbit = true;
    eye->azimuth -= dx * RADIANS_PER_DP;
    eye->elevation = fmin(1.5, fmax(-0.1, eye->elevation + dy * RADIANS_PER_DP));
}

static void look_from(struct drive_window *w, enum viewpoint from)
{
    w->session->eye.viewpoint = from;
    w->session->eye.orbit = false;
}

static void do_part(struct drive_window *w, enum drive_part part)
{
    switch (part) {
    case PART_LEAVE: w->quit = true; return;
    case PART_VIEWPOINT: look_from(w, (enum viewpoint)((w->session->eye.viewpoint + 1) % 3)); return;
    case PART_MAP:
        w->shown.map = !w->shown.map;
        w->pointed = DRIVE_PICTURE; // until the pointer moves
        w->down = false;
        return;
    default: return;
    }
}

static void on_key(struct drive_window *w, int key)
{
    switch (key) {
    case 'c': w->head.centred = false; return;
    case 'm': do_part(w, PART_MAP); return;
    case '1': look_from(w, VIEWPOINT_FIRST); return;
    case '2': look_from(w, VIEWPOINT_THIRD); return;
    case '3': look_from(w, VIEWPOINT_ABOVE); return;
    default: return;
    }
}

static void zoom(struct drive_eye *eye, double amount)
{
    eye->distance_m = fmin(20, fmax(0.5, eye->distance_m * (1 - 0.1 * amount)));
}

static void on_pad(struct drive_window *w, const struct window_event *e)
{
    if (e->kind == WINDOW_PAD_BUTTON && e->button == PAD_X)
        do_part(w, PART_VIEWPOINT);
    else if (e->kind == WINDOW_PAD_BUTTON && e->button == PAD_Y)
        do_part(w, PART_MAP);
    else if (e->kind == WINDOW_PAD_AXIS && (e->axis == PAD_RIGHT_X || e->axis == PAD_RIGHT_Y))
        turn_view(w, w->shown.map ? DRIVE_MAP : DRIVE_PICTURE, e->axis == PAD_RIGHT_X ? 8 * e->amount : 0,
                  e->axis == PAD_RIGHT_Y ? 8 * e->amount : 0);
}

// One finger turns the view; another one that comes meanwhile does nothing.
static void on_pointer(struct drive_window *w, const struct window_event *e)
{
    if (w->down && e->pointer != w->turning)
        return;
    if (e->kind == WINDOW_POINTER_DOWN) {
        w->down = true;
        w->turning = e->pointer;
        w->pointed = pane_at(w, e->x, e->y);
    } else if (e->kind == WINDOW_POINTER_UP)
        w->down = false;
    else if (w->down)
        turn_view(w, w->pointed, e->x - w->last_x, e->y - w->last_y);
    else
        w->pointed = pane_at(w, e->x, e->y);
    w->last_x = e->x;
    w->last_y = e->y;
}

static void on_event(struct drive_window *w, const struct window_event *event)
{
    struct window_event e = *event;
    enum drive_part tapped;
    e.x /= px_per_dp(w);
    e.y /= px_per_dp(w);
    const bool taken = drive_controls_event(&w->controls, &e, clock_now_ns(), &tapped);
    do_part(w, tapped);
    if (e.kind == WINDOW_HIDDEN || e.kind == WINDOW_UNFOCUSED)
        w->down = false;
    if (taken)
        return;
    switch (e.kind) {
    case WINDOW_QUIT: w->quit = true; return;
    case WINDOW_KEY: on_key(w, e.key); return;
    case WINDOW_PAD_AXIS:
    case WINDOW_PAD_BUTTON: on_pad(w, &e); return;
    case WINDOW_WHEEL: zoom(drive_screen_eye(&w->shown, w->pointed), e.amount); return;
    case WINDOW_POINTER_DOWN:
    case WINDOW_POINTER_UP:
    case WINDOW_POINTER_MOVE: on_pointer(w, &e); return;
    default: return;
    }
}

// The controls lie where the screen is now.
static void place_controls(struct drive_window *w)
{
    int width, height;
    window_size(w->screen, &width, &height);
    drive_controls_place(&w->controls, width / px_per_dp(w), height / px_per_dp(w));
}

// ---------------------------------------------------------------- drawing

static enum status draw(struct drive_window *w)
{
    struct viewer_surface surface = {.quarter_turns = window_quarter_turns(w->screen), .px_per_dp = px_per_dp(w)};
    window_size(w->screen, &surface.width, &surface.height);
    const enum status status = drive_screen_draw(&w->shown, &surface, clock_now_ns());
    if (status == OK)
        window_present(w->screen);
    return status;
}

// The viewpoint follows the tablet; while it is not localised the viewpoint stays.
static void follow_head(struct drive_window *w)
{
    const struct camera_frame *frame = w->feed ? camera_feed_latest(w->feed) : NULL;
    struct drive_session *s = w->session;
    if (!frame || !frame->placed)
        return;
    const struct pose eye = drive_session_viewpoint(s);
    s->eye.body_from_eye = head_tracker_eye(&w->head, frame->world_from_camera, eye.translation);
    s->eye.head = true;
}

static enum status open_window(struct drive_window *w, const struct drive_window_options *how)
{
    const struct window_options screen = {"Reenact", how->size[0], how->size[1], how->fullscreen, 0, how->dpi};
    enum status status = window_open(&w->screen, &screen);
    if (status == OK)
        status = gpu_adopt(&w->gpu);
    if (status == OK)
        status = drive_screen_open(&w->shown, w->gpu, w->session, how->file, how->place);
    w->shown.map = how->map;
    w->shown.controls = &w->controls;
    return status;
}

// What is sent at this moment: a command that moves only while something is held.
static struct drive_command command_now(struct drive_window *w, int64_t now_ns)
{
    const struct drive_readings readings = drive_session_readings(w->session);
    drive_controls_tick(&w->controls, &readings, now_ns);
    return drive_controls_command(&w->controls);
}

// From one image to the next: as often as the display where a graphics card draws; else as often as the stick is sent,
// and half of the time is left to the threads that make depth.
static int64_t step_ns(const struct drive_window *w, int64_t took_ns)
{
    if (w->shown.by_card && !gpu_is_software(w->gpu))
        return (int64_t)(1e9 / window_refresh_hz(w->screen));
    return 2 * took_ns > STEP_NS ? 2 * took_ns : STEP_NS;
}

enum status drive_window_run(struct drive_session *session, const struct drive_window_options *how)
{
    struct drive_window w = {.session = session};
    const struct camera_feed_options feed = {.camera = how->camera, .place = how->place};
    enum status status = open_window(&w, how);
    if (status == OK && how->camera)
        status = camera_feed_open(&w.feed, &feed);
    const int64_t start = clock_now_ns() - session->now_ns;
    int64_t sent = start - STEP_NS;
    struct drive_command was = {0, 0};
    while (status == OK && !w.quit && !command_stopped()) {
        const int64_t before = clock_now_ns();
        place_controls(&w);
        for (struct window_event e; (e = window_wait(w.screen, 0)).kind != WINDOW_NO_EVENT && !w.quit;)
            on_event(&w, &e);
        const struct drive_command now = command_now(&w, before);
        // At once what stops, else as often as it is to be.
        const bool send = before - sent >= STEP_NS || (was.speed != now.speed || was.turn_rate != now.turn_rate);
        sent = send ? before : sent;
        was = now;
        status = drive_session_step(session, before - start, send ? &now : NULL);
        follow_head(&w);
        if (status == OK)
            status = draw(&w);
        w.quit |= how->seconds > 0 && (double)(clock_now_ns() - start) * 1e-9 > how->seconds;
        const int64_t left = step_ns(&w, clock_now_ns() - before) - (clock_now_ns() - before);
        const struct window_event e = window_wait(w.screen, left > 0 ? (int)(left / 1000000) : 0);
        on_event(&w, &e);
    }
    camera_feed_close(&w.feed);
    drive_screen_close(&w.shown);
    gpu_close(&w.gpu);
    window_close(&w.screen);
    return status;
}
