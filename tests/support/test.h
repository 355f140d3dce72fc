// Included by every test: cmocka, and checks that print both values.
#pragma once
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#undef fail // ours, in status.h, sets the message; cmocka's stays _fail()

#include "base/status.h"
#include "tests/support/random.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

// Sanitizers slow films down five- to tenfold; they look at the code, not at how well it does: fewer films do for them.
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
enum { SANITIZED = 1 };
#else
enum { SANITIZED = 0 };
#endif

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
