// reenact-capture verify FILE: reads every byte of a recording.
#include "app/commands.h"

#include "capture/recording/recording.h"
#include "platform/json.h"

#include <stdio.h>
#include <stdlib.h>

struct arguments {
    const char *path;
    bool json;
};

static error_t parse(int key, char *argument, struct argp_state *state)
{
    struct arguments *a = state->input;
    switch (key) {
    case 'j': a->json = true; return 0;
    case ARGP_KEY_ARG:
        if (a->path)
            argp_error(state, "one FILE at a time");
        a->path = argument;
        return 0;
    case ARGP_KEY_END: command_need(state, a->path, "FILE"); return 0;
    default: return ARGP_ERR_UNKNOWN;
    }
}

static void print_json(const struct arguments *a, enum status status, const struct recording_report *r)
{
    struct json *root = json_new_object();
    json_add_string(root, "file", a->path);
    json_add_string(root, "status", status_name(status));
    if (status != OK)
        json_add_string(root, "reason", status_sentence());
    json_add_number(root, "takes", r->takes);
    json_add_number(root, "interrupted_takes", r->interrupted_takes);
    json_add_number(root, "frames", (double)r->frames);
    json_add_number(root, "damaged_frames", (double)r->damaged_frames);
    json_add_number(root, "bytes", (double)r->bytes);
    char *text = json_print(root);
    if (text)
        fputs(text, stdout);
    free(text);
    json_free(&root);
}

static void print_report(const struct arguments *a, enum status status, const struct recording_report *r)
{
    if (a->json)
        print_json(a, status, r);
    else if (status == OK)
        printf("%s is sound: %d takes (%d interrupted), %lld frames, %.1f MB\n", a->path, r->takes,
               r->interrupted_takes, (long long)r->frames, (double)r->bytes / 1e6);
    else if (r->frames)
        printf("%s: %lld of %lld frames are damaged\n", a->path, (long long)r->damaged_frames, (long long)r->frames);
}

int capture_verify(int argc, char **argv)
{
    static const struct argp_option options[] = {
        {"json", 'j', NULL, 0, "Print one JSON object", 0},
        {0},
    };
    static const struct argp argp = {.options = options,
                                     .parser = parse,
                                     .args_doc = "FILE",
                                     .doc = "Reads every byte of a recording and says whether all of it is sound."};
    struct arguments a = {0};
    if (argp_parse(&argp, argc, argv, 0, NULL, &a))
        return 2;
    struct recording_report report;
    enum status status = recording_verify(a.path, &report);
    print_report(&a, status, &report);
    return status == OK ? 0 : command_failed(argv[0]);
}
