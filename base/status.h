// Error handling of the whole project: a status, and a sentence for the user.
//
// A function that can fail returns an `enum status`. Zero is success, positive
// is an answer that is no failure ("nothing found"), negative is an error.
// The function that meets bad input from outside (a file, a sensor, a user)
// returns fail(ERR_…, "one clear sentence"); callers pass the status up
// unchanged and the program's main prints status_message(). A caller's bug
// asserts instead. Sentences are kept per thread: any thread may call.
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
    NOTHING = 1,      // no result: nothing visible, nothing found, end of the stream
    AMBIGUOUS = 2,    // a result, but a second one fits nearly as well
    ERR_INPUT = -1,   // input from outside is invalid: a file's content, an option, an image
    ERR_IO = -2,      // the system refused: open, read, write, disk full
    ERR_MEMORY = -3,  // out of memory
    ERR_FORMAT = -4,  // not a recording, or one of a newer schema
    ERR_CORRUPT = -5, // a recording, damaged
    ERR_EXISTS = -6,  // refuses to overwrite
    ERR_MISSING = -7, // a named thing (file, take, device) does not exist
    ERR_ORDER = -8,   // times do not rise
    ERR_SOLVER = -9,  // a numerical solver did not converge
    ERR_DEVICE = -10, // a sensor, camera or GPU failed or was unplugged
};

// Keeps the sentence (at most 511 bytes, per thread) and returns `status`.
// The sentence says what is wrong and what to do, without a final newline. Bytes that a terminal would obey become '?'.
enum status fail(enum status status, const char *format, ...) __attribute__((format(printf, 2, 3)));

// The sentence of this thread's last fail(); "" before the first. Valid until the next.
const char *status_message(void);

// "ERR_INPUT" and so on; for logs and tests.
const char *status_name(enum status status);

// For a failure that costs nobody anything; the caller's comment says why.
static inline void status_ignore(enum status status) { (void)status; }

// A status with its sentence: carries an error over clean-up calls that may fail themselves, and from one thread to
// another. Zero: OK.
struct failure {
    enum status status;
    char sentence[512]; // empty where status is OK
};

// `status` with this thread's sentence.
void failure_keep(struct failure *failure, enum status status);

// The status kept; unless that is OK, the sentence becomes this thread's.
enum status failure_restore(const struct failure *failure);

#ifdef __cplusplus
}
#endif
