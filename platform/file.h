// Whole files and folders. Every error's sentence names the path.
#pragma once
#include "base/status.h"

// *bytes is malloc'ed with a 0 behind its `count` bytes; the caller frees it.
// ERR_MISSING, ERR_IO, ERR_MEMORY.
MUST_CHECK enum status file_read(const char *path, uint8_t **bytes, size_t *count);

// Writes path.part and renames it, so that the file is there whole or not at all. ERR_IO.
MUST_CHECK enum status file_write(const char *path, const void *bytes, size_t count);

bool file_exists(const char *path); // a file or a folder

// Makes the folder and those above it; fine when it is there. ERR_IO.
MUST_CHECK enum status folder_make(const char *path);
