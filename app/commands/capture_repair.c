// reenact-capture verify FILE and repair FILE: what of a recording can be read, and a new one of it.
#include "app/commands/command.h"
#include "app/commands/commands.h"
#include "base/text.h"
#include "capture/take_verdict.h"
#include "platform/files/file.h"
#include "platform/files/json.h"

#include <stdio.h>
#include <string.h>

// ---------------------------------------------------------------- the report

// As the end of a list of what is lost: covariances of joints; the place, or its views; and things.
static void print_rest(const struct recording_report *report)
{
    if (report->lost_covariances)
        printf("covariances of the joints in %lld frames, ", (long long)report->lost_covariances);
    if (report->lost_place)
        printf("the place with its views");
    else
        printf("%d views of the place", (int)report->lost_views);
    if (report->lost_map_covariances)
        printf(", covariances or viewing directions of its points and tags");
    if (report->lost_things)
        printf(", %d things in it or their pictures", report->lost_things);
}

// One JSON object: the report and the status, with the error sentence where it is not OK. ERR_MEMORY.
static enum status print_json(const char *path, enum status status, const struct recording_report *report)
{
    struct json *root = json_new_object();
    json_add_string(root, "file", path);
    json_add_string(root, "status", status_name(status));
    if (status != OK)
        json_add_string(root, "reason", status_message());
    json_add_number(root, "takes", report->takes);
    json_add_number(root, "interrupted_takes", report->interrupted_takes);
    json_add_number(root, "frames", (double)report->frames);
    json_add_number(root, "damaged_frames", (double)report->damaged_frames);
    json_add_number(root, "lost_frames", (double)report->lost_frames);
    json_add_number(root, "lost_covariances", (double)report->lost_covariances);
    json_add_number(root, "lost_takes", report->lost_takes);
    json_add_number(root, "lost_views", report->lost_views);
    json_add_bool(root, "lost_place", report->lost_place);
    json_add_bool(root, "lost_map_covariances", report->lost_map_covariances);
    json_add_number(root, "lost_things", report->lost_things);
    json_add_number(root, "findings", report->findings);
    struct json *list = json_add_array(root, "first_findings");
    for (int i = 0; i < report->findings && i < RECORDING_FINDINGS_MAX; i++)
        json_push_string(list, report->finding[i]);
    json_add_number(root, "bytes", (double)report->bytes);
    return command_print_json(&root);
}

// ---------------------------------------------------------------- verify

static enum status print_soundness(const struct file_arguments *arguments, enum status status,
                                   const struct recording_report *report)
{
    char shown[TEXT_SHOWN_BYTES];
    if (arguments->json) {
        return print_json(arguments->path, status, report);
    } else if (status == OK) {
        printf("%s is sound: %d takes (%d interrupted), %lld frames, %.1f MB\n", text_shown(arguments->path, shown),
               report->takes, report->interrupted_takes, (long long)report->frames, (double)report->bytes / 1e6);
    } else if (report->findings) {
        printf("%s is damaged: %lld frames cannot be read, %lld lack an image, of %lld that are there; ",
               text_shown(arguments->path, shown), (long long)report->lost_frames, (long long)report->damaged_frames,
               (long long)report->frames);
        print_rest(report);
        putchar('\n');
        for (int i = 1; i < report->findings && i < RECORDING_FINDINGS_MAX; i++)
            printf("  %s\n", report->finding[i]); // the first goes to stderr
        if (report->findings > RECORDING_FINDINGS_MAX)
            printf("  and %d more\n", report->findings - RECORDING_FINDINGS_MAX);
    }
    return OK;
}

int capture_verify(int argc, char **argv)
{
    struct file_arguments a;
    command_parse_file(argc, argv,
                       "Reads every byte of a recording and says whether all of it is sound: its structure, counts, "
                       "checksums, pictures, the order of times, ranges. The file is only read.",
                       &a);
    struct recording_report report;
    enum status status = recording_verify(a.path, &report);
    struct failure found;
    failure_keep(&found, status);
    const enum status printed = print_soundness(&a, status, &report);
    status = found.status == OK ? printed : failure_restore(&found);
    return status == OK ? 0 : command_failed(argv[0]);
}

// ---------------------------------------------------------------- repair

struct repair_arguments {
    const char *file, *out;
    bool json;
};

static error_t parse_repair_option(int key, char *value, struct argp_state *state)
{
    struct repair_arguments *a = state->input;
    switch (key) {
    case COMMAND_KEY: a->out = value; return 0;
    case COMMAND_KEY + 1: a->json = true; return 0;
    case ARGP_KEY_ARG: command_take_file(state, &a->file, value); return 0;
    case ARGP_KEY_END: command_require(state, a->file, "FILE"); return 0;
    default: return ARGP_ERR_UNKNOWN;
    }
}

// walk.reenact: walk-repaired.reenact
static enum status choose_name(const char *file, char out[FILE_PATH_BYTES])
{
    const char *slash = strrchr(file, '/'), *name = slash ? slash + 1 : file, *dot = strrchr(name, '.');
    const size_t stem = dot && dot > name ? (size_t)(dot - file) : strlen(file);
    if (snprintf(out, FILE_PATH_BYTES, "%.*s-repaired%s", (int)stem, file, file + stem) >= FILE_PATH_BYTES)
        return fail(ERR_INPUT, "the path %.60s… is too long", file);
    return OK;
}

static void print_repair(const char *file, const char *out, enum status status, const struct recording_report *report)
{
    char shown[TEXT_SHOWN_BYTES];
    if (status == NOTHING) {
        printf("%s is sound: nothing to repair%s\n", text_shown(file, shown),
               report->interrupted_takes ? "; a take that was interrupted can be used as it is" : "");
        return;
    }
    printf("%s: %d takes (%d interrupted or not whole), %lld frames, %.1f MB\n", text_shown(out, shown), report->takes,
           report->interrupted_takes, (long long)report->frames, (double)report->bytes / 1e6);
    printf("lost: %lld frames, images of %lld more, %d takes, ", (long long)report->lost_frames,
           (long long)report->damaged_frames, report->lost_takes);
    print_rest(report);
    printf("; %s is as it was\n", text_shown(file, shown));
    for (int i = 0; i < report->findings && i < RECORDING_FINDINGS_MAX; i++)
        printf("  found: %s\n", report->finding[i]);
}

int capture_repair(int argc, char **argv)
{
    static const struct argp_option options[] = {
        {"out", COMMAND_KEY, "FILE", 0, "the new recording (default: FILE-repaired.reenact beside it)", 0},
        COMMAND_OPTION_JSON(COMMAND_KEY + 1),
        {0},
    };
    static const struct argp argp = {options,
                                     parse_repair_option,
                                     "FILE",
                                     "Saves what can be read of a damaged recording into a new one and says what is "
                                     "lost. FILE is only read.",
                                     0,
                                     0,
                                     0};
    struct repair_arguments a = {0};
    char name[FILE_PATH_BYTES];
    struct recording_report report = {0};
    command_parse(&argp, argc, argv, &a);
    enum status status = a.out ? OK : choose_name(a.file, name);
    const char *out = a.out ? a.out : name;
    if (status == OK && a.out)
        status = recording_check_new(out);
    if (status == OK)
        status = recording_repair(a.file, out, &report);
    if (status == OK) // the file is repaired already: a take that cannot be judged now is judged when it is asked for
        status_ignore(take_verdict_keep_missing(out));
    struct failure repaired;
    failure_keep(&repaired, status);
    if (a.json)
        status = print_json(status == OK ? out : a.file, status < 0 ? status : OK, &report);
    else if (status >= 0)
        print_repair(a.file, out, status, &report);
    if (repaired.status < 0)
        status = failure_restore(&repaired);
    return status < 0 ? command_failed(argv[0]) : 0;
}
