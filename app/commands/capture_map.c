// reenact-capture map: maps the empty place from a sweep.
#include "app/commands/capture_objects.h"
#include "app/commands/command.h"
#include "app/commands/commands.h"
#include "app/commands/place_input.h"
#include "base/clock.h"
#include "base/text.h"
#include "capture/mapping/map_advice.h"
#include "platform/files/file.h"
#include "platform/files/json.h"
#include "recording/recording.h"

#include <stdio.h>
#include <stdlib.h>
#include <unistd.h>

struct map_arguments {
    const char *sensor, *camera, *tags, *out, *into; // one of the first two
    const char *objects, *knowledge;
    double seconds, decimate;
    bool json;
};

enum {
    KEY_SENSOR = COMMAND_KEY,
    KEY_CAMERA,
    KEY_TAGS,
    KEY_OUT,
    KEY_INTO,
    KEY_JSON,
    KEY_SECONDS,
    KEY_DECIMATE,
    KEY_OBJECTS,
    KEY_KNOWLEDGE
};

static const struct argp_option options[] = {
    {"sensor", KEY_SENSOR, "URI", 0, "the depth sensor: " SOURCE_SENSOR_URIS, 0},
    {"camera", KEY_CAMERA, "URI", 0,
     "instead of a sensor a camera without depth: libcamera, libcamera:N or folder:DIR; then --tags give the "
     "scale, and landmarks are triangulated from several pictures",
     0},
    {"tags", KEY_TAGS, "TAGS.json", 0,
     "which tags hang in the place and how large they are: {\"family\": \"tag36h11\", \"side_m\": {\"0\": 0.2}}; "
     "the side is the outer edge of the black square; without it the place is made of landmarks and depth",
     0},
    {"out", KEY_OUT, "FILE", 0, "the recording to make; must not exist", 0},
    {"into", KEY_INTO, "FILE", 0,
     "add to the place in this recording, in the same axes; begin where the place is known. Takes and tags stay as "
     "they are; --tags lists new ones",
     0},
    {"objects", KEY_OBJECTS, "OBJECTS.json", 0,
     "also look for these things in the sweep's sharp pictures: names, reference pictures, sizes, URLs; what is no "
     "longer where an earlier sweep found it is marked as gone",
     0},
    {"knowledge", KEY_KNOWLEDGE, "URL", 0, "with --objects: ask this knowledge base what is known of each", 0},
    {"seconds", KEY_SECONDS, "S", 0, "film for S seconds; without it until the folder ends or Ctrl-C is pressed once",
     0},
    COMMAND_OPTION_QUAD_DECIMATE(KEY_DECIMATE),
    COMMAND_OPTION_JSON(KEY_JSON),
    {0},
};

static error_t parse_option(int key, char *value, struct argp_state *state)
{
    struct map_arguments *a = state->input;
    switch (key) {
    case KEY_SENSOR: a->sensor = value; return 0;
    case KEY_CAMERA: a->camera = value; return 0;
    case KEY_TAGS: a->tags = value; return 0;
    case KEY_OUT: a->out = value; return 0;
    case KEY_INTO: a->into = value; return 0;
    case KEY_OBJECTS: a->objects = value; return 0;
    case KEY_KNOWLEDGE: a->knowledge = value; return 0;
    case KEY_JSON: a->json = true; return 0;
    case KEY_SECONDS: a->seconds = command_parse_number(state, "--seconds", value, 0.1, 1e6); return 0;
    case KEY_DECIMATE: a->decimate = command_parse_quad_decimate(state, value); return 0;
    case ARGP_KEY_ARG: command_refuse_argument(state, value); return 0;
    case ARGP_KEY_END:
        if (!a->sensor == !a->camera)
            argp_error(state, "either --sensor URI, with depth, or --camera URI, without");
        if (!a->into == !a->out)
            argp_error(state, "either --out FILE, for a new recording, or --into FILE, for an existing place");
        return 0;
    default: return ARGP_ERR_UNKNOWN;
    }
}

// What to show the sensor next, in the status line.
static void note_progress(struct mapper *mapper, char *out, size_t capacity)
{
    struct mapper_progress p;
    const struct sweep_plan *plan = mapper_plan(mapper);
    if (plan) {
        snprintf(out, capacity, "%.95s", plan->text); // as long as the status line
        return;
    }
    mapper_get_progress(mapper, &p);
    if (!p.listed)
        snprintf(out, capacity, "move slowly, come back to where you began");
    else if (p.apart_a >= 0)
        snprintf(out, capacity, "%d of %d tags · show tag %d together with tag %d, or with what is between them",
                 (int)p.seen, (int)p.listed, (int)p.apart_a, (int)p.apart_b);
    else if (p.first_unseen >= 0)
        snprintf(out, capacity, "%d of %d tags · tag %d is still missing", (int)p.seen, (int)p.listed,
                 (int)p.first_unseen);
    else
        snprintf(out, capacity, "all %d tags are seen", (int)p.listed);
}

// Feeds the mapper until the source ends; pictures: kept where things are looked for. NOTHING: stopped before the end
// of a source that has one.
static enum status feed_mapper(struct source *source, struct mapper *mapper, const struct map_arguments *arguments,
                               struct sweep_pictures *pictures, struct sweep_trouble *trouble)
{
    struct progress_bar bar;
    struct frame frame;
    struct source_frames frames = {.source = source};
    enum status status;
    bool live = source_is_live(source);
    int64_t first_ns = 0;
    progress_bar_start(&bar, live ? "filming the place, Ctrl-C when done" : "mapping", source_remaining(source));
    while ((status = source_frames_next(&frames, &frame)) == OK) {
        if (frames.count == 1)
            first_ns = frame.time_ns;
        if (arguments->seconds > 0 && (double)(frame.time_ns - first_ns) * 1e-9 > arguments->seconds)
            break;
        status = mapper_add(mapper, &frame);
        if (status == OK && arguments->objects)
            status = sweep_pictures_add(pictures, &frame);
        if (status != OK)
            break;
        if (bar.done % 10 == 0)
            note_progress(mapper, bar.note, sizeof bar.note);
        progress_bar_step(&bar);
    }
    progress_bar_end(&bar);
    trouble->damaged = frames.damaged;
    snprintf(trouble->cut, sizeof trouble->cut, "%s", frames.cut);
    if (status == NOTHING)
        status = command_stopped() && !live ? NOTHING : OK;
    return status;
}

// Everything is in the file, or there is no file.
static enum status write_place(const char *path, const struct place *place)
{
    struct recording_writer *writer;
    enum status status = recording_create(&writer, path);
    if (status != OK)
        return status;
    status = recording_put_place(writer, place);
    enum status closed = recording_close(&writer);
    if (status == OK)
        status = closed;
    if (status != OK || command_stopped())
        recording_discard(path);
    return status;
}

// The place is replaced as a whole, or the file stays as it was.
static enum status rewrite_place(const char *path, const struct place *place)
{
    struct recording_writer *writer;
    enum status status = recording_append(&writer, path);
    if (status != OK)
        return status;
    status = recording_put_place(writer, place);
    enum status closed = recording_close(&writer);
    return status != OK ? status : closed;
}

static enum status read_place(const char *path, struct place *out)
{
    enum status status = place_input_read(path, out);
    return status == NOTHING ? fail(ERR_INPUT, "%s holds no place yet; film one with map --out", path) : status;
}

static enum status print_json(const char *path, const struct place *before, const struct place *place,
                              const struct mapper_report *report, int64_t damaged)
{
    struct json *root = json_new_object();
    json_add_string(root, "file", path);
    json_add_number(root, "frames", report->frames_seen);
    json_add_number(root, "frames_used", report->frames);
    json_add_number(root, "frames_placed", report->frames_placed);
    json_add_number(root, "lost_from_s", report->lost_from_s);
    json_add_number(root, "lost_to_s", report->lost_to_s);
    json_add_number(root, "frames_damaged", (double)damaged);
    json_add_number(root, "tags_unseen", report->tags_unseen);
    json_add_number(root, "tags_apart", report->tags_disconnected);
    json_add_number(root, "tags_unlisted", report->tags_unlisted);
    json_add_number(root, "tags_moved", report->tags_moved);
    json_add_number(root, "tags_outlier", report->tags_outlier);
    json_add_number(root, "tags_new", place->tag_count - before->tag_count);
    json_add_number(root, "points_new", place->point_count - before->point_count);
    json_add_number(root, "views_new", place->view_count - before->view_count);
    json_add_number(root, "points", place->point_count);
    json_add_number(root, "views", place->view_count);
    json_add_number(root, "rms_px", place->rms_px);
    json_add_number(root, "rms_m", place->rms_m);
    json_add_bool(root, "floor_seen", report->floor_from_depth);
    json_add_number(root, "tags_wrong_side", report->tags_wrong_side);
    if (report->tags_wrong_side) {
        json_add_number(root, "wrong_side_tag", report->first_wrong);
        json_add_number(root, "wrong_side_listed_m", report->listed_side_m);
        json_add_number(root, "wrong_side_measured_m", report->measured_m);
    }
    struct json *tags = json_add_array(root, "tags");
    for (int32_t i = 0; i < place->tag_count; i++) {
        const struct place_tag *t = &place->tags[i];
        struct json *tag = json_add_object(tags, NULL);
        json_add_number(tag, "id", t->id);
        json_add_number(tag, "side_m", t->side_m);
        json_add_number(tag, "sightings", t->observations);
        json_add_number(tag, "rms_px", t->rms_px);
        struct vec3 world[4];
        place_tag_corners(t, world);
        struct json *corners = json_add_array(tag, "corners");
        for (int k = 0; k < 4; k++) {
            struct json *corner = json_add_array(corners, NULL);
            json_push_number(corner, world[k].x);
            json_push_number(corner, world[k].y);
            json_push_number(corner, world[k].z);
        }
    }
    return command_print_json(&root);
}

static void print_text(const char *path, const struct place *before, const struct place *place,
                       const struct mapper_report *report)
{
    char shown[TEXT_SHOWN_BYTES];
    printf("%s: a place with %d tags and %d landmarks, from %d of %d pictures\n", text_shown(path, shown),
           (int)place->tag_count, (int)place->point_count, (int)report->frames_placed, (int)report->frames);
    if (before->tag_count || before->point_count)
        printf("%d tags and %d points are new\n", (int)(place->tag_count - before->tag_count),
               (int)(place->point_count - before->point_count));
    printf("%s fit to %.2f pixels", place->tag_count ? "tags" : "points", place->rms_px);
    if (place->rms_m > 0)
        printf(", depth to %.0f mm", place->rms_m * 1e3);
    printf("; %d views kept\n", (int)place->view_count);
}

static void print_things(const struct objects_found *found)
{
    printf("%d things were found in %d sharp pictures", found->things, found->searched);
    if (found->gone)
        printf("; %d are gone from where they were", found->gone);
    putchar('\n');
}

static void print_warnings(const char *program, const struct map_advice *advice)
{
    for (int i = 0; i < advice->count; i++)
        fprintf(stderr, "%s: warning: %s\n", program, advice->line[i]);
}

// Off a terminal: a line every ten seconds, so that a log shows that it works.
static void on_step(void *self)
{
    const int64_t every_ns = 10000000000, now_ns = clock_now_ns();
    int64_t *last_ns = self;
    if (!*last_ns)
        *last_ns = now_ns;
    if (isatty(STDERR_FILENO) || now_ns - *last_ns < every_ns)
        return;
    *last_ns = now_ns;
    fputs("adjusting tags, landmarks and the camera's path to one another\n", stderr);
}

// Solves for everything that was seen, which has no steps to count: some seconds, a minute for a long sweep.
static enum status finish_map(struct mapper *mapper, struct place *place, struct mapper_report *report)
{
    const bool shows = isatty(STDERR_FILENO);
    if (shows)
        fputs("adjusting tags, landmarks and the camera's path to one another …", stderr);
    const enum status status = mapper_finish(mapper, place, report);
    if (shows)
        fputs("\r\033[K", stderr);
    return status;
}

static int map_place(const char *program, const struct map_arguments *arguments, const struct mapper_tag *tags,
                     int32_t tag_count)
{
    struct source *source = NULL;
    struct mapper *mapper = NULL;
    struct place before = {0}, place = {0};
    struct sweep_pictures pictures = {.count = 0};
    struct mapper_report report = {0};
    struct mapper_options wanted = mapper_default_options();
    const char *file = arguments->into ? arguments->into : arguments->out;
    struct sweep_trouble trouble = {0};
    int64_t last_ns = 0; // when on_step last said something
    wanted.on_step = on_step;
    wanted.self = &last_ns;
    if (arguments->decimate > 0)
        wanted.quad_decimate = arguments->decimate;
    wanted.prior = arguments->into ? &before : NULL;
    enum status status = arguments->into ? recording_check_change(arguments->into) : OK;
    if (status == OK && arguments->into)
        status = read_place(arguments->into, &before);
    if (status == OK)
        status = arguments->sensor ? source_open(&source, arguments->sensor, SOURCE_SENSOR)
                                   : source_open(&source, arguments->camera, SOURCE_CAMERA);
    wanted.plan = source && source_is_live(source); // then hints are of use
    if (status == OK)
        status = mapper_open(&mapper, source_calibration(source), tags, tag_count, &wanted);
    if (status == OK) {
        command_catch_signals();
        sweep_pictures_start(&pictures, source_calibration(source));
        status = feed_mapper(source, mapper, arguments, &pictures, &trouble);
    }
    bool live = source && source_is_live(source);
    if (status == OK && !live)
        command_warn_times(program, source_dropped(source));
    if (status == OK)
        command_warn_clocks(program, source);
    source_close(&source);
    if (status == OK)
        status = finish_map(mapper, &place, &report);
    if (status == OK && !live && command_stopped())
        status = NOTHING;
    if (status == OK)
        status = arguments->into ? rewrite_place(arguments->into, &place) : write_place(arguments->out, &place);
    const struct objects_arguments things = {
        .objects = arguments->objects, .into = file, .knowledge = arguments->knowledge};
    const struct objects_sweep sweep = {&before, &pictures, mapper};
    struct objects_found found = {0};
    if (status == OK && arguments->objects)
        status = objects_in_sweep(&things, &sweep, &found);
    if (status == OK) {
        struct map_advice advice;
        map_advise(&place, &report, &trouble, &advice);
        print_warnings(program, &advice);
        if (arguments->json)
            status = print_json(file, &before, &place, &report, trouble.damaged);
        else
            print_text(file, &before, &place, &report);
        if (arguments->objects && !arguments->json)
            print_things(&found);
    }
    mapper_close(&mapper);
    sweep_pictures_free(&pictures);
    place_free(&place);
    place_free(&before);
    if (status == NOTHING) {
        fprintf(stderr, "%s: stopped; %s\n", program,
                arguments->into ? "the file stays as it was" : "no file was made");
        return 1;
    }
    if (status != OK)
        return command_failed(program);
    return *trouble.cut ? 1 : 0; // said among the warnings
}

int capture_map(int argc, char **argv)
{
    struct map_arguments a = {0};
    const struct argp argp = {
        options,
        parse_option,
        "(--sensor URI [--tags TAGS.json] | --camera URI --tags TAGS.json) (--out FILE | --into FILE)",
        "Film the empty place: where its tags hang, where its landmarks are, what it looks like.\v"
        "Walk through the empty room with the sensor and show it every tag from near and far, two at a time where "
        "possible, and the floor. Scale comes from the tags' sides and the sensor's depth together. Without --tags "
        "the place is known by its landmarks alone: move slowly, and come back to where you began. "
        "With --into another sweep adds what the first one did not see; what is known already must be in sight now "
        "and then. --camera takes any camera whose lens calibration.json describes; the scale then comes from the "
        "printed tags alone.",
        NULL,
        NULL,
        NULL};
    command_parse(&argp, argc, argv, &a);
    if (a.out && recording_check_new(a.out) != OK)
        return command_failed(argv[0]);
    struct thing_list things = {0};
    if (a.objects && thing_list_read(a.objects, &things) != OK) // said before the sweep, not after it
        return command_failed(argv[0]);
    thing_list_free(&things);
    struct mapper_tag *tags = NULL;
    int32_t count = 0;
    if (a.tags && mapper_read_tags(a.tags, &tags, &count) != OK)
        return command_failed(argv[0]);
    int code = map_place(argv[0], &a, tags, count);
    free(tags);
    return code;
}
