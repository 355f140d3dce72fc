#include "app/commands.h"

#include <stdio.h>

int capture_map(int argc, char **argv)
{
    (void)argc;
    fprintf(stderr, "%s: is not there yet\n", argv[0]);
    return 1;
}
