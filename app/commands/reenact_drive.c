// reenact drive: drive a robot by free-viewpoint pictures of its surroundings.
#include "app/camera/camera_feed.h"
#include "app/commands/command.h"
#include "app/commands/commands.h"
#include "app/commands/place_input.h"
#include "app/drive/drive_screen.h"
#include "app/place/robot_place.h"
#include "base/clock.h"
#include "platform/files/file.h"
#include "platform/files/json.h"
#include "platform/files/png.h"
#include "platform/screen/window.h"
#include "recording/place.h"
#include "recording/recorded_things.h"
#include "recording/recording.h"
#include "surround/drive/drive_session.h"
#include "surround/drive/robot_motion.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

// ---------------------------------------------------------------- drive window, types

// reenact drive's window: the controls of app/drive/drive_controls.h; a finger beside them turns the viewpoint, the
// wheel brings it nearer; 1, 2, 3 (pad: X) choose first person, third person and from above; M (pad: Y) shows the map,
// the same surroundings with the path driven from a viewpoint of its own, beside the picture, and what is known of a
// recorded place in which the robot is (app/drive/drive_screen.h); with a camera the tablet's own way turns and moves
// the picture's viewpoint, and C centres that. Main thread: while it does not run, nothing is sent, and a robot with a
// watchdog stops.

struct drive_window_options {
    double seconds;            // leave after this time; 0: when the window is closed
    const char *camera;        // URI of the tablet's camera, the head tracker; NULL: none
    const char *file;          // a recording in whose place the robot and the tablet are; NULL: none
    const struct place *place; // that place; borrowed; with file
    bool map;                  // shown from the start
    bool fullscreen;
    int size[2]; // of the window, pixels
    double dpi;  // 0: the screen's own
};

// ---------------------------------------------------------------- drive window

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

static double px_per_dp(const struct drive_window *window) { return viewer_px_per_dp(window_dpi(window->screen)); }

static int pane_at(const struct drive_window *window, double x, double y)
{
    const struct ui_box map =
        drive_screen_box(&window->shown, window->controls.width, window->controls.height, DRIVE_MAP);
    return window->shown.map && x >= map.x && y >= map.y ? DRIVE_MAP : DRIVE_PICTURE;
}

static void turn_view(struct drive_window *window, int pane, double dx, double dy)
{
    struct drive_eye *eye = drive_screen_eye(&window->shown, pane);
    eye->orbit = true;
    eye->azimuth -= dx * RADIANS_PER_DP;
    eye->elevation = fmin(1.5, fmax(-0.1, eye->elevation + dy * RADIANS_PER_DP));
}

static void look_from(struct drive_window *window, enum viewpoint from)
{
    window->session->eye.viewpoint = from;
    window->session->eye.orbit = false;
}

static void do_part(struct drive_window *window, enum drive_part part)
{
    switch (part) {
    case PART_LEAVE: window->quit = true; return;
    case PART_VIEWPOINT: look_from(window, (enum viewpoint)((window->session->eye.viewpoint + 1) % 3)); return;
    case PART_MAP:
        window->shown.map = !window->shown.map;
        window->pointed = DRIVE_PICTURE; // until the pointer moves
        window->down = false;
        return;
    default: return;
    }
}

static void on_key(struct drive_window *window, int key)
{
    switch (key) {
    case 'c': window->head.centred = false; return;
    case 'm': do_part(window, PART_MAP); return;
    case '1': look_from(window, VIEWPOINT_FIRST); return;
    case '2': look_from(window, VIEWPOINT_THIRD); return;
    case '3': look_from(window, VIEWPOINT_ABOVE); return;
    default: return;
    }
}

static void zoom_eye(struct drive_eye *eye, double amount)
{
    eye->distance_m = fmin(20, fmax(0.5, eye->distance_m * (1 - 0.1 * amount)));
}

static void on_pad(struct drive_window *window, const struct window_event *event)
{
    if (event->kind == WINDOW_PAD_BUTTON && event->button == PAD_X)
        do_part(window, PART_VIEWPOINT);
    else if (event->kind == WINDOW_PAD_BUTTON && event->button == PAD_Y)
        do_part(window, PART_MAP);
    else if (event->kind == WINDOW_PAD_AXIS && (event->axis == PAD_RIGHT_X || event->axis == PAD_RIGHT_Y))
        turn_view(window, window->shown.map ? DRIVE_MAP : DRIVE_PICTURE,
                  event->axis == PAD_RIGHT_X ? 8 * event->amount : 0,
                  event->axis == PAD_RIGHT_Y ? 8 * event->amount : 0);
}

// One finger turns the view; another one that comes meanwhile does nothing.
static void on_pointer(struct drive_window *window, const struct window_event *event)
{
    if (window->down && event->pointer != window->turning)
        return;
    if (event->kind == WINDOW_POINTER_DOWN) {
        window->down = true;
        window->turning = event->pointer;
        window->pointed = pane_at(window, event->x, event->y);
    } else if (event->kind == WINDOW_POINTER_UP)
        window->down = false;
    else if (window->down)
        turn_view(window, window->pointed, event->x - window->last_x, event->y - window->last_y);
    else
        window->pointed = pane_at(window, event->x, event->y);
    window->last_x = event->x;
    window->last_y = event->y;
}

static void on_event(struct drive_window *window, const struct window_event *event)
{
    struct window_event e = *event;
    enum drive_part tapped;
    e.x /= px_per_dp(window);
    e.y /= px_per_dp(window);
    const bool taken = drive_controls_event(&window->controls, &e, clock_now_ns(), &tapped);
    do_part(window, tapped);
    if (e.kind == WINDOW_HIDDEN || e.kind == WINDOW_UNFOCUSED)
        window->down = false;
    if (taken)
        return;
    switch (e.kind) {
    case WINDOW_QUIT: window->quit = true; return;
    case WINDOW_KEY: on_key(window, e.key); return;
    case WINDOW_PAD_AXIS:
    case WINDOW_PAD_BUTTON: on_pad(window, &e); return;
    case WINDOW_WHEEL: zoom_eye(drive_screen_eye(&window->shown, window->pointed), e.amount); return;
    case WINDOW_POINTER_DOWN:
    case WINDOW_POINTER_UP:
    case WINDOW_POINTER_MOVE: on_pointer(window, &e); return;
    default: return;
    }
}

// The controls lie where the screen is now.
static void place_controls(struct drive_window *window)
{
    int width, height;
    window_size(window->screen, &width, &height);
    drive_controls_place(&window->controls, width / px_per_dp(window), height / px_per_dp(window));
}

// ---------------------------------------------------------------- drawing

static enum status draw_window(struct drive_window *window)
{
    struct viewer_surface surface = {.quarter_turns = window_quarter_turns(window->screen),
                                     .px_per_dp = px_per_dp(window)};
    window_size(window->screen, &surface.width, &surface.height);
    const enum status status = drive_screen_draw(&window->shown, &surface, clock_now_ns());
    if (status == OK)
        window_present(window->screen);
    return status;
}

// The viewpoint follows the tablet; while it is not localised the viewpoint stays.
static void follow_head(struct drive_window *window)
{
    const struct camera_frame *frame = window->feed ? camera_feed_latest(window->feed) : NULL;
    struct drive_session *s = window->session;
    if (!frame || !frame->placed)
        return;
    const struct pose eye = drive_session_viewpoint(s);
    s->eye.body_from_eye = head_tracker_eye(&window->head, frame->world_from_camera, eye.translation);
    s->eye.head = true;
}

static enum status open_window(struct drive_window *window, const struct drive_window_options *how)
{
    const struct window_options screen = {"Reenact", how->size[0], how->size[1], how->fullscreen, 0, how->dpi};
    enum status status = window_open(&window->screen, &screen);
    if (status == OK)
        status = gpu_adopt(&window->gpu);
    if (status == OK)
        status = drive_screen_open(&window->shown, window->gpu, window->session, how->file, how->place);
    window->shown.map = how->map;
    window->shown.controls = &window->controls;
    return status;
}

// What is sent at this moment: a command that moves only while something is held.
static struct drive_command command_now(struct drive_window *window, int64_t now_ns)
{
    const struct drive_readings readings = drive_session_readings(window->session);
    drive_controls_tick(&window->controls, &readings, now_ns);
    return drive_controls_command(&window->controls);
}

// From one image to the next: as often as the display where a graphics card draws; else as often as the stick is sent,
// and half of the time is left to the threads that make depth.
static int64_t step_ns(const struct drive_window *window, int64_t took_ns)
{
    if (window->shown.by_card && !gpu_is_software(window->gpu))
        return (int64_t)(1e9 / window_refresh_hz(window->screen));
    return 2 * took_ns > STEP_NS ? 2 * took_ns : STEP_NS;
}

// ERR_DEVICE: no screen.
static enum status drive_window_run(struct drive_session *session, const struct drive_window_options *how)
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
            status = draw_window(&w);
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

// ---------------------------------------------------------------- reenact drive

enum { MAX_REMAPS = 16 };

struct drive_arguments {
    const char *uri, *out, *camera, *file;
    const char *remap[MAX_REMAPS + 1];
    int remaps;
    bool json, map, keep, fullscreen;
    int size[2];
    double dpi;
    double seconds, every_s;
    struct drive_options options;
};

enum {
    KEY_DELAY = COMMAND_KEY,
    KEY_LOSS,
    KEY_OUT,
    KEY_EVERY,
    KEY_SECONDS,
    KEY_CALIBRATION,
    KEY_REMAP,
    KEY_CAMERA,
    KEY_MAP,
    KEY_KEEP,
    KEY_FULLSCREEN,
    KEY_SIZE,
    KEY_DPI,
    KEY_JSON
};

static const struct argp_option options[] = {
    {"delay", KEY_DELAY, "S", 0, "the link's delay, one way (default 0)", 0},
    {"loss", KEY_LOSS, "SHARE", 0, "share of packets that the link loses, 0 to 1 (default 0)", 0},
    {"out", KEY_OUT, "DIR", 0, "instead of a window, write the operator's pictures NNNN.png here", 0},
    {"every", KEY_EVERY, "S", 0, "with --out, seconds from one picture to the next (default 1)", 0},
    {"seconds", KEY_SECONDS, "S", 0, "leave after this time", 0},
    {"calibration", KEY_CALIBRATION, "FILE", 0,
     "with ros: the robot's lenses, where its cameras are, its size, like calibration.json of a folder of captures", 0},
    {"remap", KEY_REMAP, "FROM:=TO", 0, "with ros: another name of a topic, as odom:=/base/odometry; may be repeated",
     0},
    {"camera", KEY_CAMERA, "URI", 0,
     "the tablet's own camera, localised in FILE's place: its way moves and turns the viewpoint", 0},
    {"map", KEY_MAP, NULL, 0, "show the map with the path driven beside the picture from the start (M)", 0},
    {"keep", KEY_KEEP, NULL, 0,
     "the robot drives in FILE's place: keep there where it was driven, which reenact FILE shows in its map", 0},
    {"fullscreen", KEY_FULLSCREEN, NULL, 0, "fill the screen", 0},
    {"size", KEY_SIZE, "WxH", 0, "of the window, pixels (default 1280x800)", 0},
    {"dpi", KEY_DPI, "N", 0, "pixels an inch, where the screen itself does not say", 0},
    COMMAND_OPTION_JSON(KEY_JSON),
    {0},
};

// What would be left out without a word.
static void refuse_contradictions(const struct argp_state *state, const struct drive_arguments *arguments)
{
    if (arguments->out && (arguments->camera || arguments->map))
        argp_error(state, "--camera and --map go with the window, not with --out");
    if ((arguments->options.calibration || arguments->remaps) && strncmp(arguments->uri, "ros:", 4))
        argp_error(state, "--calibration and --remap go with ros:");
}

static error_t parse_option(int key, char *value, struct argp_state *state)
{
    struct drive_arguments *a = state->input;
    switch (key) {
    case KEY_DELAY: a->options.link.delay_s = command_parse_number(state, "--delay", value, 0, 60); return 0;
    case KEY_LOSS: a->options.link.loss = command_parse_number(state, "--loss", value, 0, 1); return 0;
    case KEY_OUT: a->out = value; return 0;
    case KEY_EVERY: a->every_s = command_parse_number(state, "--every", value, 0.01, 1e4); return 0;
    case KEY_SECONDS: a->seconds = command_parse_number(state, "--seconds", value, 0.01, 1e6); return 0;
    case KEY_JSON: a->json = true; return 0;
    case KEY_CALIBRATION: a->options.calibration = value; return 0;
    case KEY_CAMERA: a->camera = value; return 0;
    case KEY_MAP: a->map = true; return 0;
    case KEY_KEEP: a->keep = true; return 0;
    case KEY_FULLSCREEN: a->fullscreen = true; return 0;
    case KEY_SIZE: command_parse_size(state, "--size", value, 320, 8192, a->size); return 0;
    case KEY_DPI: a->dpi = command_parse_number(state, "--dpi", value, 50, 1000); return 0;
    case KEY_REMAP:
        if (a->remaps == MAX_REMAPS)
            argp_error(state, "at most %d topics are renamed", MAX_REMAPS);
        a->remap[a->remaps++] = value;
        return 0;
    case ARGP_KEY_ARG: command_take_file(state, a->uri ? &a->file : &a->uri, value); return 0;
    case ARGP_KEY_END:
        command_require(state, a->uri, "URI");
        if (a->camera)
            command_require(state, a->file, "FILE, in whose place the camera is,");
        if (a->keep)
            command_require(state, a->file, "FILE, in whose place the robot drives,");
        refuse_contradictions(state, a);
        return 0;
    default: return ARGP_ERR_UNKNOWN;
    }
}

// Twenty commands a second; a robot of a ROS master is driven in real time.
static enum status step_to(struct drive_session *session, int64_t to_ns)
{
    const struct drive_command ahead = {0.2, 0.1}, stop = {0, 0};
    const int64_t tick_ns = 50000000, start_ns = clock_now_ns() - session->now_ns;
    enum status status = OK;
    const bool real = session->kind == DRIVE_ROS;
    for (int64_t t = session->now_ns; status == OK && t < to_ns && !command_stopped(); t += tick_ns) {
        if (real)
            clock_sleep_until_ns(start_ns + t);
        status = drive_session_step(session, t, real && t < 1000000000 ? &stop : &ahead);
    }
    return status == OK && !real ? drive_session_step(session, to_ns, &ahead) : status;
}

// What was written, and how far the robot came.
static enum status report_pictures(const struct drive_arguments *arguments, const struct drive_session *session,
                                   int pictures)
{
    double way_m = 0;
    for (int i = 1; i < session->path.count; i++)
        way_m += v3_distance(session->path.at[i - 1], session->path.at[i]);
    if (!arguments->json) {
        printf("%s: %d pictures, %.1f s, %.2f m driven\n", arguments->out, pictures, (double)session->now_ns * 1e-9,
               way_m);
        return OK;
    }
    struct json *root;
    const enum status status = command_begin_json(&root);
    if (status != OK)
        return status;
    json_add_string(root, "out", arguments->out);
    json_add_number(root, "pictures", pictures);
    json_add_number(root, "seconds", (double)session->now_ns * 1e-9);
    json_add_number(root, "driven_m", way_m);
    return command_print_json(&root);
}

static enum status write_pictures(const struct drive_arguments *arguments, struct drive_session *session)
{
    int pictures = 0;
    enum status status = folder_make(arguments->out);
    const int64_t every_ns = (int64_t)(arguments->every_s * 1e9);
    for (int i = 0; status == OK && !command_stopped() && !session->ended; i++) {
        const struct surround_view *view;
        char path[4096];
        if (arguments->seconds > 0 && (double)i * arguments->every_s > arguments->seconds)
            break;
        status = step_to(session, i * every_ns);
        if (status == OK)
            status = drive_session_draw(session, &view);
        snprintf(path, sizeof path, "%s/%04d.png", arguments->out, i);
        if (status == OK && file_exists(path))
            status = fail(ERR_EXISTS, "%s is there already; choose another --out", path);
        if (status == OK)
            status = png_write(path, PNG_RGB8, view->rgb, view->lens.width, view->lens.height);
        pictures += status == OK;
    }
    return status == OK ? report_pictures(arguments, session, pictures) : status;
}

static enum status keep_drive(const struct drive_session *session, const struct place *place, const char *file)
{
    const struct surroundings *seen = drive_session_surroundings(session);
    struct recorded_drive drive = {.path_count = session->path.count};
    struct pose place_from_world;
    enum status status = robot_place_find(seen->pictures, seen->taken, place, &place_from_world);
    if (status == NOTHING)
        return fail(ERR_INPUT,
                    "the robot's pictures show too little of the place of %s; where it was driven is not kept", file);
    if (status != OK)
        return status;
    _Static_assert((int)DRIVE_PATH_POINTS == (int)RECORDED_DRIVE_POINTS, "the whole path");
    for (int i = 0; i < 3; i++)
        drive.size_m[i] = drive_session_size(session)[i];
    drive.world_from_body = pose_multiply(place_from_world, drive_session_pose(session));
    for (int i = 0; i < drive.path_count; i++)
        drive.path[i] = pose_apply(place_from_world, session->path.at[i]);
    return recording_write_drive(file, &drive);
}

int reenact_drive(int argc, char **argv)
{
    struct drive_arguments arguments = {.every_s = 1, .size = {1280, 800}, .options = drive_default_options()};
    static const struct argp argp = {
        options,
        parse_option,
        "URI [FILE]",
        "Drives a robot by free-viewpoint pictures of its surroundings.\v"
        "URI is sim: (a simulated robot; sim:1 a straight passage, sim:2 a bent one, sim:3 a wall), folder:DIR (a "
        "robot's captures, played in real time), or ros: or ros:http://HOST:PORT (a robot on a ROS master: topics "
        "panorama, depth_front, depth_left, depth_back, depth_right, odom; cmd_vel). Arrow keys, the stick on the "
        "screen and a game pad's drive while they are held; STOP, space and Escape "
        "stop; a finger elsewhere turns the viewpoint; "
        "1, 2 and 3 choose first person, third person and from above; M shows the map beside the picture.\n\n"
        "FILE is a recording of the room in which the robot drives: the map then shows its things, its tags and its "
        "actor, once the robot's pictures show enough of the place.",
        NULL,
        NULL,
        NULL};
    command_parse(&argp, argc, argv, &arguments);
    command_catch_signals();
    struct drive_session session;
    struct place place = {0};
    arguments.options.remap = arguments.remap;
    arguments.options.threads = !arguments.out || !strncmp(arguments.uri, "ros:", 4);
    enum status status = arguments.keep ? recording_check_change(arguments.file) : OK;
    if (status == OK && arguments.file)
        status = place_input_read_map(arguments.file, &place);
    if (status == NOTHING)
        status = fail(ERR_INPUT, "%s holds no place to localise %s in", arguments.file,
                      arguments.camera ? "the camera" : "the robot");
    if (status == OK)
        status = drive_session_open(&session, arguments.uri, &arguments.options);
    if (status == OK) {
        const struct drive_window_options window = {.seconds = arguments.seconds,
                                                    .camera = arguments.camera,
                                                    .file = arguments.file,
                                                    .place = &place,
                                                    .map = arguments.map,
                                                    .fullscreen = arguments.fullscreen,
                                                    .size = {arguments.size[0], arguments.size[1]},
                                                    .dpi = arguments.dpi};
        status = arguments.out ? write_pictures(&arguments, &session) : drive_window_run(&session, &window);
        if (status == OK && arguments.keep)
            status = keep_drive(&session, &place, arguments.file);
        drive_session_close(&session);
    }
    place_free(&place);
    return status == OK ? 0 : command_failed(argv[0]);
}
