#include "app/commands.h"

int reenact_compare(int argc, char **argv)
{
    static const struct argp argp = {NULL, NULL, "FILE --take NAME --with FILE2 --with-take NAME2",
                                     "Will say where two takes of a movement differ. Not there yet.", NULL, NULL, NULL};
    int first;
    argp_parse(&argp, argc, argv, ARGP_NO_ERRS, &first, NULL);
    (void)fail(ERR_MISSING, "comparing takes is not there yet; export both as joints-csv to compare them elsewhere");
    return command_failed(argv[0]);
}
