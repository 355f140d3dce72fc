#include "app/commands/drive_window.h"

#include "app/camera/camera_feed.h"
#include "base/clock.h"
#include "platform/gpu_draw2d.h"
#include "platform/window.h"
#include "reenact/render/shaders.h"
#include "reenact/surround/drive/head_tracker.h"
#include "reenact/surround/gpu/operator_picture.h"

// Chosen by hand.
#define FASTEST_M_S    0.5
#define FASTEST_RAD_S  0.8
#define RADIANS_PER_PX 0.006
#define STEP_NS        50000000 // the stick is sent 20 times a second

struct drive_window {
    struct drive_session *session;
    struct window *screen;
    struct gpu *gpu;
    struct gpu_draw2d *draw;
    struct operator_picture *picture; // NULL: the graphics card cannot; then the processor draws
    struct gpu_texture *texture;      // its picture
    struct camera_feed *feed;         // NULL: no head tracker
    struct head_tracker head;
    struct drive_command stick;
    bool down, quit;
    double last_x, last_y;
};

static void turn_view(struct drive_window *w, double dx, double dy)
{
    struct drive_session *s = w->session;
    s->orbit = true;
    s->azimuth -= dx * RADIANS_PER_PX;
    s->elevation = fmin(1.5, fmax(-0.1, s->elevation + dy * RADIANS_PER_PX));
}

static void on_key(struct drive_window *w, int key)
{
    struct drive_session *s = w->session;
    switch (key) {
    case WINDOW_KEY_UP: w->stick.speed = fmin(FASTEST_M_S, w->stick.speed + 0.1); return;
    case WINDOW_KEY_DOWN: w->stick.speed = fmax(-FASTEST_M_S, w->stick.speed - 0.1); return;
    case WINDOW_KEY_LEFT: w->stick.turn_rate = fmin(FASTEST_RAD_S, w->stick.turn_rate + 0.2); return;
    case WINDOW_KEY_RIGHT: w->stick.turn_rate = fmax(-FASTEST_RAD_S, w->stick.turn_rate - 0.2); return;
    case WINDOW_KEY_SPACE: w->stick = (struct drive_command){0, 0}; return;
    case 'c': w->head.centred = false; return;
    case WINDOW_KEY_ESCAPE: w->quit = true; return;
    case '1':
    case '2':
    case '3':
        s->viewpoint = key == '1' ? VIEWPOINT_FIRST : key == '2' ? VIEWPOINT_THIRD : VIEWPOINT_ABOVE;
        s->orbit = false;
        return;
    default: return;
    }
}

static void on_event(struct drive_window *w, const struct window_event *e)
{
    struct drive_session *s = w->session;
    switch (e->kind) {
    case WINDOW_QUIT: w->quit = true; return;
    case WINDOW_KEY: on_key(w, e->key); return;
    case WINDOW_POINTER_DOWN: w->down = true; break;
    case WINDOW_POINTER_UP: w->down = false; break;
    case WINDOW_POINTER_MOVE:
        if (w->down)
            turn_view(w, e->x - w->last_x, e->y - w->last_y);
        break;
    case WINDOW_WHEEL: s->distance_m = fmin(10, fmax(0.5, s->distance_m * (1 - 0.1 * e->amount))); return;
    case WINDOW_PAD_AXIS:
        if (e->axis == PAD_LEFT_Y)
            w->stick.speed = -e->amount * FASTEST_M_S;
        else if (e->axis == PAD_LEFT_X)
            w->stick.turn_rate = -e->amount * FASTEST_RAD_S;
        else if (e->axis == PAD_RIGHT_X || e->axis == PAD_RIGHT_Y)
            turn_view(w, e->axis == PAD_RIGHT_X ? 8 * e->amount : 0, e->axis == PAD_RIGHT_Y ? 8 * e->amount : 0);
        return;
    case WINDOW_PAD_BUTTON:
        if (e->button == PAD_X)
            on_key(w, s->viewpoint == VIEWPOINT_FIRST ? '2' : s->viewpoint == VIEWPOINT_THIRD ? '3' : '1');
        return;
    default: return;
    }
    w->last_x = e->x;
    w->last_y = e->y;
}

// In the middle of the window, as large as fits.
static enum status show(struct drive_window *w, const struct gpu_texture *texture, double aspect)
{
    int width, height;
    const float black[3] = {0, 0, 0};
    window_size(w->screen, &width, &height);
    const double shown = fmin(width, height * aspect);
    const float x = (float)((width - shown) / 2), y = (float)((height - shown / aspect) / 2);
    const float right = (float)width - x, bottom = (float)height - y;
    const struct gpu_draw2d_vertex corners[4] = {{x, y, 0, 0, {255, 255, 255, 255}},
                                                 {right, y, 1, 0, {255, 255, 255, 255}},
                                                 {right, bottom, 1, 1, {255, 255, 255, 255}},
                                                 {x, bottom, 0, 1, {255, 255, 255, 255}}};
    const uint16_t indices[6] = {0, 1, 2, 0, 2, 3};
    const struct gpu_draw2d_batch batch = {texture, 0, 0, (float)width, (float)height, 0, 0, 6};
    const struct gpu_draw2d_list list = {corners, indices, &batch, 4, 6, 1};
    const struct gpu_draw2d_view to = {NULL, width, height, window_quarter_turns(w->screen), black};
    gpu_draw2d_begin(w->draw, &to);
    gpu_draw2d_draw(w->draw, &list);
    const enum status status = gpu_draw2d_end(w->draw);
    window_present(w->screen);
    return status;
}

// In the window's size; in the session's own where the driver draws by the processor.
static enum status draw_by_card(struct drive_window *w)
{
    const struct gpu_texture *texture;
    const struct lens *own = drive_session_lens(w->session);
    int width = own->width, height = own->height;
    if (!gpu_is_software(w->gpu))
        window_size(w->screen, &width, &height);
    const enum status status = operator_picture_draw(w->picture, w->session, width, height, &texture);
    if (status == ERR_DEVICE) { // from now on by the processor
        operator_picture_close(&w->picture);
        return OK;
    }
    return status == OK ? show(w, texture, (double)width / height) : status;
}

static enum status draw_by_processor(struct drive_window *w)
{
    const struct surround_view *view;
    enum status status = drive_session_draw(w->session, &view);
    if (status != OK)
        return status;
    const struct gpu_texture_layout layout = {GPU_RGB8, view->lens.width, view->lens.height, GPU_LINEAR};
    if (w->texture)
        gpu_texture_write(w->texture, view->rgb);
    else
        status = gpu_texture_open(&w->texture, w->gpu, &layout, view->rgb);
    return status == OK ? show(w, w->texture, (double)view->lens.width / view->lens.height) : status;
}

// The viewpoint follows the tablet; while it is not localised the viewpoint stays.
static void follow_head(struct drive_window *w)
{
    const struct camera_frame *frame = w->feed ? camera_feed_latest(w->feed) : NULL;
    struct drive_session *s = w->session;
    if (!frame || !frame->placed)
        return;
    const struct pose eye = drive_session_viewpoint(s);
    s->body_from_eye = head_tracker_eye(&w->head, frame->world_from_camera, eye.translation);
    s->head = true;
}

static enum status open_window(struct drive_window *w)
{
    const struct window_options screen = {"Reenact", 1280, 800, false, 0, 0};
    const struct gpu_draw2d_shaders shaders = {shader_find("draw2d.vert"), shader_find("draw2d.frag")};
    enum status status = window_open(&w->screen, &screen);
    if (status == OK)
        status = gpu_adopt(&w->gpu);
    if (status == OK)
        status = gpu_draw2d_open(&w->draw, w->gpu, &shaders);
    if (status == OK && operator_picture_open(&w->picture, w->gpu) == ERR_MEMORY)
        status = ERR_MEMORY;
    return status;
}

// From one image to the next: as often as the display where a graphics card draws; else as often as the stick is sent,
// and half of the time is left to the threads that make depth.
static int64_t step_ns(const struct drive_window *w, int64_t took_ns)
{
    if (w->picture && !gpu_is_software(w->gpu))
        return (int64_t)(1e9 / window_refresh_hz(w->screen));
    return 2 * took_ns > STEP_NS ? 2 * took_ns : STEP_NS;
}

enum status drive_window_run(struct drive_session *session, const struct drive_window_options *how)
{
    struct drive_window w = {.session = session};
    const struct camera_feed_options feed = {.camera = how->camera, .place = how->place};
    enum status status = open_window(&w);
    if (status == OK && how->camera)
        status = camera_feed_open(&w.feed, &feed);
    const int64_t start = clock_now_ns() - session->now_ns;
    int64_t sent = start - STEP_NS;
    while (status == OK && !w.quit) {
        const int64_t before = clock_now_ns();
        for (struct window_event e; (e = window_wait(w.screen, 0)).kind != WINDOW_NO_EVENT && !w.quit;)
            on_event(&w, &e);
        const bool send = before - sent >= STEP_NS;
        sent = send ? before : sent;
        status = drive_session_step(session, before - start, send ? &w.stick : NULL);
        follow_head(&w);
        if (status == OK)
            status = w.picture ? draw_by_card(&w) : draw_by_processor(&w);
        w.quit |= how->seconds > 0 && (double)(clock_now_ns() - start) * 1e-9 > how->seconds;
        const int64_t left = step_ns(&w, clock_now_ns() - before) - (clock_now_ns() - before);
        const struct window_event e = window_wait(w.screen, left > 0 ? (int)(left / 1000000) : 0);
        on_event(&w, &e);
    }
    camera_feed_close(&w.feed);
    operator_picture_close(&w.picture);
    gpu_texture_close(&w.texture);
    gpu_draw2d_close(&w.draw);
    gpu_close(&w.gpu);
    window_close(&w.screen);
    return status;
}
