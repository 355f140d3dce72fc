// Many test files in one program: each file's own `main` under the file's name, one of which is run.
#pragma once
#include <stddef.h>

#define COUNT_OF_TESTS(list) (sizeof(list) / sizeof((list)[0]))

struct room_test {
    const char *name; // of the file, without .c
    int (*plain)(void);
    int (*with_arguments)(int count, char **arguments); // where plain is NULL
};

// Runs the test that the program is called by, through a link, or else the one that is its first argument, with the
// arguments behind it. The exit status is the test's; without such a test it lists their names and is 1.
int room_tests_run(const struct room_test *tests, size_t test_count, int count, char **arguments);
