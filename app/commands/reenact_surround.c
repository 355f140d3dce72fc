// reenact surround: pictures of surroundings from a free viewpoint.
#include "app/commands/commands.h"
#include "base/clock.h"
#include "platform/files/file.h"
#include "platform/files/json.h"
#include "platform/files/png.h"
#include "surround/surroundings.h"

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

struct surround_arguments {
    const char *folder, *views, *out;
    bool layers, json, no_depth_test, plain, force;
};

enum { KEY_VIEWS = COMMAND_KEY, KEY_OUT, KEY_LAYERS, KEY_JSON, KEY_NO_TEST, KEY_PLAIN, KEY_FORCE };

static const struct argp_option options[] = {
    {"views", KEY_VIEWS, "VIEWS.txt", 0,
     "the viewpoints: a line each, 'seconds tx ty tz qx qy qz qw' (only what was captured by then is used) or 'name "
     "number tx ty tz qx qy qz qw' (everything is used); world_from_camera",
     0},
    {"out", KEY_OUT, "DIR", 0, "folder for the pictures, trajectory.txt and stats.json; made if need be", 0},
    {"layers", KEY_LAYERS, NULL, 0, "also write …_source.png (red 0: no capture has seen this)", 0},
    {"no-depth-test", KEY_NO_TEST, NULL, 0, "without the view-dependent depth test, to see what it does", 0},
    {"plain", KEY_PLAIN, NULL, 0, "draw the plain coloured point cloud instead, to compare", 0},
    {"force", KEY_FORCE, NULL, 0, "write over pictures that are there", 0},
    COMMAND_OPTION_JSON(KEY_JSON),
    {0},
};

static error_t parse_option(int key, char *value, struct argp_state *state)
{
    struct surround_arguments *a = state->input;
    switch (key) {
    case KEY_VIEWS: a->views = value; return 0;
    case KEY_OUT: a->out = value; return 0;
    case KEY_LAYERS: a->layers = true; return 0;
    case KEY_JSON: a->json = true; return 0;
    case KEY_NO_TEST: a->no_depth_test = true; return 0;
    case KEY_PLAIN: a->plain = true; return 0;
    case KEY_FORCE: a->force = true; return 0;
    case ARGP_KEY_ARG: command_take_file(state, &a->folder, value); return 0;
    case ARGP_KEY_END:
        command_require(state, a->folder, "FOLDER");
        command_require(state, a->views, "--views VIEWS.txt");
        command_require(state, a->out, "--out DIR");
        return 0;
    default: return ARGP_ERR_UNKNOWN;
    }
}

// "OUT/NAMEending". ERR_INPUT: too long.
static enum status output_path(const struct surround_arguments *arguments, const char *name, const char *ending,
                               char path[FILE_PATH_BYTES])
{
    return snprintf(path, FILE_PATH_BYTES, "%s/%s%s", arguments->out, name, ending) < FILE_PATH_BYTES
               ? OK
               : fail(ERR_INPUT, "the path %.60s… is too long", arguments->out);
}

static enum status write_image(const struct surround_arguments *arguments, const char *name, const char *ending,
                               const struct png_layout *layout, const void *pixels)
{
    char path[FILE_PATH_BYTES];
    enum status status = output_path(arguments, name, ending, path);
    if (status != OK)
        return status;
    char *slash = strrchr(path, '/');
    *slash = 0;
    status = folder_make(path);
    *slash = '/';
    uint8_t *bytes;
    size_t count;
    if (status == OK)
        status = png_encode(layout, pixels, 3, &bytes, &count);
    if (status != OK)
        return status;
    status = file_write(path, bytes, count);
    free(bytes);
    return status;
}

static enum status write_view(const struct surround_arguments *arguments, const struct surround_view *view,
                              const char *name)
{
    const struct png_layout layout = {PNG_RGB8, view->lens.width, view->lens.height};
    enum status status = write_image(arguments, name, ".png", &layout, view->rgb);
    if (status != OK || !arguments->layers)
        return status;
    const size_t pixels = (size_t)layout.width * (size_t)layout.height;
    uint8_t *source = malloc(pixels * 3);
    if (!source)
        return fail(ERR_MEMORY, "no memory for the picture");
    for (size_t i = 0; i < pixels; i++)
        memset(source + 3 * i, view->source[i], 3);
    status = write_image(arguments, name, "_source.png", &layout, source);
    free(source);
    return status;
}

static enum status check_output(const struct surround_arguments *arguments, const char *name, const char *ending)
{
    char path[FILE_PATH_BYTES];
    const enum status status = output_path(arguments, name, ending, path);
    return status == OK && file_exists(path) ? file_check_output(path, arguments->force) : status;
}

// Before anything is drawn.
static enum status check_outputs(const struct surround_arguments *arguments, const struct timed_pose *views, int count)
{
    enum status status = check_output(arguments, "trajectory", ".txt");
    if (status == OK)
        status = check_output(arguments, "stats", ".json");
    for (int i = 0; i < count && status == OK; i++) {
        status = check_output(arguments, views[i].name, ".png");
        if (status == OK && arguments->layers)
            status = check_output(arguments, views[i].name, "_source.png");
    }
    return status;
}

static enum status draw_views(const struct surround_arguments *arguments, struct surroundings *surroundings)
{
    struct timed_pose *views;
    int count;
    enum status status = pose_list_read(arguments->views, &views, &count);
    if (status != OK)
        return status;
    status = check_outputs(arguments, views, count);
    struct progress_bar progress;
    progress_bar_start(&progress, "drawing", count);
    for (int i = 0; status == OK && i < count && !command_stopped(); i++) {
        const bool timed = !strchr(views[i].name, '/');
        status = surroundings_advance(surroundings, timed ? views[i].time_ns : INT64_MAX);
        if (status == OK)
            status = surroundings_draw(surroundings, views[i].pose);
        if (status == OK)
            status = write_view(arguments, &surroundings->view, views[i].name);
        progress_bar_step(&progress);
    }
    progress_bar_end(&progress);
    free(views);
    if (status == OK) // the rest of the path is part of the answer
        status = surroundings_advance(surroundings, INT64_MAX);
    return status;
}

static enum status write_trajectory(const struct surround_arguments *arguments, const struct surroundings *surroundings)
{
    char path[FILE_PATH_BYTES], *text = NULL;
    size_t bytes = 0;
    FILE *to = open_memstream(&text, &bytes);
    if (!to)
        return fail(ERR_MEMORY, "no memory for the trajectory");
    fprintf(to, "# timestamp tx ty tz qx qy qz qw (world_from_%s, metres)\n",
            surroundings->kind == SURROUNDINGS_ROBOT ? "body" : "camera");
    for (int i = 0; i < surroundings->taken; i++) {
        const struct pose p = surroundings->poses[i];
        const int64_t t = surroundings->pictures[i].time_ns;
        fprintf(to, "%" PRId64 ".%09" PRId64 " %.6f %.6f %.6f %.7f %.7f %.7f %.7f\n", t / 1000000000, t % 1000000000,
                p.translation.x, p.translation.y, p.translation.z, p.rotation.x, p.rotation.y, p.rotation.z,
                p.rotation.w);
    }
    const bool whole = !ferror(to);
    enum status status = fclose(to) == 0 && whole ? output_path(arguments, "trajectory", ".txt", path)
                                                  : fail(ERR_MEMORY, "no memory for the trajectory");
    if (status == OK)
        status = file_write(path, text, bytes);
    free(text);
    return status;
}

static enum status write_stats(const struct surround_arguments *arguments, const struct surroundings *surroundings)
{
    struct json *root = json_new_object();
    json_add_number(root, "pictures", surroundings->drawn);
    json_add_number(root, "captures", surroundings->taken);
    json_add_number(root, "unplaced", surroundings->unplaced);
    json_add_number(root, "align_ms",
                    surroundings->taken ? (double)surroundings->align_ns * 1e-6 / surroundings->taken : 0);
    json_add_number(root, "align_worst_ms", (double)surroundings->worst_align_ns * 1e-6);
    json_add_number(root, "depth_ms",
                    surroundings->depths_made ? (double)surroundings->depth_ns * 1e-6 / surroundings->depths_made : 0);
    json_add_number(root, "depths_made", surroundings->depths_made);
    json_add_number(root, "draw_ms",
                    surroundings->drawn ? (double)surroundings->draw_ns * 1e-6 / surroundings->drawn : 0);
    json_add_number(root, "threads", surroundings->options.threads);
    char *text = json_print(root);
    json_free(&root);
    if (!text)
        return fail(ERR_MEMORY, "no memory for the picture");
    char path[FILE_PATH_BYTES];
    enum status status = output_path(arguments, "stats", ".json", path);
    if (status == OK)
        status = file_write(path, text, strlen(text));
    if (status == OK && arguments->json)
        fputs(text, stdout);
    free(text);
    return status;
}

int reenact_surround(int argc, char **argv)
{
    struct surround_arguments arguments = {0};
    static const struct argp argp = {
        options,
        parse_option,
        "FOLDER",
        "Draws pictures of surroundings from a free viewpoint.\v"
        "FOLDER holds a robot's captures (panorama.txt, depth_*.txt, odometry.txt) or a vehicle's (panorama.txt, "
        "panorama_poses.txt, points.ply), and calibration.json. What no capture has seen is hatched.",
        NULL,
        NULL,
        NULL};
    command_parse(&argp, argc, argv, &arguments);
    command_catch_signals();
    struct surroundings s;
    enum status status = surroundings_open(&s, arguments.folder, NULL);
    if (status != OK)
        return command_failed(argv[0]);
    s.clock = clock_now_ns;
    s.processor_clock = clock_cpu_ns;
    s.plain = arguments.plain;
    s.options.view.depth_test = !arguments.no_depth_test;
    status = folder_make(arguments.out);
    if (status == OK)
        status = draw_views(&arguments, &s);
    if (status == OK)
        status = write_trajectory(&arguments, &s);
    if (status == OK)
        status = write_stats(&arguments, &s);
    if (status == OK && !arguments.json)
        printf("%d pictures from %d captures, %d of them not aligned\n", s.drawn, s.taken, s.unplaced);
    surroundings_close(&s);
    return status == OK ? 0 : command_failed(argv[0]);
}
