// reenact-capture calibrate: which of its kinds is meant.
#include "app/commands/commands.h"

#include <stdio.h>
#include <string.h>

static const struct {
    const char *option, *about;
    int (*run)(int argc, char **argv);
    const struct argp *argp;
} kinds[] = {
    {"--board", "a board of circles to print, for --lens", capture_calibrate_board, &calibrate_board_argp},
    {"--lens", "a camera's lens, from that board held before it", capture_calibrate_camera, &calibrate_camera_argp},
    {"--color-depth", "a sensor's colour against its depth, from discs that stand off a board",
     capture_calibrate_camera, &calibrate_camera_argp},
    {"--rolling-shutter", "how long a camera reads an image, from a swing before a tag", capture_calibrate_camera,
     &calibrate_camera_argp},
    {"--stereo", "two cameras that are fixed to each other", capture_calibrate_stereo, &calibrate_stereo_argp},
};

static void print_kinds(FILE *to, const char *program)
{
    fprintf(to, "Usage: %s KIND ...\n", program);
    for (size_t k = 0; k < COUNT_OF(kinds); k++)
        fprintf(to, "  %-18s %s\n", kinds[k].option, kinds[k].about);
    fprintf(to, "%s KIND --help says more of one.\n", program);
}

int capture_calibrate(int argc, char **argv)
{
    bool asked = false;
    for (int i = 1; i < argc; i++) {
        for (size_t k = 0; k < COUNT_OF(kinds); k++) {
            const size_t length = strlen(kinds[k].option);
            if (!strncmp(argv[i], kinds[k].option, length) && (!argv[i][length] || argv[i][length] == '='))
                return kinds[k].run(argc, argv);
        }
        asked |= !strcmp(argv[i], "--help") || !strcmp(argv[i], "-h") || !strcmp(argv[i], "-?") ||
                 !strcmp(argv[i], "--usage");
    }
    if (argc > 1 && (!strcmp(argv[1], "--version") || !strcmp(argv[1], "-V"))) {
        command_print_version(argv[0]);
        return 0;
    }
    print_kinds(asked ? stdout : stderr, argv[0]);
    for (size_t k = 0; asked && k < COUNT_OF(kinds); k++) {
        if (k && kinds[k].argp == kinds[k - 1].argp)
            continue;
        printf("\n");
        command_print_help(kinds[k].argp, argv[0]);
    }
    return asked ? 0 : 2;
}
