// reenact render: draws a take into the images of a camera.
#include "app/commands/command.h"
#include "app/commands/commands.h"
#include "app/commands/place_input.h"
#include "base/clock.h"
#include "base/text.h"
#include "locate/camera_tracker.h"
#include "locate/picture_check.h"
#include "platform/files/file.h"
#include "platform/files/json.h"
#include "platform/files/output.h"
#include "platform/files/png.h"
#include "platform/files/video.h"
#include "platform/sensors/source.h"
#include "reenact/render/actor_renderer.h"

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

struct render_arguments {
    const char *file, *take, *camera, *out, *mp4;
    enum detail detail;
    bool layers, json, alone, force;
    double start_s, error_px;
};

enum {
    KEY_TAKE = COMMAND_KEY,
    KEY_CAMERA,
    KEY_OUT,
    KEY_DETAIL,
    KEY_LAYERS,
    KEY_START,
    KEY_ERROR,
    KEY_ALONE,
    KEY_JSON,
    KEY_MP4,
    KEY_FORCE
};

static const struct argp_option options[] = {
    {"take", KEY_TAKE, "NAME", 0, "the take to show", 0},
    {"camera", KEY_CAMERA, "URI", 0,
     "the tablet's camera: libcamera, libcamera:N or folder:DIR; or a FILE.txt of poses (seconds tx ty tz qx qy qz "
     "qw): "
     "no camera, the place as it was filmed behind the actor",
     0},
    {"out", KEY_OUT, "DIR", 0, "folder for the pictures, trajectory.txt and stats.json; made if need be", 0},
    {"detail", KEY_DETAIL, "LEVEL", 0,
     "paper: the 2014 method to the letter, cylinders coloured by one frame; parts: by the nearest frame for each "
     "cylinder; fused: the avatar in its own colours; full: the best quality (default); auto: as much as the eye can "
     "see",
     0},
    {"layers", KEY_LAYERS, NULL, 0,
     "also write NAME_actor.png (the actor alone, RGBA, straight alpha) and NAME_source.png (where each of its "
     "pixels is from: red 85 seen in this frame, 170 taken from another frame, 255 filled in; 256 green + blue: how "
     "long before or after, in hundredths of a second)",
     0},
    {"start", KEY_START, "SECONDS", 0, "show the take from here when the first image comes (default 0)", 0},
    {"error", KEY_ERROR, "PX", 0, "with --detail auto, by how much the actor may be wrong (default 1)", 0},
    {"alone", KEY_ALONE, NULL, 0, "no room that hides the actor, and no shadow under the actor; paper never has them",
     0},
    {"mp4", KEY_MP4, "FILE", 0, "also write the pictures as a film", 0},
    COMMAND_OPTION_FORCE(KEY_FORCE),
    {"json", KEY_JSON, NULL, 0, "print what stats.json holds", 0},
    {0},
};

static error_t parse_option(int key, char *value, struct argp_state *state)
{
    struct render_arguments *a = state->input;
    switch (key) {
    case KEY_TAKE: a->take = value; return 0;
    case KEY_CAMERA: a->camera = value; return 0;
    case KEY_OUT: a->out = value; return 0;
    case KEY_LAYERS: a->layers = true; return 0;
    case KEY_ERROR: a->error_px = command_parse_number(state, "--error", value, 0, 1000); return 0;
    case KEY_ALONE: a->alone = true; return 0;
    case KEY_JSON: a->json = true; return 0;
    case KEY_MP4: a->mp4 = value; return 0;
    case KEY_FORCE: a->force = true; return 0;
    case KEY_START: a->start_s = command_parse_number(state, "--start", value, -1e6, 1e6); return 0;
    case KEY_DETAIL:
        a->detail = (enum detail)command_parse_choice(state, "--detail", value, detail_names, DETAIL_COUNT);
        return 0;
    case ARGP_KEY_ARG: command_take_file(state, &a->file, value); return 0;
    case ARGP_KEY_END:
        command_require(state, a->file, "FILE");
        command_require(state, a->take, "--take NAME");
        command_require(state, a->camera, "--camera URI");
        command_require(state, a->out, "--out DIR");
        a->alone |= a->detail == DETAIL_PAPER; // [D14] has neither
        return 0;
    default: return ARGP_ERR_UNKNOWN;
    }
}

enum render_stage { STAGE_CAMERA, STAGE_LOCATE, STAGE_DRAW, STAGE_READ, STAGE_WRITE, STAGE_COUNT };
static const char *const stage_names[] = {"camera", "locate", "draw", "read", "write"};

// The state of one run.
struct render_run {
    const struct render_arguments *arguments;
    struct recording *recording;
    struct place place;
    struct take *take;
    struct source *camera;
    struct source_frames frames; // of the camera
    struct camera_tracker *track;
    struct picture_check *check; // of the camera's pictures
    struct filmed_path path;     // instead of a camera; count 0: there is a camera
    struct gpu *gpu;
    struct renderer *renderer;
    FILE *trajectory; // in memory, so that a run that fails leaves none
    char *trajectory_text;
    size_t trajectory_bytes;
    struct output *film; // NULL: not wanted
    struct video_writer *video;
    uint8_t *rgb, *rgba;
    struct lens lens;

    bool started;
    int64_t first_ns; // the camera's time at the first image
    int64_t images;   // drawn: all that could be read
    struct picture_count count;
    int64_t with_actor, parts;
    int64_t at_level[DETAIL_LEVELS];
    double error_px; // predicted, summed over all images with the actor
    double share_of_full;
    int64_t spent_ns[STAGE_COUNT], lap_ns;
};

static void add_stage_time(struct render_run *run, enum render_stage stage)
{
    int64_t now = clock_now_ns();
    run->spent_ns[stage] += now - run->lap_ns;
    run->lap_ns = now;
}

static bool is_path(const char *camera)
{
    const size_t length = strlen(camera);
    return length > 4 && !strchr(camera, ':') && !strcmp(camera + length - 4, ".txt");
}

// The camera and its tracker, or the path; with the place.
static enum status open_locator(struct render_run *run)
{
    const bool path = is_path(run->arguments->camera);
    enum status status = path ? OK : source_open(&run->camera, run->arguments->camera, SOURCE_CAMERA);
    if (status == OK)
        status = recording_read_place(run->recording, &run->place);
    if (status == NOTHING)
        return fail(ERR_INPUT,
                    "%s holds no place, so the camera cannot be found in it; "
                    "film the empty place first with reenact-capture map",
                    run->arguments->file);
    if (status == OK && path) {
        status = filmed_path_open(&run->path, &run->place, run->arguments->camera);
        run->lens = run->path.lens;
        return status;
    }
    struct locator_options how = locator_default_options();
    if (status == OK)
        run->lens = source_calibration(run->camera)->color;
    if (status == OK)
        status = camera_tracker_open(&run->track, &run->place, &run->lens, &how);
    return status == OK ? picture_check_open(&run->check, &run->place, &run->lens) : status;
}

// A take with a person who has no place among the place's things: wherever they were drawn would be wrong.
static enum status check_located(const struct render_run *run)
{
    bool person = false;
    for (int64_t i = 0; i < take_frame_count(run->take) && !person; i++)
        person = take_entry(run->take, i)->has_skeleton;
    if (!person || take_is_located(run->take))
        return OK;
    return fail(ERR_INPUT, "it is not known where the actor of '%s' stood: the sensor recognised nothing of the place",
                run->arguments->take);
}

static bool on_progress(void *self, double share)
{
    struct progress_bar *progress = self;
    while (progress->done < (int64_t)(share * (double)progress->total))
        progress_bar_step(progress);
    return !command_stopped();
}

static enum status open_renderer(struct render_run *run)
{
    struct progress_bar progress;
    const struct progress_watch watch = {.on_progress = on_progress, .self = &progress};
    struct renderer_options how = renderer_default_options();
    how.detail = run->arguments->detail;
    how.sources = run->arguments->layers;
    how.error_px = run->arguments->error_px;
    how.shadow = !run->arguments->alone;
    how.watch = &watch;
    progress_bar_start(&progress, "preparing", 100);
    enum status status = renderer_open(&run->renderer, run->gpu, run->take, &run->lens, &how);
    progress_bar_end(&progress);
    struct occluder_mesh occluder = {0};
    if (status == OK && !run->arguments->alone)
        status = occluder_mesh_make(&occluder, &run->place, run->take, NULL);
    if (status == OK)
        status = renderer_set_room(run->renderer, &occluder);
    if (status == OK && run->arguments->detail == DETAIL_AUTO)
        status = renderer_measure_costs(run->renderer);
    return status < 0 ? status : OK;
}

static enum status open_film(struct render_run *run)
{
    if (!run->arguments->mp4)
        return OK;
    enum status status = output_open(&run->film, run->arguments->mp4);
    if (status != OK)
        return status;
    const struct video_layout layout = {run->lens.width, run->lens.height, output_can_seek(run->film)};
    return video_open(&run->video, output_file(run->film), &layout);
}

static enum status open_run(struct render_run *run)
{
    const struct render_arguments *a = run->arguments;
    enum status status = folder_check_output(a->out, a->force);
    if (status == OK && a->mp4)
        status = output_check(a->mp4, a->file, a->force);
    if (status == OK)
        status = recording_open(&run->recording, a->file);
    if (status == OK)
        status = take_open_drawn(&run->take, run->recording, a->take);
    if (status == OK)
        status = open_locator(run);
    if (status == OK)
        status = check_located(run);
    if (status == OK)
        status = open_film(run);
    if (status == OK)
        status = gpu_open(&run->gpu);
    if (status == OK)
        status = open_renderer(run);
    if (status == OK)
        status = folder_make(a->out);
    if (status != OK)
        return status;
    size_t pixels = (size_t)run->lens.width * (size_t)run->lens.height;
    run->rgb = malloc(pixels * 3);
    run->rgba = malloc(pixels * 4);
    if (!run->rgb || !run->rgba)
        return fail(ERR_MEMORY, "no memory for the picture");
    run->trajectory = open_memstream(&run->trajectory_text, &run->trajectory_bytes);
    if (!run->trajectory)
        return fail(ERR_MEMORY, "no memory for the trajectory");
    fprintf(run->trajectory,
            "# timestamp tx ty tz qx qy qz qw (world_from_camera, metres; camera x right y down z forward)\n");
    return OK;
}

static void close_run(struct render_run *run)
{
    if (run->trajectory)
        fclose(run->trajectory);
    free(run->trajectory_text);
    free(run->rgb);
    free(run->rgba);
    renderer_close(&run->renderer);
    gpu_close(&run->gpu);
    picture_check_close(&run->check);
    camera_tracker_close(&run->track);
    filmed_path_close(&run->path);
    place_free(&run->place);
    source_close(&run->camera);
    take_close(&run->take);
    recording_free(&run->recording);
}

static void write_pose(FILE *to, int64_t time_ns, struct pose pose)
{
    char seconds[SECONDS_TEXT_BYTES];
    fprintf(to, "%s %.6f %.6f %.6f %.7f %.7f %.7f %.7f\n", seconds_text(time_ns, 9, seconds), pose.translation.x,
            pose.translation.y, pose.translation.z, pose.rotation.x, pose.rotation.y, pose.rotation.z, pose.rotation.w);
}

static enum status write_image(struct render_run *run, const char *name, const char *ending, enum png_kind kind,
                               const uint8_t *pixels)
{
    char path[4096];
    snprintf(path, sizeof path, "%s/%s%s.png", run->arguments->out, name, ending);
    // Level 3 takes a third of the time and a few percent more bytes.
    uint8_t *bytes;
    size_t count;
    enum status status =
        png_encode(&(struct png_layout){kind, run->lens.width, run->lens.height}, pixels, 3, &bytes, &count);
    if (status != OK)
        return status;
    status = file_write_unsynced(path, bytes, count); // a run writes thousands, and can be made again
    free(bytes);
    return status;
}

// The actor into a picture taken at a known pose.
static enum status draw_placed(struct render_run *run, const struct frame *frame, struct pose world_from_camera)
{
    write_pose(run->trajectory, frame->time_ns, world_from_camera);
    const struct affine_map viewer_from_room = affine_from_pose(pose_inverse(world_from_camera));
    struct renderer_view view = {.world_from_camera = world_from_camera,
                                 .viewer_from_room = &viewer_from_room,
                                 .time_ns = frame->time_ns - run->first_ns + llround(run->arguments->start_s * 1e9),
                                 .color = frame->color};
    struct renderer_result result;
    const enum status status = renderer_draw(run->renderer, &view, &result);
    if (status != OK)
        return status;
    run->with_actor += result.parts > 0;
    run->parts += result.parts;
    run->error_px += result.parts > 0 ? result.error_px : 0;
    run->share_of_full += result.parts > 0 ? result.share_of_full : 0;
    if (result.parts)
        run->at_level[result.level]++;
    return OK;
}

static enum status draw_frame(struct render_run *run, const struct frame *frame)
{
    struct location location;
    struct camera_motion motion;
    if (run->path.count) {
        picture_count_add(&run->count, OK);
        return draw_placed(run, frame, run->path.poses[run->images - 1].pose);
    }
    enum status found = picture_check_add(run->check, frame->color);
    if (found != OK)
        return found;
    found = camera_tracker_process(run->track, frame->color, NULL, frame->time_ns, &location, &motion);
    add_stage_time(run, STAGE_LOCATE);
    if (found < 0 && found != ERR_SOLVER) // a solver that did not converge leaves this image unplaced
        return found;
    picture_count_add(&run->count, found);
    if (found != OK && found != AMBIGUOUS)
        return renderer_draw_background(run->renderer, frame->color);
    const enum status status = renderer_set_lens(run->renderer, camera_tracker_lens(run->track));
    return status == OK ? draw_placed(run, frame, location.world_from_camera) : status;
}

static enum status render_image(struct render_run *run, const struct frame *frame)
{
    if (!run->started)
        run->first_ns = frame->time_ns;
    run->started = true;
    run->images++;
    enum status status = draw_frame(run, frame);
    add_stage_time(run, STAGE_DRAW);
    if (status == OK)
        status = renderer_read(run->renderer, run->rgb);
    if (status == OK && run->arguments->layers)
        status = renderer_read_actor(run->renderer, run->rgba);
    add_stage_time(run, STAGE_READ);
    if (status == OK)
        status = write_image(run, frame->name, "", PNG_RGB8, run->rgb);
    if (status == OK && run->video)
        status = video_add(run->video, run->rgb, frame->time_ns);
    if (status == OK && run->arguments->layers)
        status = write_image(run, frame->name, "_actor", PNG_RGBA8, run->rgba);
    if (status == OK && run->arguments->layers)
        status = renderer_read_source(run->renderer, run->rgb);
    if (status == OK && run->arguments->layers)
        status = write_image(run, frame->name, "_source", PNG_RGB8, run->rgb);
    add_stage_time(run, STAGE_WRITE);
    return status;
}

// The next image: of the camera, or of the place from the path's next pose. NOTHING: the end.
static enum status next_image(struct render_run *run, struct frame *frame)
{
    if (!run->path.count)
        return source_frames_next(&run->frames, frame);
    if (run->images == run->path.count)
        return NOTHING;
    const struct timed_pose *pose = &run->path.poses[run->images];
    *frame = (struct frame){.time_ns = pose->time_ns, .color = run->path.room.view.rgb};
    snprintf(frame->name, sizeof frame->name, "%04d", (int)run->images);
    return filmed_path_draw(&run->path, (int)run->images);
}

static enum status render_images(struct render_run *run)
{
    struct progress_bar progress;
    progress_bar_start(&progress, "drawing", run->path.count ? run->path.count : source_remaining(run->camera));
    enum status status = OK;
    run->lap_ns = clock_now_ns();
    run->frames = (struct source_frames){.source = run->camera, .program = "reenact render", .bar = &progress};
    while (!command_stopped()) {
        struct frame frame;
        status = next_image(run, &frame);
        add_stage_time(run, STAGE_CAMERA);
        if (status == OK && frame.color)
            status = render_image(run, &frame);
        if (status != OK)
            break;
        progress_bar_step(&progress);
    }
    progress_bar_end(&progress);
    run->frames.bar = NULL; // it lived here
    run->count.unreadable = run->frames.damaged;
    if (status < 0)
        return status;
    if (command_stopped() && !run->images)
        return fail(ERR_INPUT, "stopped before the first picture");
    if (!run->images)
        return fail(ERR_INPUT, "%s gave no picture", run->arguments->camera);
    return OK;
}

static enum status write_trajectory(struct render_run *run)
{
    char path[4096];
    if (fflush(run->trajectory) || ferror(run->trajectory))
        return fail(ERR_MEMORY, "no memory for the trajectory");
    snprintf(path, sizeof path, "%s/trajectory.txt", run->arguments->out);
    return file_write(path, run->trajectory_text, run->trajectory_bytes);
}

static enum status write_stats(struct render_run *run)
{
    struct json *root = json_new_object();
    json_add_string(root, "take", run->arguments->take);
    json_add_string(root, "detail", detail_names[run->arguments->detail]);
    picture_count_add_json(root, &run->count);
    json_add_number(root, "with_actor", (double)run->with_actor);
    struct json *levels = json_add_object(root, "pictures_at_level");
    for (int d = 0; d < DETAIL_LEVELS; d++)
        json_add_number(levels, detail_names[d], (double)run->at_level[d]);
    json_add_number(root, "parts_per_picture", run->with_actor ? (double)run->parts / (double)run->with_actor : 0);
    json_add_number(root, "predicted_error_px", run->with_actor ? run->error_px / (double)run->with_actor : 0);
    if (run->with_actor && isfinite(run->share_of_full)) // of auto: what it took, and by that saved
        json_add_number(root, "share_of_full_time", run->share_of_full / (double)run->with_actor);
    struct json *times = json_add_object(root, "ms_per_picture");
    for (int s = 0; s < STAGE_COUNT; s++)
        json_add_number(times, stage_names[s], (double)run->spent_ns[s] * 1e-6 / (double)run->images);
    json_add_string(root, "renderer", gpu_renderer(run->gpu));
    char *text = json_print(root);
    json_free(&root);
    if (!text)
        return fail(ERR_MEMORY, "no memory for the picture");
    char path[4096];
    snprintf(path, sizeof path, "%s/stats.json", run->arguments->out);
    enum status status = file_write(path, text, strlen(text));
    if (status == OK && run->arguments->json)
        fputs(text, stdout);
    free(text);
    return status;
}

// Whether the camera's lens and pictures belong together. ERR_INPUT: the actor is drawn where they were not.
static enum status check_pictures(const struct render_run *run, const char *program)
{
    struct picture_verdict verdict;
    char cause[PICTURE_TEXT_BYTES];
    bool useless;
    const enum status status = picture_check_judge(run->check, camera_tracker_lens(run->track), &verdict);
    if (status != OK)
        return status;
    picture_verdict_text(&verdict, picture_count_is_few(&run->count), cause, &useless);
    if (useless)
        return fail(ERR_INPUT, "%s; the actor may be drawn in wrong places or not at all", cause);
    if (*cause)
        fprintf(stderr, "%s: warning: %s\n", program, cause);
    return OK;
}

int reenact_render(int argc, char **argv)
{
    struct render_arguments arguments = {.detail = renderer_default_options().detail,
                                         .error_px = renderer_default_options().error_px};
    static const struct argp argp = {
        options,
        parse_option,
        "FILE",
        "Draws a take into a camera's pictures.\v"
        "Every image is placed in FILE's place; the take starts with the first one. For image 0007.* this writes "
        "0007.png. An image that cannot be placed is written as it came.",
        NULL,
        NULL,
        NULL};
    command_parse(&argp, argc, argv, &arguments);
    command_catch_signals();
    struct render_run run = {.arguments = &arguments};
    enum status status = open_run(&run);
    if (status == OK)
        status = render_images(&run);
    const bool live = run.camera && source_is_live(run.camera); // then Ctrl-C is how it ends
    if (status == OK && command_stopped() && run.video && !live)
        status = fail(ERR_IO, "stopped; the pictures drawn so far are in %s, there is no film", arguments.out);
    status = output_close(&run.film, video_close(&run.video, status));
    if (status == OK)
        status = write_trajectory(&run);
    if (status == OK)
        status = write_stats(&run);
    if (status == OK && run.camera) {
        const enum status kept = source_save_lens(run.camera, camera_tracker_lens(run.track));
        status = kept < 0 ? kept : OK;
    }
    char text[PICTURE_COUNT_BYTES];
    if (status == OK && !arguments.json)
        printf("%s: %s, %" PRId64 " with the actor\n", arguments.out, picture_count_text(&run.count, text),
               run.with_actor);
    if (status == OK && run.camera)
        status = check_pictures(&run, argv[0]);
    if (status == OK && run.camera) {
        int32_t first_moved, tags_moved = camera_tracker_moved_tags(run.track, &first_moved);
        command_warn_moved_tags(argv[0], tags_moved, first_moved);
        if (!live)
            command_warn_times(argv[0], source_dropped(run.camera));
        status = source_frames_end(&run.frames);
    }
    close_run(&run);
    return status == OK ? 0 : command_failed(argv[0]);
}
