// What a command writes: a file under a temporary name that is renamed when it is whole, or standard output for the
// path "-". Devices and pipes are written as they are. One handle, one thread.
#pragma once
#include "base/status.h"

#include <stdio.h>

// Checks, before long work begins, that `path` can be written: its folder is there, and the path names neither the file
// `input` (by whatever name or link), nor a protected file (file.h), nor, without `force`, anything else that exists.
// "-" is fine. `input` may be NULL. ERR_INPUT, ERR_EXISTS, ERR_MISSING, ERR_IO.
MUST_CHECK enum status output_check(const char *path, const char *input, bool force);

struct output;

// ERR_IO, ERR_INPUT: the path is too long; ERR_MEMORY. On failure *out is NULL.
MUST_CHECK enum status output_open(struct output **out, const char *path);
FILE *output_file(const struct output *output);    // to write to; not to be closed
bool output_can_seek(const struct output *output); // false for a pipe or terminal
// Ends writing. With OK the file gets its name, replacing another, but never a protected one (ERR_EXISTS); with any
// other `status`, or where it cannot be written, nothing of it remains. Returns the first error. NULL is fine; sets *o
// = NULL.
enum status output_close(struct output **o, enum status status);
