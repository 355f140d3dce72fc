// Reading and writing whole files, and making folders. Every error's sentence names the path. Any thread may call.
#pragma once
#include "base/status.h"

// *bytes is malloc'ed with a 0 after its `count` bytes; the caller frees it. On error *bytes is untouched.
// ERR_MISSING, ERR_IO, ERR_MEMORY.
MUST_CHECK enum status file_read(const char *path, uint8_t **bytes, size_t *count);

// Writes path.part and renames it: there is never a partial file, and an existing one is replaced. ERR_IO; ERR_INPUT:
// the path is too long.
MUST_CHECK enum status file_write(const char *path, const void *bytes, size_t count);

bool file_exists(const char *path); // a file or a folder

// Makes the folder and its parents; OK when it exists. ERR_IO, ERR_INPUT.
MUST_CHECK enum status folder_make(const char *path);

// Renames a folder; `to` must not exist. ERR_IO.
MUST_CHECK enum status folder_rename(const char *from, const char *to);

// Removes a folder that this program made, with all that is in it; links are removed, not followed. Keeps the sentence
// of the last failure.
void folder_remove(const char *path);
