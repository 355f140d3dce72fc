// Writes a structure's fields to memory, or reads them back: the same calls, in the same order, do either, so that both
// directions agree. Numbers are in the machine's order, which must be little-endian. Reading is safe on any bytes: what
// does not fit fails, and the caller checks ranges. Pure.
#pragma once
#include "base/status.h"

struct archive {
    bool reading, failed, out_of_memory; // failed: the bytes end early or are too many, or there was no memory
    uint8_t *bytes;                      // writing: malloc'ed, grows; reading: borrowed
    size_t count, capacity, at;
};

struct archive archive_reader(const void *bytes, size_t count);
struct archive archive_writer(void);

void archive_bytes(struct archive *archive, void *value, size_t count);
// An array of *count elements of `each` bytes, and *count itself. Reading allocates it (at least one byte; the caller
// frees it), except where it fails: *array is then NULL.
void archive_array(struct archive *archive, void **array, int *count, size_t each);

#define ARCHIVE(a, value) archive_bytes((a), &(value), sizeof(value))

// Reading: everything was read and nothing is left. Writing: nothing failed.
bool archive_is_whole(const struct archive *archive);
