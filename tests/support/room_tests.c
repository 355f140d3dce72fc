#include "tests/support/room_tests.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const struct room_test *find_test(const struct room_test *tests, size_t test_count, const char *path)
{
    const char *slash = strrchr(path, '/'), *name = slash ? slash + 1 : path;
    for (size_t i = 0; i < test_count; i++)
        if (!strcmp(tests[i].name, name))
            return &tests[i];
    return NULL;
}

int room_tests_run(const struct room_test *tests, size_t test_count, int count, char **arguments)
{
    const struct room_test *test = find_test(tests, test_count, arguments[0]);
    if (!test && count > 1) {
        test = find_test(tests, test_count, arguments[1]);
        count--;
        arguments++;
    }
    if (test)
        return test->plain ? test->plain() : test->with_arguments(count, arguments);
    fprintf(stderr, "which test?\n");
    for (size_t i = 0; i < test_count; i++)
        fprintf(stderr, "  %s\n", tests[i].name);
    return EXIT_FAILURE;
}
