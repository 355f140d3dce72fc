// reenact-capture calibrate: which of its kinds is meant.
#include "app/commands/commands.h"

#include <stdio.h>
#include <string.h>

static const struct {
    const char *option, *about;
    int (*run)(int argc, char **argv);
} kinds[] = {
    {"--board", "a board of circles to print, for --lens", capture_calibrate_board},
    {"--lens", "a camera's lens, from that board held before it", capture_calibrate_camera},
    {"--color-depth", "a sensor's colour against its depth, from discs that stand off a board",
     capture_calibrate_camera},
    {"--rolling-shutter", "how long a camera reads an image, from a swing before a tag", capture_calibrate_camera},
    {"--stereo", "two cameras that are fixed to each other", capture_calibrate_stereo},
};

int capture_calibrate(int argc, char **argv)
{
    for (int i = 1; i < argc; i++)
        for (size_t k = 0; k < COUNT_OF(kinds); k++) {
            const size_t length = strlen(kinds[k].option);
            if (!strncmp(argv[i], kinds[k].option, length) && (!argv[i][length] || argv[i][length] == '='))
                return kinds[k].run(argc, argv);
        }
    if (argc > 1 && (!strcmp(argv[1], "--version") || !strcmp(argv[1], "-V"))) {
        command_print_version(argv[0]);
        return 0;
    }
    const bool asked = argc > 1 && (!strcmp(argv[1], "--help") || !strcmp(argv[1], "-h") || !strcmp(argv[1], "-?"));
    FILE *to = asked ? stdout : stderr;
    fprintf(to, "Usage: %s KIND ...\n", argv[0]);
    for (size_t k = 0; k < COUNT_OF(kinds); k++)
        fprintf(to, "  %-18s %s\n", kinds[k].option, kinds[k].about);
    fprintf(to, "%s KIND --help says more.\n", argv[0]);
    return asked ? 0 : 2;
}
