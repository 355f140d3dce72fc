// reenact-capture angles: the body's angles in one take.
#include "app/commands/commands.h"
#include "base/text.h"
#include "compare/angle_report.h"
#include "platform/files/file.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { KEY_TAKE = COMMAND_KEY, KEY_JSON, KEY_CSV, KEY_MOT, KEY_HTML, KEY_FORCE };
enum { FILES = 3 };

struct angles_arguments {
    const char *file, *take;
    bool json, force;
    struct {
        const char *path;
        char *(*make)(const struct angle_report *report);
    } file_of[FILES];
};

static error_t parse_option(int key, char *value, struct argp_state *state)
{
    struct angles_arguments *given = state->input;
    switch (key) {
    case KEY_TAKE: given->take = value; return 0;
    case KEY_JSON: given->json = true; return 0;
    case KEY_CSV: given->file_of[0].path = value; return 0;
    case KEY_MOT: given->file_of[1].path = value; return 0;
    case KEY_HTML: given->file_of[2].path = value; return 0;
    case KEY_FORCE: given->force = true; return 0;
    case ARGP_KEY_ARG: command_take_file(state, &given->file, value); return 0;
    case ARGP_KEY_END: command_require(state, given->file, "FILE"); return 0;
    default: return ARGP_ERR_UNKNOWN;
    }
}

// Before the work, so that it is not done in vain.
static enum status check_outputs(const struct angles_arguments *given)
{
    enum status status = OK;
    for (int i = 0; i < FILES && status == OK; i++) {
        const char *path = given->file_of[i].path;
        if (!path)
            continue;
        for (int k = 0; k < i; k++)
            if (given->file_of[k].path && !strcmp(given->file_of[k].path, path))
                return fail(ERR_INPUT, "%s is named twice", path);
        if (file_is_same(path, given->file))
            return fail(ERR_INPUT, "%s is what is measured; give the result another name", path);
        status = file_check_output(path, given->force);
    }
    return status;
}

static enum status write_report(const struct angles_arguments *given, const struct angle_report *report)
{
    enum status status = command_write_text(NULL, given->json ? angle_report_json(report) : angle_report_text(report));
    for (int i = 0; i < FILES && status == OK; i++) {
        const char *path = given->file_of[i].path;
        for (int k = 0; k < i && path; k++) // by another name, which shows once it is there
            if (given->file_of[k].path && file_is_same(given->file_of[k].path, path))
                return fail(ERR_INPUT, "%s is what was just written as %s; it was left so", path,
                            given->file_of[k].path);
        if (path)
            status = command_write_text(path, given->file_of[i].make(report));
    }
    return status;
}

static void print_notes(const char *program, const struct movement_source *source)
{
    for (int k = 0; k < source->notes.count; k++)
        fprintf(stderr, "%s: %s\n", program, source->notes.line[k]);
    if (source->frames_side_mended)
        fprintf(stderr, "%s: warning: left and right were confused in %lld frames; exchanged\n", program,
                (long long)source->frames_side_mended);
}

int capture_angles(int argc, char **argv)
{
    static const struct argp_option options[] = {
        {"take", KEY_TAKE, "NAME", 0, "the take, where the recording has several", 0},
        COMMAND_OPTION_JSON(KEY_JSON),
        {"csv", KEY_CSV, "FILE", 0, "also write every angle over time, with its standard deviation", 0},
        {"mot", KEY_MOT, "FILE", 0, "the same as a motion for OpenSim", 0},
        {"html", KEY_HTML, "FILE", 0, "also write a page to print, with each angle's course", 0},
        {"force", KEY_FORCE, NULL, 0, "write over files that exist, though never over the recording", 0},
        {0},
    };
    static const struct argp argp = {options,
                                     parse_option,
                                     "FILE",
                                     "Says how far each joint goes in a take, a recording's or a file of joints "
                                     "(joints-csv, BVH, TRC, C3D): angles in degrees, with "
                                     "what they are.",
                                     0,
                                     0,
                                     0};
    struct angles_arguments given = {
        .file_of = {{NULL, angle_report_csv}, {NULL, angle_report_mot}, {NULL, angle_report_html}}};
    struct movement movement = {0};
    struct movement_source source;
    struct angle_summary summary;
    char name[TEXT_SHOWN_BYTES];
    command_parse(&argp, argc, argv, &given);
    enum status status = check_outputs(&given);
    if (status == OK)
        status = movement_read(given.file, given.take, &movement, &source);
    if (status == OK) {
        const char *slash = strrchr(given.file, '/');
        print_notes(argv[0], &source);
        status = angle_summary_of(&movement, &summary);
        if (status == OK)
            status = write_report(&given, &(struct angle_report){&movement, &summary,
                                                                 text_shown(given.take ? given.take
                                                                            : slash    ? slash + 1
                                                                                       : given.file,
                                                                            name)});
    }
    movement_free(&movement);
    return status == OK ? 0 : command_failed(argv[0]);
}
