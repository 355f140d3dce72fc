// reenact-capture take expect: what counts when a take is the reference of a comparison.
#pragma once
#include "base/status.h"

#include <stdbool.h>

enum { EXPECT_OPTIONS_MAX = 32 };

struct expect_arguments {
    const char *file, *take;
    const char *tolerance[EXPECT_OPTIONS_MAX], *ignore[EXPECT_OPTIONS_MAX], *reference[EXPECT_OPTIONS_MAX];
    int tolerances, ignores, references;
    double from_s, to_s; // < 0: not given
    bool clear;          // forget what was expected before
};

// Changes what is expected as the arguments say, or nothing where they say nothing, and prints what is expected then.
// On failure the file is as it was. ERR_INPUT: a value cannot be; otherwise as recorded_expectation_write and
// movement_read.
MUST_CHECK enum status take_expect(const struct expect_arguments *arguments);
