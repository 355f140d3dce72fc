// reenact compare: its place in the house; the comparing itself is still to come.
#include "app/commands.h"

static error_t parse(int key, char *value, struct argp_state *state)
{
    (void)value;
    (void)state;
    return key >= COMMAND_KEY && key <= COMMAND_KEY + 3 ? 0 : key == ARGP_KEY_ARG ? 0 : ARGP_ERR_UNKNOWN;
}

int reenact_compare(int argc, char **argv)
{
    static const struct argp_option options[] = {
        {"take", COMMAND_KEY, "NAME", 0, "the take in FILE", 0},
        {"with", COMMAND_KEY + 1, "FILE2", 0, "the recording to compare with", 0},
        {"with-take", COMMAND_KEY + 2, "NAME2", 0, "the take in FILE2", 0},
        {"json", COMMAND_KEY + 3, NULL, 0, "report as JSON", 0},
        {0},
    };
    static const struct argp argp = {
        options, parse, "FILE", "Will say where two takes of a movement differ. Not there yet.", NULL, NULL, NULL};
    argp_parse(&argp, argc, argv, 0, NULL, NULL);
    (void)fail(ERR_MISSING, "comparing takes is not there yet; export both as joints-csv to compare them elsewhere");
    return command_failed(argv[0]);
}
