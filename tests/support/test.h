// Included by every test: cmocka, and checks that print both values.
#pragma once
// cmocka.h needs what stands above it.
// clang-format off
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#undef fail // ours, in status.h, sets the message; cmocka's stays _fail()
// clang-format on

#include "base/status.h"
#include "tests/support/random.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

// Sanitizers slow films down five- to tenfold; they look at the code, not at how well it does: fewer films do for them.
#ifdef REENACT_SANITIZED
enum { SANITIZED = 1 };
#else
enum { SANITIZED = 0 };
#endif

// A check that cannot be made here, for what it needs is not installed, names that and is skipped. The program then
// ends with EXIT_SKIPPED, which CTest reports as skipped whatever else passed; with REENACT_REQUIRE_ALL in the
// environment, as in continuous integration, the check fails.
enum { EXIT_SKIPPED = 77 };
static int skipped_checks;

static inline void skip_check_without(const char *missing, const char *file, int line)
{
    print_message("%s:%d: not checked without %s\n", file, line, missing);
    if (getenv("REENACT_REQUIRE_ALL"))
        _fail(file, line);
    skipped_checks++;
    _skip(file, line);
}
#define skip_without(missing) skip_check_without(missing, __FILE__, __LINE__)
#undef skip // says nothing of what is missing, and ends with 0

static inline int test_exit_code(int failed)
{
    return failed ? EXIT_FAILURE : skipped_checks ? EXIT_SKIPPED : EXIT_SUCCESS;
}
#undef cmocka_run_group_tests
#define cmocka_run_group_tests(tests, set_up, tear_down) cmocka_run_group_tests_name(#tests, tests, set_up, tear_down)
#undef cmocka_run_group_tests_name
#define cmocka_run_group_tests_name(name, tests, set_up, tear_down)                                                    \
    test_exit_code(_cmocka_run_group_tests(name, tests, sizeof(tests) / sizeof((tests)[0]), set_up, tear_down))

#define EXPECT_NEAR(actual, wanted, within)                                                                            \
    do {                                                                                                               \
        double actual_ = (actual), wanted_ = (wanted), within_ = (within);                                             \
        if (!(fabs(actual_ - wanted_) <= within_)) {                                                                   \
            print_error("%s:%d: %s is %.12g, wanted %.12g within %g\n", __FILE__, __LINE__, #actual, actual_, wanted_, \
                        within_);                                                                                      \
            fail_test();                                                                                               \
        }                                                                                                              \
    } while (0)

#define EXPECT_AT_MOST(actual, bound)                                                                                  \
    do {                                                                                                               \
        double actual_ = (actual), bound_ = (bound);                                                                   \
        if (!(actual_ <= bound_)) {                                                                                    \
            print_error("%s:%d: %s is %.12g, wanted at most %.12g\n", __FILE__, __LINE__, #actual, actual_, bound_);   \
            fail_test();                                                                                               \
        }                                                                                                              \
    } while (0)

#define EXPECT_AT_LEAST(actual, bound)                                                                                 \
    do {                                                                                                               \
        double actual_ = (actual), bound_ = (bound);                                                                   \
        if (!(actual_ >= bound_)) {                                                                                    \
            print_error("%s:%d: %s is %.12g, wanted at least %.12g\n", __FILE__, __LINE__, #actual, actual_, bound_);  \
            fail_test();                                                                                               \
        }                                                                                                              \
    } while (0)

#define EXPECT_INT(actual, wanted)                                                                                     \
    do {                                                                                                               \
        long long actual_ = (long long)(actual), wanted_ = (long long)(wanted);                                        \
        if (actual_ != wanted_) {                                                                                      \
            print_error("%s:%d: %s is %lld, wanted %lld\n", __FILE__, __LINE__, #actual, actual_, wanted_);            \
            fail_test();                                                                                               \
        }                                                                                                              \
    } while (0)

#define EXPECT_TRUE(condition)                                                                                         \
    do {                                                                                                               \
        if (!(condition)) {                                                                                            \
            print_error("%s:%d: %s does not hold\n", __FILE__, __LINE__, #condition);                                  \
            fail_test();                                                                                               \
        }                                                                                                              \
    } while (0)

#define EXPECT_STATUS(actual, wanted)                                                                                  \
    do {                                                                                                               \
        enum status actual_ = (actual), wanted_ = (wanted);                                                            \
        if (actual_ != wanted_) {                                                                                      \
            print_error("%s:%d: %s is %s (%s), wanted %s\n", __FILE__, __LINE__, #actual, status_name(actual_),        \
                        status_message(), status_name(wanted_));                                                       \
            fail_test();                                                                                               \
        }                                                                                                              \
    } while (0)

// Checks that the message of the last failure contains `part`.
#define EXPECT_SAYS(part)                                                                                              \
    do {                                                                                                               \
        if (!strstr(status_message(), (part))) {                                                                       \
            print_error("%s:%d: '%s' does not say '%s'\n", __FILE__, __LINE__, status_message(), (part));              \
            fail_test();                                                                                               \
        }                                                                                                              \
    } while (0)

static inline void fail_test(void) { _fail(__FILE__, __LINE__); }
