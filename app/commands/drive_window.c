#include "app/commands/drive_window.h"

#include "app/camera/camera_feed.h"
#include "app/commands/command.h"
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

enum { PICTURE, MAP, PANES };

// A part of the window with a picture of its own.
struct pane {
    struct operator_picture *picture; // NULL: not opened yet, or the processor draws
    struct gpu_texture *texture;      // the processor's picture
    const struct gpu_texture *shown;  // either's; NULL: none yet
    double aspect;                    // of what is shown
};

struct rect {
    double x, y, width, height;
};

struct drive_window {
    struct drive_session *session;
    struct window *screen;
    struct gpu *gpu;
    struct gpu_draw2d *draw;
    struct pane pane[PANES];
    bool by_card;             // false: the graphics card cannot; the processor draws
    bool map;                 // shown beside the picture
    struct drive_eye map_eye; // from where
    struct camera_feed *feed; // NULL: no head tracker
    struct head_tracker head;
    struct drive_command stick;
    bool down, quit;
    int pointed; // the pane on which the pointer is, or went down
    double last_x, last_y;
};

// The map is beside the picture, or below it where the window is upright.
static struct rect rect_of(const struct drive_window *w, int pane)
{
    int width, height;
    window_size(w->screen, &width, &height);
    const double share = w->map ? 0.5 : 1, first = pane == MAP ? 0.5 : 0;
    return width >= height ? (struct rect){first * width, 0, share * width, height}
                           : (struct rect){0, first * height, width, share * height};
}

static int pane_at(const struct drive_window *w, double x, double y)
{
    const struct rect r = rect_of(w, MAP);
    return w->map && x >= r.x && y >= r.y ? MAP : PICTURE;
}

static struct drive_eye *eye_of(struct drive_window *w, int pane)
{
    return pane == MAP ? &w->map_eye : &w->session->eye;
}

static void turn_view(struct drive_window *w, int pane, double dx, double dy)
{
    struct drive_eye *eye = eye_of(w, pane);
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
        w->map = !w->map;
        w->pointed = PICTURE; // until the pointer moves
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
        turn_view(w, w->map ? MAP : PICTURE, e->axis == PAD_RIGHT_X ? 8 * e->amount : 0,
                  e->axis == PAD_RIGHT_Y ? 8 * e->amount : 0);
}

static void on_event(struct drive_window *w, const struct window_event *e)
{
    switch (e->kind) {
    case WINDOW_QUIT: w->quit = true; return;
    case WINDOW_KEY: on_key(w, e->key); return;
    case WINDOW_PAD_AXIS:
    case WINDOW_PAD_BUTTON: on_pad(w, e); return;
    case WINDOW_WHEEL: zoom(eye_of(w, w->pointed), e->amount); return;
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

// In the middle of its pane, as large as fits.
static enum status show(struct drive_window *w)
{
    const float black[3] = {0, 0, 0};
    struct gpu_draw2d_vertex corners[4 * PANES];
    struct gpu_draw2d_batch batches[PANES];
    uint16_t indices[6 * PANES];
    int width, height, count = 0;
    window_size(w->screen, &width, &height);
    for (int k = 0; k < (w->map ? PANES : 1); k++) {
        const struct pane *p = &w->pane[k];
        const struct rect r = rect_of(w, k);
        if (!p->shown)
            continue;
        const double shown = fmin(r.width, r.height * p->aspect);
        const float x = (float)(r.x + (r.width - shown) / 2), y = (float)(r.y + (r.height - shown / p->aspect) / 2);
        const float right = x + (float)shown, bottom = y + (float)(shown / p->aspect);
        const float at[4][4] = {{x, y, 0, 0}, {right, y, 1, 0}, {right, bottom, 1, 1}, {x, bottom, 0, 1}};
        static const uint16_t order[6] = {0, 1, 2, 0, 2, 3};
        for (int i = 0; i < 4; i++)
            corners[4 * count + i] =
                (struct gpu_draw2d_vertex){at[i][0], at[i][1], at[i][2], at[i][3], {255, 255, 255, 255}};
        for (int i = 0; i < 6; i++)
            indices[6 * count + i] = (uint16_t)(4 * count + order[i]);
        batches[count] = (struct gpu_draw2d_batch){p->shown, 0, 0, (float)width, (float)height, 0, 6 * count, 6};
        count++;
    }
    const struct gpu_draw2d_list list = {corners, indices, batches, 4 * count, 6 * count, count};
    const struct gpu_draw2d_view to = {NULL, width, height, window_quarter_turns(w->screen), black};
    gpu_draw2d_begin(w->draw, &to);
    gpu_draw2d_draw(w->draw, &list);
    const enum status status = gpu_draw2d_end(w->draw);
    window_present(w->screen);
    return status;
}

// In the pane's size; in the session's own where the driver draws by the processor.
static enum status draw_by_card(struct drive_window *w, int pane)
{
    struct pane *p = &w->pane[pane];
    const struct lens *own = drive_session_lens(w->session);
    const struct rect r = rect_of(w, pane);
    const bool small = gpu_is_software(w->gpu);
    const int width = small ? own->width : (int)r.width, height = small ? own->height : (int)r.height;
    enum status status = p->picture ? OK : operator_picture_open(&p->picture, w->gpu);
    if (status == OK)
        status = operator_picture_draw(p->picture, w->session, width, height, &p->shown);
    p->aspect = (double)width / height;
    if (status != ERR_DEVICE)
        return status;
    w->by_card = false; // from now on by the processor
    for (int k = 0; k < PANES; k++) {
        operator_picture_close(&w->pane[k].picture);
        w->pane[k].shown = NULL;
    }
    return OK;
}

static enum status draw_by_processor(struct drive_window *w, int pane)
{
    struct pane *p = &w->pane[pane];
    const struct surround_view *view;
    enum status status = drive_session_draw(w->session, &view);
    if (status != OK)
        return status;
    const struct gpu_texture_layout layout = {GPU_RGB8, view->lens.width, view->lens.height, GPU_LINEAR};
    if (p->texture)
        gpu_texture_write(p->texture, view->rgb);
    else
        status = gpu_texture_open(&p->texture, w->gpu, &layout, view->rgb);
    p->shown = p->texture;
    p->aspect = (double)view->lens.width / view->lens.height;
    return status;
}

static enum status draw(struct drive_window *w)
{
    const struct drive_eye eye = w->session->eye;
    enum status status = OK;
    for (int k = 0; k < (w->map ? PANES : 1) && status == OK; k++) {
        w->session->eye = k == MAP ? w->map_eye : eye;
        status = w->by_card ? draw_by_card(w, k) : draw_by_processor(w, k);
    }
    w->session->eye = eye;
    return status == OK ? show(w) : status;
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

static enum status open_window(struct drive_window *w)
{
    const struct window_options screen = {"Reenact", 1280, 800, false, 0, 0};
    const struct gpu_draw2d_shaders shaders = {shader_find("draw2d.vert"), shader_find("draw2d.frag")};
    enum status status = window_open(&w->screen, &screen);
    if (status == OK)
        status = gpu_adopt(&w->gpu);
    if (status == OK)
        status = gpu_draw2d_open(&w->draw, w->gpu, &shaders);
    return status;
}

// From one image to the next: as often as the display where a graphics card draws; else as often as the stick is sent,
// and half of the time is left to the threads that make depth.
static int64_t step_ns(const struct drive_window *w, int64_t took_ns)
{
    if (w->by_card && !gpu_is_software(w->gpu))
        return (int64_t)(1e9 / window_refresh_hz(w->screen));
    return 2 * took_ns > STEP_NS ? 2 * took_ns : STEP_NS;
}

enum status drive_window_run(struct drive_session *session, const struct drive_window_options *how)
{
    struct drive_window w = {.session = session,
                             .by_card = true,
                             .map = how->map,
                             .map_eye = {.orbit = true, .elevation = 1.1, .distance_m = 5}}; // chosen by hand
    const struct camera_feed_options feed = {.camera = how->camera, .place = how->place};
    enum status status = open_window(&w);
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
    for (int k = 0; k < PANES; k++) {
        operator_picture_close(&w.pane[k].picture);
        gpu_texture_close(&w.pane[k].texture);
    }
    gpu_draw2d_close(&w.draw);
    gpu_close(&w.gpu);
    window_close(&w.screen);
    return status;
}
