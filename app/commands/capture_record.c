// reenact-capture record: records a take of the actor.
#include "app/commands/commands.h"
#include "app/commands/place_input.h"
#include "app/commands/take_summary.h"
#include "capture/recorder.h"
#include "capture/take_verdict.h"
#include "platform/files/file.h"
#include "platform/files/json.h"

#include <stdio.h>

struct record_arguments {
    const char *sensor, *into, *out, *take;
    enum verdict_purpose purpose;
    bool json, no_body_points;
};

enum { KEY_FOR = COMMAND_KEY + 6 };

static error_t parse_option(int key, char *value, struct argp_state *state)
{
    struct record_arguments *given = state->input;
    switch (key) {
    case COMMAND_KEY: given->sensor = value; return 0;
    case COMMAND_KEY + 1: given->into = value; return 0;
    case COMMAND_KEY + 2: given->out = value; return 0;
    case COMMAND_KEY + 3: given->take = value; return 0;
    case COMMAND_KEY + 4: given->json = true; return 0;
    case COMMAND_KEY + 5: given->no_body_points = true; return 0;
    case KEY_FOR:
        if (!verdict_purpose_named(value, &given->purpose))
            argp_error(state, "--for is compare, watch or both, not '%s'", value);
        return 0;
    case ARGP_KEY_ARG: command_refuse_argument(state, value); return 0;
    case ARGP_KEY_END:
        command_require(state, given->sensor, "--sensor URI");
        command_require(state, given->take, "--take NAME");
        if (!given->into == !given->out)
            argp_error(state, "either --into FILE, for an existing recording, or --out FILE, for a new one");
        return 0;
    }
    return ARGP_ERR_UNKNOWN;
}

// What the recorder's callbacks share.
struct record_work {
    struct progress_bar progress;
    struct coaching_line coaching;
    struct recorder_state state;
    bool filming;
};

static const double SHORT_MINUTES = 10; // from here on the disk's room is worth the line

static void update_progress(void *context)
{
    struct record_work *w = context;
    char *note = w->progress.note;
    const size_t capacity = sizeof w->progress.note;
    if (w->filming) {
        int used = 0;
        if (w->state.dropped)
            used = snprintf(note, capacity, "%lld dropped · ", (long long)w->state.dropped);
        if (w->state.minutes_left >= 0 && w->state.minutes_left < SHORT_MINUTES)
            used += snprintf(note + used, capacity - (size_t)used, "%.0f min left · ", w->state.minutes_left);
        coaching_line_text(&w->coaching, note + used, capacity - (size_t)used);
    }
    progress_bar_step(&w->progress);
}

static void update_coaching(void *context, const struct recorder_seen *seen)
{
    coaching_line_see(&((struct record_work *)context)->coaching, seen);
}

static void keep_state(void *context, const struct recorder_state *state)
{
    ((struct record_work *)context)->state = *state;
}

static void start_smoothing(void *context, int64_t frames)
{
    struct record_work *w = context;
    command_catch_signals(); // forget the one that ended the filming
    w->filming = false;
    progress_bar_end(&w->progress);
    progress_bar_start(&w->progress, "smoothing", frames);
}

static void report_verdict(const struct take_verdict *verdict)
{
    printf("verdict: %s\n", verdict_headline(verdict));
    for (int i = 0; i < verdict->count; i++)
        if (verdict_shows_line(verdict, i))
            printf("         %s\n", verdict->line[i].text);
}

static enum status report_take(const struct record_arguments *given, const struct recorder_result *result,
                               const struct take_verdict *verdict)
{
    if (given->json) {
        struct json *root = json_new_object();
        json_add_string(root, "take", given->take);
        json_add_number(root, "frames", (double)result->frames);
        json_add_number(root, "tracked", (double)result->tracked);
        json_add_number(root, "body_points_looked", (double)result->looked);
        json_add_number(root, "dropped", (double)result->dropped);
        json_add_number(root, "damaged", (double)result->damaged);
        json_add_bool(root, "located", result->located);
        json_add_bool(root, "mirrored", result->mirrored);
        json_add_number(root, "sensor_moves", result->sensor_moves);
        json_add_number(root, "tags_moved", result->tags_moved);
        json_add_number(root, "mean_ms", result->mean_ms);
        json_add_number(root, "slowest_ms", result->slowest_ms);
        json_add_number(root, "smoothing_ms", result->smoothing_ms);
        json_add_number(root, "waiting_max", result->waiting_max);
        json_add_number(root, "handover_ms", result->handover_ms);
        json_add_number(root, "mb_per_s", result->mb_per_s);
        verdict_add_json(root, verdict);
        return command_print_json(&root);
    }
    printf("take '%s': %lld frames, a person in %lld, %lld dropped\n", given->take, (long long)result->frames,
           (long long)result->tracked, (long long)result->dropped);
    if (result->mb_per_s > 0)
        printf("%.1f MB a second of film\n", result->mb_per_s);
    if (result->smoothing_ms <= 0 && result->tracked)
        printf("the joints were not smoothed: they are the online estimates\n");
    if (result->sensor_moves)
        printf("the sensor was moved %d times; keep it on a stand\n", result->sensor_moves);
    report_verdict(verdict);
    return OK;
}

// Of a take that broke off: fewer frames reached the file than were given to it. As it was where the file cannot be
// read.
static void count_in_file(const char *path, const char *name, struct recorder_result *result)
{
    struct recording *recording = NULL;
    struct take *take = NULL;
    struct failure first;
    failure_keep(&first, ERR_IO);
    if (recording_open(&recording, path) == OK && take_open(&take, recording, name) == OK) {
        result->frames = take_frame_count(take);
        result->tracked = 0;
        for (int64_t i = 0; i < result->frames; i++)
            result->tracked += take_entry(take, i)->has_skeleton;
    }
    take_close(&take);
    recording_free(&recording);
    status_ignore(failure_restore(&first)); // the status is the caller's
}

// What did not go well but is no reason to fail.
static void print_warnings(const char *program, bool has_place, const struct recorder_result *result,
                           const struct take_verdict *verdict)
{
    if (result->damaged)
        fprintf(stderr, "%s: %lld pictures could not be read and were left out; the first: %s\n", program,
                (long long)result->damaged, result->first_damage);
    if (*result->no_body_points)
        fprintf(stderr, "%s: tracked from depth alone, without body points from colour: %s\n", program,
                result->no_body_points);
    if (result->mirrored)
        fprintf(stderr,
                "%s: the pictures are mirrored, so that none of the place's tags is recognised: switch the sensor's "
                "mirror off and film again\n",
                program);
    else if (has_place && !result->located)
        fprintf(stderr, "%s: the sensor recognised nothing of the place, so it is unknown where the actor stood\n",
                program);
    command_warn_moved_tags(program, result->tags_moved, result->first_moved);
    if (result->frames && !result->tracked) // the verdict's first line says why, where that can be told
        fprintf(stderr, "%s: no person was found in any frame%s%s\n", program, verdict->count ? ": " : "",
                verdict->count ? verdict->line[0].text : "");
}

static enum status record_take(const struct record_arguments *given, struct place *place,
                               struct recorder_result *result, struct take_verdict *verdict)
{
    struct source *source = NULL;
    struct recording_writer *writer = NULL;
    static struct record_work work; // a coach is too large for the stack
    enum status status = given->into ? place_input_read(given->into, place) : recording_check_new(given->out);
    if (status == ERR_CORRUPT) { // a take can be filmed without it
        fprintf(stderr, "reenact-capture record: warning: %s\n", status_message());
        status = OK;
    }
    if (status == NOTHING) // a file without a place is fine
        status = OK;
    if (status == OK)
        status = source_open(&source, given->sensor, SOURCE_SENSOR);
    if (status == OK)
        status = given->into ? recording_append(&writer, given->into) : recording_create(&writer, given->out);
    if (status == OK) {
        struct recorder_options options = {.should_stop = command_stopped,
                                           .on_frame = update_progress,
                                           .on_state = keep_state,
                                           .on_smoothing_begin = start_smoothing,
                                           .on_smoothed = update_progress,
                                           .on_seen = update_coaching,
                                           .context = &work,
                                           .body_points = !given->no_body_points};
        command_catch_signals();
        progress_bar_start(&work.progress, "filming", source_remaining(source));
        coaching_line_start(&work.coaching, source_calibration(source), given->purpose);
        work.filming = true;
        status = recorder_run(source, writer, given->take, place, &options, result);
        progress_bar_end(&work.progress);
        coaching_line_end(&work.coaching);
    }
    const bool made = writer && given->out;
    if (status == OK && !source_is_live(source))
        command_warn_times("reenact-capture record", source_dropped(source));
    if (status == OK)
        command_warn_clocks("reenact-capture record", source);
    enum status closed = recording_close(&writer);
    source_close(&source);
    status = status != OK ? status : closed;
    if (status != OK && result->frames)
        count_in_file(given->into ? given->into : given->out, given->take, result);
    if (made && !result->frames) { // a file without a take is of no use
        struct failure first;
        failure_keep(&first, status);
        recording_discard(given->out);
        status = failure_restore(&first);
    }
    if (result->frames) {
        const struct take_filming filming = {given->purpose, &work.coaching.coach};
        struct failure first;
        failure_keep(&first, status);
        struct take_judgement judgement = {0};
        status = take_verdict_keep(given->into ? given->into : given->out, given->take, &filming, &judgement);
        *verdict = judgement.verdict;
        status = first.status != OK ? failure_restore(&first) : status;
    }
    return status;
}

int capture_record(int argc, char **argv)
{
    static const struct argp_option options[] = {
        {"sensor", COMMAND_KEY, "URI", 0, SOURCE_SENSOR_URIS, 0},
        {"into", COMMAND_KEY + 1, "FILE", 0, "add the take to this recording, whose place the sensor is located in", 0},
        {"out", COMMAND_KEY + 2, "FILE", 0, "make a new recording without a place", 0},
        {"take", COMMAND_KEY + 3, "NAME", 0, "the take's name", 0},
        {"for", KEY_FOR, "PURPOSE", 0,
         "what the take is for: compare (and to be done alongside; turning round is not asked for), watch (from all "
         "sides) or both, which is the default",
         0},
        {"no-body-points", COMMAND_KEY + 5, NULL, 0,
         "track from depth alone, even where the networks that find body points in colour images are there", 0},
        COMMAND_OPTION_JSON(COMMAND_KEY + 4),
        {0},
    };
    static const struct argp argp = {
        options, parse_option,
        NULL,    "Films the actor.\vCtrl-C ends the take in good order. Put the sensor on a stand.",
        0,       0,
        0};
    struct record_arguments given = {0};
    command_parse(&argp, argc, argv, &given);
    struct place place = {0};
    struct recorder_result result = {0};
    struct take_verdict verdict = {0};
    enum status status = record_take(&given, &place, &result, &verdict);
    bool has_place = place.tag_count > 0 || place.point_count > 0;
    place_free(&place);
    struct failure filmed;
    failure_keep(&filmed, status);
    if (result.frames)
        status = report_take(&given, &result, &verdict);
    if (filmed.status != OK)
        status = failure_restore(&filmed);
    if (status == OK && !result.frames)
        status = fail(ERR_INPUT, "nothing was filmed, so no take was kept%s%s", result.damaged ? ": " : "",
                      result.first_damage);
    if (status == OK && result.smoothing_out_of_memory)
        status = fail(ERR_MEMORY, "no memory to smooth the joints of take '%s', which is whole otherwise", given.take);
    if (status == OK)
        print_warnings(argv[0], has_place, &result, &verdict);
    return status == OK ? 0 : command_failed(argv[0]);
}
