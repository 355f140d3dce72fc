#include "app/commands/drive_window.h"

#include "app/camera/camera_feed.h"
#include "app/commands/command.h"
#include "app/drive/drive_screen.h"
#include "base/clock.h"
#include "platform/window.h"
#include "reenact/surround/drive/head_tracker.h"

// Chosen by hand.
#define FASTEST_M_S    0.5
#define FASTEST_RAD_S  0.8
#define RADIANS_PER_PX 0.006
#define STEP_NS        50000000 // the stick is sent 20 times a second

struct drive_window {
    struct drive_session *session;
    struct window *screen;
    struct gpu *gpu;
    struct drive_screen shown;
    struct camera_feed *feed; // NULL: no head tracker
    struct head_tracker head;
    struct drive_command stick;
    bool down, quit;
    int pointed; // the pane on which the pointer is, or went down
    double last_x, last_y;
};

static int pane_at(const struct drive_window *w, double x, double y)
{
    int width, height;
    window_size(w->screen, &width, &height);
    const struct ui_box map = drive_screen_box(&w->shown, width, height, DRIVE_MAP);
    return w->shown.map && x >= map.x && y >= map.y ? DRIVE_MAP : DRIVE_PICTURE;
}

static void turn_view(struct drive_window *w, int pane, double dx, double dy)
{
    struct drive_eye *eye = drive_screen_eye(&w->shown, pane);
    eye->orbit = true;
    eye->azimuth -= dx * RADIANS_PER_PX;
    eye->elevation = fmin(1.5, fmax(-0.1, eye->elevation + dy * RADIANS_PER_PX));
}

static void on_key(struct drive_window *w, int key)
{
    struct drive_eye *eye = &w->session->eye;
    switch (key) {
    case WINDOW_KEY_UP: w->stick.speed = fmin(FASTEST_M_S, w->stick.speed + 0.1); return;
    case WINDOW_KEY_DOWN: w->stick.speed = fmax(-FASTEST_M_S, w->stick.speed - 0.1); return;
    case WINDOW_KEY_LEFT: w->stick.turn_rate = fmin(FASTEST_RAD_S, w->stick.turn_rate + 0.2); return;
    case WINDOW_KEY_RIGHT: w->stick.turn_rate = fmax(-FASTEST_RAD_S, w->stick.turn_rate - 0.2); return;
    case WINDOW_KEY_SPACE: w->stick = (struct drive_command){0, 0}; return;
    case 'c': w->head.centred = false; return;
    case 'm':
        w->shown.map = !w->shown.map;
        w->pointed = DRIVE_PICTURE; // until the pointer moves
        w->down = false;
        return;
    case WINDOW_KEY_ESCAPE: w->quit = true; return;
    case '1':
    case '2':
    case '3':
        eye->viewpoint = key == '1' ? VIEWPOINT_FIRST : key == '2' ? VIEWPOINT_THIRD : VIEWPOINT_ABOVE;
        eye->orbit = false;
        return;
    default: return;
    }
}

static void zoom(struct drive_eye *eye, double amount)
{
    eye->distance_m = fmin(20, fmax(0.5, eye->distance_m * (1 - 0.1 * amount)));
}

static void on_pad(struct drive_window *w, const struct window_event *e)
{
    const enum viewpoint now = w->session->eye.viewpoint;
    if (e->kind == WINDOW_PAD_BUTTON && e->button == PAD_X)
        on_key(w, now == VIEWPOINT_FIRST ? '2' : now == VIEWPOINT_THIRD ? '3' : '1');
    else if (e->kind == WINDOW_PAD_BUTTON && e->button == PAD_Y)
        on_key(w, 'm');
    else if (e->kind == WINDOW_PAD_BUTTON)
        return;
    else if (e->axis == PAD_LEFT_Y)
        w->stick.speed = -e->amount * FASTEST_M_S;
    else if (e->axis == PAD_LEFT_X)
        w->stick.turn_rate = -e->amount * FASTEST_RAD_S;
    else if (e->axis == PAD_RIGHT_X || e->axis == PAD_RIGHT_Y)
        turn_view(w, w->shown.map ? DRIVE_MAP : DRIVE_PICTURE, e->axis == PAD_RIGHT_X ? 8 * e->amount : 0,
                  e->axis == PAD_RIGHT_Y ? 8 * e->amount : 0);
}

static void on_event(struct drive_window *w, const struct window_event *e)
{
    switch (e->kind) {
    case WINDOW_QUIT: w->quit = true; return;
    case WINDOW_HIDDEN: w->stick = (struct drive_command){0, 0}; return; // the operator sees nothing
    case WINDOW_KEY: on_key(w, e->key); return;
    case WINDOW_PAD_AXIS:
    case WINDOW_PAD_BUTTON: on_pad(w, e); return;
    case WINDOW_WHEEL: zoom(drive_screen_eye(&w->shown, w->pointed), e->amount); return;
    case WINDOW_POINTER_DOWN:
        w->down = true;
        w->pointed = pane_at(w, e->x, e->y);
        break;
    case WINDOW_POINTER_UP: w->down = false; break;
    case WINDOW_POINTER_MOVE:
        if (w->down)
            turn_view(w, w->pointed, e->x - w->last_x, e->y - w->last_y);
        else
            w->pointed = pane_at(w, e->x, e->y);
        break;
    default: return;
    }
    w->last_x = e->x;
    w->last_y = e->y;
}

// ---------------------------------------------------------------- drawing

static enum status draw(struct drive_window *w)
{
    struct viewer_surface surface = {.quarter_turns = window_quarter_turns(w->screen),
                                     .px_per_dp = viewer_px_per_dp(window_dpi(w->screen))};
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
    const struct window_options screen = {"Reenact", 1280, 800, false, 0, 0};
    enum status status = window_open(&w->screen, &screen);
    if (status == OK)
        status = gpu_adopt(&w->gpu);
    if (status == OK)
        status = drive_screen_open(&w->shown, w->gpu, w->session, how->file, how->place);
    w->shown.map = how->map;
    return status;
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
    while (status == OK && !w.quit && !command_stopped()) {
        const int64_t before = clock_now_ns();
        for (struct window_event e; (e = window_wait(w.screen, 0)).kind != WINDOW_NO_EVENT && !w.quit;)
            on_event(&w, &e);
        const bool send = before - sent >= STEP_NS;
        sent = send ? before : sent;
        status = drive_session_step(session, before - start, send ? &w.stick : NULL);
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
