// reenact drive: drive a robot by free-viewpoint pictures of its surroundings.
#include "app/commands/commands.h"

#include "app/commands/drive_window.h"
#include "app/commands/place_input.h"
#include "base/clock.h"
#include "app/place/robot_place.h"
#include "recording/recorded_drive.h"
#include "recording/recording.h"
#include "surround/drive/drive_session.h"
#include "platform/files/file.h"
#include "platform/files/json.h"
#include "platform/files/png.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { MOST_REMAPS = 16 };

struct drive_arguments {
    const char *uri, *out, *camera, *file;
    const char *remap[MOST_REMAPS + 1];
    int remaps;
    bool json, map, keep, fullscreen;
    int size[2];
    double dpi;
    double seconds, every_s;
    struct drive_options how;
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
static void refuse_contradictions(const struct argp_state *state, const struct drive_arguments *a)
{
    if (a->out && (a->camera || a->map))
        argp_error(state, "--camera and --map go with the window, not with --out");
    if ((a->how.calibration || a->remaps) && strncmp(a->uri, "ros:", 4))
        argp_error(state, "--calibration and --remap go with ros:");
}

static error_t parse(int key, char *value, struct argp_state *state)
{
    struct drive_arguments *a = state->input;
    switch (key) {
    case KEY_DELAY: a->how.link.delay_s = command_parse_number(state, "--delay", value, 0, 60); return 0;
    case KEY_LOSS: a->how.link.loss = command_parse_number(state, "--loss", value, 0, 1); return 0;
    case KEY_OUT: a->out = value; return 0;
    case KEY_EVERY: a->every_s = command_parse_number(state, "--every", value, 0.01, 1e4); return 0;
    case KEY_SECONDS: a->seconds = command_parse_number(state, "--seconds", value, 0.01, 1e6); return 0;
    case KEY_JSON: a->json = true; return 0;
    case KEY_CALIBRATION: a->how.calibration = value; return 0;
    case KEY_CAMERA: a->camera = value; return 0;
    case KEY_MAP: a->map = true; return 0;
    case KEY_KEEP: a->keep = true; return 0;
    case KEY_FULLSCREEN: a->fullscreen = true; return 0;
    case KEY_SIZE: command_parse_size(state, "--size", value, 320, 8192, a->size); return 0;
    case KEY_DPI: a->dpi = command_parse_number(state, "--dpi", value, 50, 1000); return 0;
    case KEY_REMAP:
        if (a->remaps == MOST_REMAPS)
            argp_error(state, "at most %d topics are renamed", MOST_REMAPS);
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
static enum status step_to(struct drive_session *s, int64_t to_ns)
{
    const struct drive_command ahead = {0.2, 0.1}, stop = {0, 0};
    const int64_t tick_ns = 50000000, start_ns = clock_now_ns() - s->now_ns;
    enum status status = OK;
    const bool real = s->kind == DRIVE_ROS;
    for (int64_t t = s->now_ns; status == OK && t < to_ns && !command_stopped(); t += tick_ns) {
        if (real)
            clock_sleep_until_ns(start_ns + t);
        status = drive_session_step(s, t, real && t < 1000000000 ? &stop : &ahead);
    }
    return status == OK && !real ? drive_session_step(s, to_ns, &ahead) : status;
}

// What was written, and how far the robot came.
static enum status report_pictures(const struct drive_arguments *a, const struct drive_session *s, int pictures)
{
    double way_m = 0;
    for (int i = 1; i < s->path.count; i++)
        way_m += v3_distance(s->path.at[i - 1], s->path.at[i]);
    if (!a->json) {
        printf("%s: %d pictures, %.1f s, %.2f m driven\n", a->out, pictures, (double)s->now_ns * 1e-9, way_m);
        return OK;
    }
    struct json *root;
    const enum status status = command_begin_json(&root);
    if (status != OK)
        return status;
    json_add_string(root, "out", a->out);
    json_add_number(root, "pictures", pictures);
    json_add_number(root, "seconds", (double)s->now_ns * 1e-9);
    json_add_number(root, "driven_m", way_m);
    return command_print_json(&root);
}

static enum status write_pictures(const struct drive_arguments *a, struct drive_session *s)
{
    int pictures = 0;
    enum status status = folder_make(a->out);
    const int64_t every_ns = (int64_t)(a->every_s * 1e9);
    for (int i = 0; status == OK && !command_stopped() && !s->ended; i++) {
        const struct surround_view *view;
        char path[4096];
        if (a->seconds > 0 && (double)i * a->every_s > a->seconds)
            break;
        status = step_to(s, i * every_ns);
        if (status == OK)
            status = drive_session_draw(s, &view);
        snprintf(path, sizeof path, "%s/%04d.png", a->out, i);
        if (status == OK && file_exists(path))
            status = fail(ERR_EXISTS, "%s is there already; choose another --out", path);
        if (status == OK)
            status = png_write(path, PNG_RGB8, view->rgb, view->lens.width, view->lens.height);
        pictures += status == OK;
    }
    return status == OK ? report_pictures(a, s, pictures) : status;
}

static enum status keep_drive(const struct drive_session *s, const struct place *place, const char *file)
{
    const struct surroundings *seen = drive_session_surroundings(s);
    struct recorded_drive drive = {.path_count = s->path.count};
    struct pose place_from_world;
    enum status status = robot_place_find(seen->pictures, seen->taken, place, &place_from_world);
    if (status == NOTHING)
        return fail(ERR_INPUT,
                    "the robot's pictures show too little of the place of %s; where it was driven is not kept", file);
    if (status != OK)
        return status;
    _Static_assert((int)DRIVE_PATH_POINTS == (int)RECORDED_DRIVE_POINTS, "the whole path");
    for (int i = 0; i < 3; i++)
        drive.size_m[i] = drive_session_size(s)[i];
    drive.world_from_body = pose_multiply(place_from_world, drive_session_pose(s));
    for (int i = 0; i < drive.path_count; i++)
        drive.path[i] = pose_apply(place_from_world, s->path.at[i]);
    return recording_write_drive(file, &drive);
}

int reenact_drive(int argc, char **argv)
{
    struct drive_arguments arguments = {.every_s = 1, .size = {1280, 800}, .how = drive_default_options()};
    static const struct argp argp = {
        options,
        parse,
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
    arguments.how.remap = arguments.remap;
    arguments.how.threads = !arguments.out || !strncmp(arguments.uri, "ros:", 4);
    enum status status = arguments.keep ? recording_check_change(arguments.file) : OK;
    if (status == OK && arguments.file)
        status = place_input_read_map(arguments.file, &place);
    if (status == NOTHING)
        status = fail(ERR_INPUT, "%s holds no place to localise %s in", arguments.file,
                      arguments.camera ? "the camera" : "the robot");
    if (status == OK)
        status = drive_session_open(&session, arguments.uri, &arguments.how);
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
