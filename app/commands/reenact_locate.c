// reenact locate: where a camera was in the place, image by image.
#include "app/commands/command.h"
#include "app/commands/commands.h"
#include "app/commands/place_input.h"
#include "base/text.h"
#include "locate/camera_tracker.h"
#include "locate/picture_check.h"
#include "platform/files/file.h"
#include "platform/files/json.h"
#include "platform/sensors/source.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

struct locate_arguments {
    const char *file, *camera, *out;
    bool force;
    double decimate;
    bool json;
};

enum { KEY_CAMERA = COMMAND_KEY, KEY_OUT, KEY_JSON, KEY_DECIMATE, KEY_FORCE };

static const struct argp_option options[] = {
    {"camera", KEY_CAMERA, "URI", 0, "the camera: libcamera, libcamera:N or folder:DIR", 0},
    COMMAND_OPTION_FORCE(KEY_FORCE),
    {"out", KEY_OUT, "trajectory.txt", 0,
     "one line for each picture that could be placed: timestamp tx ty tz qx qy qz qw, world_from_camera (TUM format)",
     0},
    COMMAND_OPTION_QUAD_DECIMATE(KEY_DECIMATE),
    COMMAND_OPTION_JSON(KEY_JSON),
    {0},
};

static error_t parse_option(int key, char *value, struct argp_state *state)
{
    struct locate_arguments *a = state->input;
    switch (key) {
    case KEY_CAMERA: a->camera = value; return 0;
    case KEY_OUT: a->out = value; return 0;
    case KEY_FORCE: a->force = true; return 0;
    case KEY_JSON: a->json = true; return 0;
    case KEY_DECIMATE: a->decimate = command_parse_quad_decimate(state, value); return 0;
    case ARGP_KEY_ARG: command_take_file(state, &a->file, value); return 0;
    case ARGP_KEY_END:
        command_require(state, a->file, "FILE");
        command_require(state, a->camera, "--camera");
        command_require(state, a->out, "--out");
        return 0;
    default: return ARGP_ERR_UNKNOWN;
    }
}

// A line of the trajectory.
static void add_line(FILE *lines, int64_t time_ns, struct pose pose)
{
    // In integers: a double cannot hold the seconds since 1970 to the nanosecond.
    char seconds[SECONDS_TEXT_BYTES];
    fprintf(lines, "%s %.6f %.6f %.6f %.8f %.8f %.8f %.8f\n",
            seconds_text(time_ns + (time_ns < 0 ? -500 : 500), 6, seconds), pose.translation.x, pose.translation.y,
            pose.translation.z, pose.rotation.x, pose.rotation.y, pose.rotation.z, pose.rotation.w);
}

// What localises the camera, and what checks it.
struct locate_work {
    struct place place;
    struct source *camera;
    struct camera_tracker *track;
    struct picture_check *check;
};

struct locate_summary {
    struct picture_count count;
    int64_t tags_used, tags_rejected;
    double sum_rms2;
    bool focal_wrong;
    double focal_scale; // the focal length that fits, divided by the calibration's
    int32_t tags_moved, first_moved;
    struct lens lens;               // as estimated at the end
    bool learnt;                    // self-calibration made it more accurate than the calibration
    char cause[PICTURE_TEXT_BYTES]; // why pictures are placed wrongly or not at all; "": not known
};

// One image. Only errors that end the run are returned.
static enum status locate_image(const struct locate_work *work, const struct frame *frame, FILE *lines,
                                struct locate_summary *summary)
{
    struct location found;
    struct camera_motion motion;
    enum status status = picture_check_add(work->check, frame->color);
    if (status != OK)
        return status;
    status = camera_tracker_process(work->track, frame->color, NULL, frame->time_ns, &found, &motion);
    if (status < 0 && status != ERR_SOLVER) // a solver that did not converge leaves this image unplaced
        return status;
    picture_count_add(&summary->count, status);
    if (status != OK) // of two poses none is written
        return OK;
    summary->tags_used += found.tags_used;
    summary->tags_rejected += found.tags_rejected;
    summary->sum_rms2 += found.rms_px * found.rms_px;
    add_line(lines, frame->time_ns, found.world_from_camera);
    return OK;
}

static enum status locate_images(const struct locate_work *work, struct source_frames *camera, FILE *lines,
                                 struct locate_summary *summary)
{
    struct progress_bar bar;
    struct frame frame;
    enum status status;
    progress_bar_start(&bar, "finding the camera", source_remaining(camera->source));
    camera->bar = &bar;
    while ((status = source_frames_next(camera, &frame)) == OK) {
        if (frame.color && (status = locate_image(work, &frame, lines, summary)) != OK)
            break;
        progress_bar_step(&bar);
    }
    progress_bar_end(&bar);
    summary->count.unreadable = camera->damaged;
    camera->bar = NULL; // it lives here
    return status == NOTHING ? OK : status;
}

static enum status report_summary(const struct locate_arguments *arguments, const struct locate_summary *summary)
{
    double placed = summary->count.placed > 0 ? (double)summary->count.placed : 1,
           rms = sqrt(summary->sum_rms2 / placed);
    if (!arguments->json) {
        char text[PICTURE_COUNT_BYTES];
        printf("%s: %s\n", arguments->out, picture_count_text(&summary->count, text));
        if (summary->count.placed)
            printf("with %.1f tags each on average, which fit to %.2f pixels\n", (double)summary->tags_used / placed,
                   rms);
        if (summary->learnt)
            printf("the camera's focal length, learnt from the place: %.1f x %.1f pixels, sigma %.1f %%\n",
                   summary->lens.fx, summary->lens.fy, summary->lens.focal_sigma * 100);
        return OK;
    }
    struct json *root = json_new_object();
    json_add_string(root, "trajectory", arguments->out);
    picture_count_add_json(root, &summary->count);
    json_add_number(root, "tags_mean", (double)summary->tags_used / placed);
    json_add_number(root, "tags_rejected", (double)summary->tags_rejected);
    json_add_number(root, "tags_moved", summary->tags_moved);
    json_add_number(root, "rms_px", rms);
    json_add_bool(root, "focal_wrong", summary->focal_wrong);
    json_add_number(root, "focal_scale", summary->focal_scale);
    if (summary->learnt) {
        json_add_number(root, "fx", summary->lens.fx);
        json_add_number(root, "fy", summary->lens.fy);
        json_add_number(root, "focal_sigma", summary->lens.focal_sigma);
    }
    return command_print_json(&root);
}

static void print_warnings(const char *program, const struct locate_summary *summary)
{
    if (*summary->cause)
        fprintf(stderr, "%s: warning: %s\n", program, summary->cause);
    command_warn_moved_tags(program, summary->tags_moved, summary->first_moved);
    if (summary->focal_wrong && !*summary->cause)
        fprintf(stderr,
                "%s: warning: the pictures fit a focal length %.1f %% %s than the calibration's; calibrate the camera "
                "again\n",
                program, fabs(summary->focal_scale - 1) * 100, summary->focal_scale > 1 ? "longer" : "shorter");
}

// Whether lens and pictures belong together. ERR_INPUT: no pose is of use.
static enum status check_pictures(const struct locate_work *work, struct locate_summary *summary)
{
    struct picture_verdict verdict;
    bool useless;
    const enum status status = picture_check_judge(work->check, camera_tracker_lens(work->track), &verdict);
    if (status != OK)
        return status;
    picture_verdict_text(&verdict, picture_count_is_few(&summary->count), summary->cause, &useless);
    return useless ? fail(ERR_INPUT, "%s; where the camera was cannot be told, and nothing was written", summary->cause)
                   : OK;
}

static enum status open_inputs(const struct locate_arguments *arguments, struct locate_work *work)
{
    struct locator_options wanted = locator_default_options();
    if (arguments->decimate > 0)
        wanted.quad_decimate = arguments->decimate;
    enum status status = place_input_read(arguments->file, &work->place);
    if (status == NOTHING)
        status = fail(ERR_INPUT, "%s holds no place; make one with reenact-capture map", arguments->file);
    if (status == OK)
        status = source_open(&work->camera, arguments->camera, SOURCE_CAMERA);
    if (status != OK)
        return status;
    const struct lens *lens = &source_calibration(work->camera)->color;
    status = camera_tracker_open(&work->track, &work->place, lens, &wanted);
    return status == OK ? picture_check_open(&work->check, &work->place, lens) : status;
}

static void close_inputs(struct locate_work *work)
{
    picture_check_close(&work->check);
    camera_tracker_close(&work->track);
    source_close(&work->camera);
    place_free(&work->place);
}

int reenact_locate(int argc, char **argv)
{
    struct locate_arguments a = {0};
    const struct argp argp = {options,
                              parse_option,
                              "FILE --camera URI --out trajectory.txt",
                              "Find where the camera of each picture was in the place that FILE holds.",
                              NULL,
                              NULL,
                              NULL};
    command_parse(&argp, argc, argv, &a);
    struct locate_work work = {.camera = NULL};
    struct source_frames frames = {0};
    char *text = NULL;
    size_t bytes = 0;
    FILE *lines = open_memstream(&text, &bytes);
    struct locate_summary s = {0};
    enum status status = lines ? file_check_output(a.out, a.force) : fail(ERR_MEMORY, "no memory for the trajectory");
    if (status == OK)
        status = open_inputs(&a, &work);
    if (status == OK) {
        command_catch_signals();
        frames.source = work.camera;
        frames.program = argv[0];
        status = locate_images(&work, &frames, lines, &s);
    }
    if (status == OK)
        status = check_pictures(&work, &s);
    if (lines && fclose(lines) && status == OK)
        status = fail(ERR_MEMORY, "no memory for the trajectory");
    if (status == OK)
        status = file_write(a.out, text, bytes);
    if (status == OK) {
        s.focal_wrong = camera_tracker_focal_is_wrong(work.track, &s.focal_scale);
        s.tags_moved = camera_tracker_moved_tags(work.track, &s.first_moved);
        s.lens = *camera_tracker_lens(work.track);
        s.learnt = s.lens.focal_sigma < source_calibration(work.camera)->color.focal_sigma;
        status = report_summary(&a, &s);
        print_warnings(argv[0], &s);
        if (!source_is_live(work.camera))
            command_warn_times(argv[0], source_dropped(work.camera));
        const enum status kept = source_save_lens(work.camera, &s.lens);
        status = kept < 0 ? kept : status;
    }
    if (status == OK)
        status = source_frames_end(&frames);
    free(text);
    close_inputs(&work);
    return status == OK ? 0 : command_failed(argv[0]);
}
