// reenact-capture calibrate: a board to print, and cameras calibrated by it or by what else is held before them.
#include "app/commands/command.h"
#include "app/commands/commands.h"
#include "capture/calibration/color_depth.h"
#include "capture/calibration/lens_calibration.h"
#include "capture/calibration/printed_tags.h"
#include "capture/calibration/stereo_rig.h"
#include "locate/tag_corners.h"
#include "locate/tag_model.h"
#include "platform/files/file.h"
#include "platform/files/json.h"
#include "platform/files/output.h"
#include "platform/sensors/source.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

// ---------------------------------------------------------------- --board

// What calibration needs on paper.

struct board_arguments {
    const char *out;
    int paper;
    bool discs, chequers, force;
};

static error_t parse_board_option(int key, char *value, struct argp_state *state)
{
    struct board_arguments *a = state->input;
    switch (key) {
    case COMMAND_KEY: a->out = value; return 0;
    case COMMAND_KEY + 1: a->discs = true; return 0;
    case COMMAND_KEY + 2:
        a->paper = command_parse_choice(state, "--paper", value, paper_names, COUNT_OF(paper_names));
        return 0;
    case COMMAND_KEY + 3: a->force = true; return 0;
    case COMMAND_KEY + 4: a->chequers = true; return 0;
    case ARGP_KEY_ARG: command_refuse_argument(state, value); return 0;
    default: return ARGP_ERR_UNKNOWN;
    }
}

static const struct argp_option board_options[] = {
    {"board", COMMAND_KEY, "FILE.pdf", 0, "the page to make: a board of circles, for --lens", 0},
    {"discs", COMMAND_KEY + 1, NULL, 0, "instead the black discs for --color-depth, to be cut out", 0},
    {"chequers", COMMAND_KEY + 4, NULL, 0, "instead a board of chequers, for --lens", 0},
    {"paper", COMMAND_KEY + 2, "a4|letter", 0, "of the page (default a4)", 0},
    {"force", COMMAND_KEY + 3, NULL, 0, "write over FILE.pdf", 0},
    {0},
};

static const struct argp calibrate_board_argp = {
    board_options,
    parse_board_option,
    NULL,
    "Boards to print for calibration.\vThe discs are glued on blocks 5 cm high, and "
    "these on a white board, 4 across and "
    "3 down, 12 cm from middle to middle.",
    NULL,
    NULL,
    NULL};

static int run_board(int argc, char **argv)
{
    struct board_arguments a = {0};
    struct page *page;
    command_parse(&calibrate_board_argp, argc, argv, &a);
    const enum paper paper = (enum paper)a.paper;
    const struct paper_size size = paper_size(paper);
    const struct disc_board discs = disc_board_default();
    enum status status = output_check(a.out, NULL, a.force);
    if (status == OK)
        status = page_open(&page, a.out, size.width_mm, size.height_mm, 0);
    if (status == OK) {
        if (a.discs)
            printed_discs_draw(paper, discs.columns * discs.rows, discs.radius_m, page);
        else if (a.chequers)
            printed_chequers_draw(paper, page);
        else
            printed_board_draw(paper, page);
        status = page_finish(&page);
    }
    if (status != OK)
        return command_failed(argv[0]);
    const struct stereo_board board = a.chequers ? printed_chequers(paper) : printed_board(paper);
    FILE *say = strcmp(a.out, "-") ? stdout : stderr;
    if (a.discs)
        fprintf(say, "%s: %d discs of %g mm across\n", a.out, discs.columns * discs.rows, discs.radius_m * 2e3);
    else
        fprintf(say, "%s: %d x %d %s, %g mm apart; calibrate --lens with --%s %dx%d\n", a.out, board.columns,
                board.rows, a.chequers ? "inner corners" : "circles", board.pitch_m * 1e3,
                a.chequers ? "chequers" : "circles", board.columns, board.rows);
    return 0;
}

// ---------------------------------------------------------------- --lens, --color-depth, --rolling-shutter

// One camera or sensor, from what is held before it.

struct camera_arguments {
    const char *lens, *color_depth, *rolling_shutter, *out;
    struct stereo_board board;
    int views;
    bool json, force, chequers;
};

enum {
    KEY_LENS = COMMAND_KEY,
    KEY_COLOR_DEPTH,
    KEY_ROLLING,
    KEY_OUT,
    KEY_CIRCLES,
    KEY_CHEQUERS,
    KEY_PITCH,
    KEY_VIEWS,
    KEY_FORCE,
    KEY_JSON
};

static const struct argp_option camera_options[] = {
    {"lens", KEY_LENS, "URI", 0, "the camera's lens, from the board of calibrate --board held before it", 0},
    {"color-depth", KEY_COLOR_DEPTH, "URI", 0,
     "the sensor's colour against its depth, from discs that stand off a board", 0},
    {"rolling-shutter", KEY_ROLLING, "URI", 0, "the camera's read-out time: swing it left and right before a tag", 0},
    {"out", KEY_OUT, "FILE", 0, "the calibration.json to make (default: print it)", 0},
    {"circles", KEY_CIRCLES, "CxR", 0, "circles of the board (default: the A4 board's)", 0},
    {"chequers", KEY_CHEQUERS, "CxR", 0, "a board of chequers instead, with so many inner corners", 0},
    {"pitch", KEY_PITCH, "MM", 0, "from one to the next (default 20)", 0},
    {"views", KEY_VIEWS, "N", 0, "stop after so many views of the board (default 20)", 0},
    {"force", KEY_FORCE, NULL, 0, "write over FILE", 0},
    COMMAND_OPTION_JSON(KEY_JSON),
    {0},
};

static error_t parse_camera_option(int key, char *value, struct argp_state *state)
{
    struct camera_arguments *a = state->input;
    int size[2];
    switch (key) {
    case KEY_LENS: a->lens = value; return 0;
    case KEY_COLOR_DEPTH: a->color_depth = value; return 0;
    case KEY_ROLLING: a->rolling_shutter = value; return 0;
    case KEY_OUT: a->out = value; return 0;
    case KEY_FORCE: a->force = true; return 0;
    case KEY_JSON: a->json = true; return 0;
    case KEY_PITCH: a->board.pitch_m = 1e-3 * command_parse_number(state, "--pitch", value, 1, 1000); return 0;
    case KEY_VIEWS:
        a->views = (int)command_parse_number(state, "--views", value, LENS_MIN_VIEWS, LENS_MAX_VIEWS);
        return 0;
    case KEY_CHEQUERS:
    case KEY_CIRCLES:
        a->chequers = key == KEY_CHEQUERS;
        command_parse_size(state, a->chequers ? "--chequers" : "--circles", value, 4, STEREO_MAX_CIRCLES / 4, size);
        a->board.columns = size[0];
        a->board.rows = size[1];
        if (size[0] * size[1] > STEREO_MAX_CIRCLES)
            argp_error(state, "a board has at most %d corners or circles, not %s", STEREO_MAX_CIRCLES, value);
        return 0;
    case ARGP_KEY_ARG: command_refuse_argument(state, value); return 0;
    default: return ARGP_ERR_UNKNOWN;
    }
}

enum { REPORT_MAX = 8 };

// What one kind does with a frame, and what it found.
struct calibration_run {
    const struct camera_arguments *a;
    struct progress_bar bar;
    struct calibration calibration; // the source's; the result changes it
    struct lens_calibration lens;
    struct color_depth color_depth;
    struct tag_detector *detector;
    struct mirrored_tags *mirror; // of --rolling-shutter
    int mirror_looks, mirror_shows;
    uint8_t *gray;
    struct readout readout;
    bool enough;
    int report_count; // numbers that say how good the result is
    const char *report_name[REPORT_MAX];
    double report_value[REPORT_MAX];
};

static enum status add_lens(struct calibration_run *run, const struct frame *frame)
{
    bool used = false;
    enum status status = frame->color ? lens_calibration_add(&run->lens, frame->color, &used) : OK;
    snprintf(run->bar.note, sizeof run->bar.note, "%d of %d views · %s", run->lens.views, run->a->views,
             used ? "now tilt it another way" : "show the board tilted, in every corner of the picture");
    run->enough = run->lens.views >= run->a->views;
    return status;
}

static enum status add_color_depth(struct calibration_run *run, const struct frame *frame)
{
    static const char *const words[] = {"seen", "not the whole board in colour", "not in depth",
                                        "too far: come nearer"};
    enum color_depth_seen seen = DISCS_NOT_IN_COLOR;
    enum status status =
        frame->color && frame->depth ? color_depth_add(&run->color_depth, frame->color, frame->depth, &seen) : OK;
    snprintf(run->bar.note, sizeof run->bar.note, "%d of %d views · %s", run->color_depth.views, run->a->views,
             words[seen]);
    run->enough = run->color_depth.views >= run->a->views;
    return status;
}

// Whether the first pictures without a tag show one in a mirror.
static enum status look_in_mirror(struct calibration_run *run)
{
    enum { LOOKS = 6 };
    int shown;
    if (run->readout.count || run->mirror_looks++ >= LOOKS)
        return OK;
    const enum status status = mirrored_tags_look(run->mirror, run->gray, &shown);
    run->mirror_shows += shown > 0;
    return status;
}

static enum status add_rolling(struct calibration_run *run, const struct frame *frame)
{
    const struct lens *l = &run->calibration.color;
    struct tag_detection seen[16];
    int count = 0, largest = -1;
    double max = 0;
    if (!frame->color)
        return OK;
    gray_from_rgb(frame->color, (size_t)l->width * (size_t)l->height, run->gray);
    enum status status =
        tag_detector_detect(run->detector, &(struct gray_image){run->gray, l->width, l->height}, seen, 16, &count);
    for (int i = 0; i < count; i++) {
        const double side = fabs(seen[i].corner[2].y - seen[i].corner[1].y);
        const bool same = run->readout.count && run->readout.frames[0].id == seen[i].id;
        if (same || (!run->readout.count && side > max)) {
            max = side;
            largest = i;
        }
    }
    if (largest >= 0)
        readout_add(&run->readout, (double)frame->time_ns * 1e-9, seen[largest].id, seen[largest].corner);
    snprintf(run->bar.note, sizeof run->bar.note,
             "tag %s · swing left and right, a turn of the wrist each way every second",
             largest >= 0 ? "seen" : "not seen");
    run->enough = run->readout.count >= 150; // 5 s
    return status == OK && !count ? look_in_mirror(run) : status;
}

static enum status feed_frames(struct calibration_run *run, struct source_frames *frames,
                               enum status (*add)(struct calibration_run *, const struct frame *))
{
    enum status status = OK;
    command_catch_signals();
    progress_bar_start(&run->bar, "calibrating", source_remaining(frames->source));
    while (status == OK && !run->enough) {
        struct frame frame;
        status = source_frames_next(frames, &frame);
        if (status == OK)
            status = add(run, &frame);
        progress_bar_step(&run->bar);
    }
    progress_bar_end(&run->bar);
    return status == NOTHING ? OK : status;
}

// ---------------------------------------------------------------- results

// Where there is no --out, the result goes to where the device's is looked up, if it has such a place (*kept).
static enum status save_calibration(const struct calibration_run *run, struct source *source, bool *kept)
{
    *kept = false;
    if (run->a->out)
        return calibration_write(run->a->out, &run->calibration);
    const enum status status = source_save_calibration(source, &run->calibration);
    *kept = status == OK;
    return status == NOTHING ? OK : status;
}

static void report_set(struct calibration_run *run, const char *const names[], const double *values, int count)
{
    assert(count <= REPORT_MAX);
    run->report_count = count;
    for (int i = 0; i < count; i++) {
        run->report_name[i] = names[i];
        run->report_value[i] = values[i];
    }
}

static void print_camera_report(const struct calibration_run *run)
{
    for (int i = 0; i < run->report_count; i++)
        printf("%s%s %.4g", i ? ", " : "", run->report_name[i], run->report_value[i]);
    printf("\n");
}

static enum status print_json(const struct calibration_run *run, bool kept)
{
    struct json *root = json_new_object();
    for (int i = 0; i < run->report_count; i++)
        json_add_number(root, run->report_name[i], run->report_value[i]);
    json_add_bool(root, "kept", kept);
    calibration_add_json(json_add_object(root, "calibration"), &run->calibration);
    return command_print_json(&root);
}

static enum status keep_and_print(const struct calibration_run *run, struct source *source)
{
    bool kept;
    if (!run->a->json)
        print_camera_report(run);
    enum status status = save_calibration(run, source, &kept);
    if (status != OK || run->a->json)
        return status == OK ? print_json(run, kept) : status;
    if (kept)
        printf("kept for this %s\n", run->a->color_depth ? "sensor" : "camera");
    if (kept || run->a->out)
        return OK;
    struct json *root = json_new_object();
    calibration_add_json(root, &run->calibration);
    return command_print_json(&root);
}

static enum status solve_lens(struct calibration_run *run)
{
    struct lens_report report;
    struct lens lens;
    enum status status = lens_calibration_solve(&run->lens, &lens, &report);
    if (status != OK)
        return status;
    lens.readout_s = run->calibration.color.readout_s;
    run->calibration.color = lens;
    static const char *const names[] = {"views", "circles", "rms_px", "max_px", "focal_sigma_percent", "mm_per_m"};
    const double values[] = {report.views,  report.circles,           report.rms_px,
                             report.max_px, report.focal_sigma * 100, report.sigma_mm_per_m};
    report_set(run, names, values, COUNT_OF(values));
    return OK;
}

static enum status solve_color_depth(struct calibration_run *run)
{
    struct color_depth_report report;
    enum status status = color_depth_solve(&run->color_depth, &run->calibration.color_from_depth, &report);
    if (status != OK)
        return status;
    run->calibration.registered = false;
    static const char *const names[] = {"views",    "discs",     "rms_px",   "rms_mm",
                                        "sigma_mm", "sigma_deg", "shift_mm", "turn_deg"};
    const double values[] = {report.views,    report.points,    report.rms_px,   report.rms_mm,
                             report.sigma_mm, report.sigma_deg, report.shift_mm, report.turn_deg};
    report_set(run, names, values, COUNT_OF(values));
    return OK;
}

static enum status solve_rolling(struct calibration_run *run)
{
    struct readout_report report;
    double readout_s;
    if (run->mirror_shows > 1 && !run->readout.count)
        return fail(ERR_INPUT, "the pictures are mirrored, so that no tag is recognised: switch the camera's mirror "
                               "off and film again");
    enum status status = readout_solve(&run->readout, &readout_s, &report);
    if (status != OK)
        return status;
    run->calibration.color.readout_s = readout_s;
    static const char *const names[] = {"readout_ms", "sigma_ms", "frames", "rms_px", "shear_px"};
    const double values[] = {readout_s * 1e3, report.sigma_s * 1e3, report.frames, report.rms_px, report.bend_px};
    report_set(run, names, values, COUNT_OF(values));
    return OK;
}

static enum status prepare_run(struct calibration_run *run)
{
    const struct lens *color = &run->calibration.color;
    const struct disc_board discs = disc_board_default();
    if (!color->width)
        return fail(ERR_INPUT, "this sensor has no colour camera");
    lens_calibration_start(&run->lens, &run->a->board, color->width, color->height);
    run->lens.chequers = run->a->chequers;
    run->readout.lens = *color;
    run->readout.lens.readout_s = 0;
    run->gray = malloc((size_t)color->width * (size_t)color->height);
    if (!run->gray)
        return fail(ERR_MEMORY, "no memory to calibrate");
    if (run->a->color_depth)
        return color_depth_start(&run->color_depth, &run->calibration, &discs);
    const enum status status = mirrored_tags_open(&run->mirror, color, NULL, 0);
    return status == OK ? tag_detector_open(&run->detector, 1) : status;
}

// A depth sensor's colour camera is a camera, too.
static enum source_wanted kind_of(const struct camera_arguments *arguments, const char *uri)
{
    return arguments->color_depth || source_uri_is_sensor(uri) ? SOURCE_SENSOR : SOURCE_CAMERA;
}

// What is to be measured: of which input, and by what.
struct measurement {
    const char *uri;
    enum status (*add)(struct calibration_run *r, const struct frame *f);
    enum status (*solve)(struct calibration_run *r);
};

static struct measurement measurement_of(const struct camera_arguments *arguments)
{
    if (arguments->lens)
        return (struct measurement){arguments->lens, add_lens, solve_lens};
    if (arguments->color_depth)
        return (struct measurement){arguments->color_depth, add_color_depth, solve_color_depth};
    return (struct measurement){arguments->rolling_shutter, add_rolling, solve_rolling};
}

static enum status calibrate_camera(struct calibration_run *run)
{
    const struct camera_arguments *a = run->a;
    const struct measurement measurement = measurement_of(a);
    struct source_frames frames = {.source = NULL};
    struct source *source = NULL;
    enum status status = a->out ? file_check_output(a->out, a->force) : OK;
    if (status == OK)
        status = source_open(&source, measurement.uri, kind_of(a, measurement.uri));
    if (status == OK) {
        run->calibration = *source_calibration(source);
        status = prepare_run(run);
    }
    frames.source = source;
    if (status == OK)
        status = feed_frames(run, &frames, measurement.add);
    if (status == OK)
        status = measurement.solve(run);
    if (status == OK)
        status = keep_and_print(run, source);
    if (status == OK)
        status = source_frames_end(&frames);
    lens_calibration_free(&run->lens);
    color_depth_free(&run->color_depth);
    tag_detector_close(&run->detector);
    mirrored_tags_close(&run->mirror);
    free(run->gray);
    source_close(&source);
    return status;
}

static const struct argp calibrate_camera_argp = {
    camera_options,
    parse_camera_option,
    NULL,
    "Calibrates a camera or a sensor from what is held before it.\vA folder's "
    "pictures, or a live camera until enough was "
    "seen or Ctrl-C. The answer is in pixels and millimetres; where it fails, the "
    "reason. --out makes a calibration.json, "
    "as folders of pictures have it; without it the result is kept for this camera or "
    "sensor, and used whenever it is opened.",
    NULL,
    NULL,
    NULL};

static int run_camera(int argc, char **argv)
{
    static struct calibration_run run;
    struct camera_arguments a = {.board = printed_board(PAPER_A4), .views = 20};
    command_parse(&calibrate_camera_argp, argc, argv, &a);
    run = (struct calibration_run){.a = &a};
    return calibrate_camera(&run) == OK ? 0 : command_failed(argv[0]);
}

// ---------------------------------------------------------------- --stereo

// Two cameras that are fixed to each other.

struct stereo_arguments {
    const char *folder, *out;
    bool json, force;
};

enum { KEY_STEREO = KEY_JSON + 1 }; // the others as above

static const struct argp_option stereo_options[] = {
    {"stereo", KEY_STEREO, "DIR", 0, "pairs of pictures of a board of circles: DIR/left, DIR/right, DIR/board.json", 0},
    {"out", KEY_OUT, "RIG.json", 0, "where to write the lenses and the pose between the cameras", 0},
    {"force", KEY_FORCE, NULL, 0, "write over RIG.json", 0},
    COMMAND_OPTION_JSON(KEY_JSON),
    {0},
};

static error_t parse_stereo_option(int key, char *value, struct argp_state *state)
{
    struct stereo_arguments *a = state->input;
    switch (key) {
    case KEY_STEREO: a->folder = value; return 0;
    case KEY_OUT: a->out = value; return 0;
    case KEY_FORCE: a->force = true; return 0;
    case KEY_JSON: a->json = true; return 0;
    case ARGP_KEY_ARG: command_refuse_argument(state, value); return 0;
    case ARGP_KEY_END: command_require(state, a->folder, "--stereo DIR"); return 0;
    default: return ARGP_ERR_UNKNOWN;
    }
}

static enum status print_stereo_report(const struct stereo_rig *rig, const struct stereo_report *report, int pairs,
                                       bool as_json)
{
    if (!as_json) {
        printf("%d of %d pairs; reprojection %.3f px left, %.3f px right (largest %.2f, %.2f)\n", report->views, pairs,
               report->rms_px[0], report->rms_px[1], report->max_px[0], report->max_px[1]);
        printf(
            "left  fx %.2f fy %.2f cx %.2f cy %.2f\nright fx %.2f fy %.2f cx %.2f cy %.2f (focal lengths to %.2f %%)\n",
            rig->left.fx, rig->left.fy, rig->left.cx, rig->left.cy, rig->right.fx, rig->right.fy, rig->right.cx,
            rig->right.cy, 100 * report->focal_sigma);
        printf("baseline %.2f mm, standard deviation %.2f mm\n", 1000 * report->baseline_m,
               1000 * report->baseline_sigma_m);
        return OK;
    }
    struct json *root = json_new_object();
    static const char *const sides[2] = {"left", "right"};
    json_add_number(root, "pairs", pairs);
    json_add_number(root, "pairs_used", report->views);
    for (int i = 0; i < 2; i++) {
        const struct lens *l = i ? &rig->right : &rig->left;
        struct json *camera = json_add_object(root, sides[i]);
        json_add_number(camera, "boards", report->boards[i]);
        json_add_number(camera, "circles", report->circles[i]);
        json_add_number(camera, "rms_px", report->rms_px[i]);
        json_add_number(camera, "max_px", report->max_px[i]);
        json_add_number(camera, "fx", l->fx);
        json_add_number(camera, "fy", l->fy);
        json_add_number(camera, "cx", l->cx);
        json_add_number(camera, "cy", l->cy);
    }
    json_add_number(root, "baseline_m", report->baseline_m);
    json_add_number(root, "baseline_sigma_m", report->baseline_sigma_m);
    json_add_number(root, "focal_sigma", report->focal_sigma);
    json_add_number(root, "pairs_left_out", report->left_out);
    json_add_string(root, "warning", report->warning);
    return command_print_json(&root);
}

static const struct argp calibrate_stereo_argp = {
    stereo_options,
    parse_stereo_option,
    "--stereo DIR [--out RIG.json]",
    "Calibrate two cameras that are fixed to each other.\v"
    "Hold a flat board of dark circles before both cameras, near and far, turned to each side, into "
    "the pictures' corners; six pairs or more. The whole board must be seen by both in one at least.",
    NULL,
    NULL,
    NULL};

static int run_stereo(int argc, char **argv)
{
    struct stereo_arguments a = {0};
    command_parse(&calibrate_stereo_argp, argc, argv, &a);
    struct stereo_rig rig;
    struct stereo_report report;
    int pairs = 0;
    enum status status = a.out ? file_check_output(a.out, a.force) : OK;
    if (status == OK)
        status = stereo_calibrate_folder(a.folder, &rig, &report, &pairs);
    if (status == OK && *report.warning)
        fprintf(stderr, "%s: warning: %s\n", argv[0], report.warning);
    if (status == OK && a.out) {
        char *text = stereo_rig_print(&rig);
        status = text ? file_write(a.out, text, strlen(text)) : fail(ERR_MEMORY, "no memory to write %s", a.out);
        free(text);
    }
    if (status == OK)
        status = print_stereo_report(&rig, &report, pairs, a.json);
    return status == OK ? 0 : command_failed(argv[0]);
}

// ---------------------------------------------------------------- which of its kinds is meant

static const struct {
    const char *option, *about;
    int (*run)(int argc, char **argv);
    const struct argp *argp;
} kinds[] = {
    {"--board", "a board of circles to print, for --lens", run_board, &calibrate_board_argp},
    {"--lens", "a camera's lens, from that board held before it", run_camera, &calibrate_camera_argp},
    {"--color-depth", "a sensor's colour against its depth, from discs that stand off a board", run_camera,
     &calibrate_camera_argp},
    {"--rolling-shutter", "how long a camera reads an image, from a swing before a tag", run_camera,
     &calibrate_camera_argp},
    {"--stereo", "two cameras that are fixed to each other", run_stereo, &calibrate_stereo_argp},
};

static void print_kinds(FILE *to, const char *program)
{
    fprintf(to, "Usage: %s KIND ...\n", program);
    for (size_t k = 0; k < COUNT_OF(kinds); k++)
        fprintf(to, "  %-18s %s\n", kinds[k].option, kinds[k].about);
    fprintf(to, "%s KIND --help says more of one.\n", program);
}

int capture_calibrate(int argc, char **argv)
{
    bool asked = false;
    for (int i = 1; i < argc; i++) {
        for (size_t k = 0; k < COUNT_OF(kinds); k++) {
            const size_t length = strlen(kinds[k].option);
            if (!strncmp(argv[i], kinds[k].option, length) && (!argv[i][length] || argv[i][length] == '='))
                return kinds[k].run(argc, argv);
        }
        asked |= !strcmp(argv[i], "--help") || !strcmp(argv[i], "-h") || !strcmp(argv[i], "-?") ||
                 !strcmp(argv[i], "--usage");
    }
    if (argc > 1 && (!strcmp(argv[1], "--version") || !strcmp(argv[1], "-V"))) {
        command_print_version(argv[0]);
        return 0;
    }
    print_kinds(asked ? stdout : stderr, argv[0]);
    for (size_t k = 0; asked && k < COUNT_OF(kinds); k++) {
        if (k && kinds[k].argp == kinds[k - 1].argp)
            continue;
        printf("\n");
        command_print_help(kinds[k].argp, argv[0]);
    }
    return asked ? 0 : 2;
}
