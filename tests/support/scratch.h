// A test's own temporary folder, and files in it.
#pragma once
#include "base/status.h"

struct scratch {
    char path[200];
};

struct scratch scratch_make(void);
void scratch_remove(struct scratch *scratch); // with everything in it

// "scratch/name"; the text lives in a ring of 16: use it immediately or copy it.
const char *scratch_file(const struct scratch *scratch, const char *name);

void scratch_write(const struct scratch *scratch, const char *name, const void *bytes, size_t count);
void scratch_text(const struct scratch *scratch, const char *name, const char *text);
