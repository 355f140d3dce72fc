// reenact-capture export: writes a take's joints for other programs.
#include "app/commands/commands.h"

#include "capture/export.h"
#include "platform/file.h"

typedef enum status format_writer(const struct take *take, const char *path);
static const char *const format_names[] = {"joints-csv", "bvh"};
static format_writer *const format_writers[] = {export_joints_csv, export_bvh};

struct export_arguments {
    const char *file, *take, *out;
    bool force;
    format_writer *write;
};

static error_t parse(int key, char *value, struct argp_state *state)
{
    struct export_arguments *given = state->input;
    switch (key) {
    case COMMAND_KEY: given->take = value; return 0;
    case COMMAND_KEY + 1:
        given->write = format_writers[command_parse_choice(state, "--as", value, format_names, COUNT_OF(format_names))];
        return 0;
    case COMMAND_KEY + 2: given->out = value; return 0;
    case COMMAND_KEY + 3: given->force = true; return 0;
    case ARGP_KEY_ARG: command_take_file(state, &given->file, value); return 0;
    case ARGP_KEY_END:
        command_require(state, given->file, "FILE");
        command_require(state, given->take, "--take NAME");
        command_require(state, given->write ? given : NULL, "--as FORMAT");
        command_require(state, given->out, "--out PATH");
        return 0;
    }
    return ARGP_ERR_UNKNOWN;
}

int capture_export(int argc, char **argv)
{
    static const struct argp_option options[] = {
        {"take", COMMAND_KEY, "NAME", 0, "the take", 0},
        {"as", COMMAND_KEY + 1, "FORMAT", 0,
         "joints-csv (time, joint, position in the colour camera's axes, confidence, standard deviation per axis) or "
         "bvh",
         0},
        {"out", COMMAND_KEY + 2, "PATH", 0, "the file to write", 0},
        COMMAND_OPTION_FORCE(COMMAND_KEY + 3),
        {0},
    };
    static const struct argp argp = {options, parse, "FILE", "Writes a take's joints for other programs.", 0, 0, 0};
    struct export_arguments given = {0};
    command_parse(&argp, argc, argv, &given);
    struct recording *recording = NULL;
    struct take *take = NULL;
    enum status status = file_check_output(given.out, given.force);
    if (status == OK)
        status = recording_open(&recording, given.file);
    if (status == OK)
        status = take_open(&take, recording, given.take);
    if (status == OK)
        status = given.write(take, given.out);
    take_close(&take);
    recording_free(&recording);
    return status == OK ? 0 : command_failed(argv[0]);
}
