// Reading a ZIP archive (PKWARE's APPNOTE 6.3, with ZIP64): members that are stored or deflated, which zlib unpacks.
// Neither encrypted archives nor those in several parts. One handle, one thread. Memory: the list of members.
#pragma once
#include "base/status.h"

#include <stddef.h>
#include <stdint.h>

// The largest member that is unpacked, and the largest list of members: what they cost in memory is bounded by it,
// whatever an archive says.
enum { ZIP_MEMBER_MAX = 256 << 20 };

struct zip_file;

// `name` is for sentences and to open. ERR_MISSING, ERR_IO, ERR_MEMORY; ERR_INPUT: no archive, one that is cut short or
// whose list is damaged, in several parts, encrypted. On error *out is NULL.
MUST_CHECK enum status zip_file_open(struct zip_file **out, const char *path);
void zip_file_close(struct zip_file **zip); // NULL is fine; sets *zip = NULL

int64_t zip_file_count(const struct zip_file *zip);
// In the order of their names by bytes, the path with /. Borrowed until zip_file_close.
const char *zip_file_name(const struct zip_file *zip, int64_t member);
int64_t zip_file_find(const struct zip_file *zip, const char *name); // -1: there is none of that name

// *bytes is malloc'ed with a 0 after its `count` bytes; the caller frees it. On error *bytes is untouched. ERR_INPUT:
// damaged, cut short, larger than ZIP_MEMBER_MAX, packed by another method. ERR_IO, ERR_MEMORY.
MUST_CHECK enum status zip_file_read(struct zip_file *zip, int64_t member, uint8_t **bytes, size_t *count);
