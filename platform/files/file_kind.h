// What a file is that is not what it was taken for, by its first bytes, to say so to whoever chose it.
#pragma once
#include "base/status.h"

// A phrase that goes on after "it is": "a zip archive: unpack it first". NULL: nothing that is known, or it cannot be
// read. The file is opened and closed: not for one of which this process holds POSIX locks.
const char *file_kind(const char *path);

// Returns ERR_FORMAT with a sentence that says it is not a recording, and what it is instead.
enum status file_fail_not_recording(const char *path);

// The same of a file's first bytes, `total` bytes being in all of it.
const char *file_kind_of(const uint8_t *bytes, size_t count, uint64_t total);
enum { FILE_KIND_BYTES = 512 }; // as many of the first as are looked at
