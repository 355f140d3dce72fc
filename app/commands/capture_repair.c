// reenact-capture repair FILE: saves what can be read of a damaged recording.
#include "app/commands/commands.h"
#include "app/commands/recording_report.h"
#include "base/text.h"
#include "capture/take_verdict.h"
#include "platform/files/file.h"

#include <stdio.h>
#include <string.h>

struct repair_arguments {
    const char *file, *out;
    bool json;
};

static error_t parse_option(int key, char *value, struct argp_state *state)
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

static void print_report(const char *file, const char *out, enum status status, const struct recording_report *report)
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
    recording_report_print_rest(report);
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
                                     parse_option,
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
        status = recording_report_print_json(status == OK ? out : a.file, status < 0 ? status : OK, &report);
    else if (status >= 0)
        print_report(a.file, out, status, &report);
    if (repaired.status < 0)
        status = failure_restore(&repaired);
    return status < 0 ? command_failed(argv[0]) : 0;
}
