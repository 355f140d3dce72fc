// What every file of the project may rely on: how a function says how it went,
// and how the sentence for the user travels with it.
//
// A function that can fail returns an `enum status`. Zero is good, positive is
// an answer that is no failure ("nothing in sight"), negative is an error.
// Whoever finds bad input from outside (a file, a sensor, a user) returns
// fail(ERR_…, "one clear sentence"); callers pass the status up unchanged and
// the program's main prints status_message(). A caller's bug asserts instead.
//
// Units everywhere: metres, nanoseconds (int64_t), radians; degrees,
// millimetres and pixels only where a name says so.
#pragma once
#include <assert.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define MUST_CHECK      __attribute__((warn_unused_result))
#define COUNT_OF(array) (sizeof(array) / sizeof((array)[0]))

enum status {
    OK = 0,
    NOTHING = 1,      // nothing in sight, nothing found, end of the stream
    AMBIGUOUS = 2,    // an answer, but a second one fits nearly as well
    ERR_INPUT = -1,   // what came from outside is wrong: a file's content, an option, a picture
    ERR_IO = -2,      // the system refused: open, read, write, disk full
    ERR_MEMORY = -3,  // out of memory
    ERR_FORMAT = -4,  // not a file of ours, or of a newer schema
    ERR_CORRUPT = -5, // a file of ours, damaged
    ERR_EXISTS = -6,  // refuses to overwrite
    ERR_MISSING = -7, // a named thing (file, take, device) does not exist
    ERR_ORDER = -8,   // time runs backwards
    ERR_SOLVER = -9,  // a numerical solver gave up
    ERR_DEVICE = -10, // a sensor, camera or GPU failed or went away
};

// Keeps the sentence (at most 511 bytes, per thread) and returns `status`.
// The sentence says what is wrong and what to do, without a final newline.
enum status fail(enum status status, const char *format, ...) __attribute__((format(printf, 2, 3)));

// The sentence of this thread's last fail(); "" before the first. Valid until the next.
const char *status_message(void);

// "ERR_INPUT" and so on; for logs and tests.
const char *status_name(enum status status);

#ifdef __cplusplus
}
#endif
