// What the fuzz targets share. Each fuzz_*.c is one target: it gives the input to one reader and checks what must hold
// of any input (no crash, no leak, an error with a sentence, bounds). Without libFuzzer it is linked with replay.c,
// which runs the corpus of tests/fuzz/corpus; tools/fuzz builds the targets with libFuzzer and runs them.
#pragma once
#include "base/status.h"

#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

// Writes the input to the file `name` in a folder of this process, in memory where possible. Valid until the next call.
const char *fuzz_file(const char *name, const uint8_t *data, size_t size);
const char *fuzz_path(const char *name); // without writing; a ring of 4
void fuzz_remove(const char *name);      // with its log

// Ends the process where `condition` does not hold: a finding.
#define FUZZ_CHECK(condition)                                                                                          \
    do {                                                                                                               \
        if (!(condition))                                                                                              \
            abort();                                                                                                   \
    } while (0)

// An error has a sentence.
static inline enum status fuzz_said(enum status status)
{
    FUZZ_CHECK(status >= 0 || *status_message());
    return status;
}
