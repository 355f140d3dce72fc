// Reading and writing whole files, and making folders. Every error's sentence names the path. Any thread may call.
#pragma once
#include "base/status.h"

// ---------------------------------------------------------------- file kind

// The kind of a file by its first bytes (magic numbers), for the sentence about one that is not what was expected.

// A phrase that goes on after "it is": "a zip archive: unpack it first". NULL: nothing that is known, or it cannot be
// read. The file is opened and closed: not for one of which this process holds POSIX locks.
const char *file_kind(const char *path);

// Returns ERR_FORMAT with a sentence that says it is not a recording, and what it is instead.
enum status file_fail_not_recording(const char *path);

// The same of a file's first bytes, `total` bytes being in all of it.
const char *file_kind_of(const uint8_t *bytes, size_t count, uint64_t total);
enum { FILE_KIND_BYTES = 512 }; // as many of the first as are looked at

// ---------------------------------------------------------------- file

// *bytes is malloc'ed with a 0 after its `count` bytes; the caller frees it. On error *bytes is untouched.
// ERR_MISSING, ERR_IO, ERR_MEMORY.
MUST_CHECK enum status file_read(const char *path, uint8_t **bytes, size_t *count);

// Protects files: nothing here and in output.h replaces one for which is_protected answers true, not even with `force`.
// what: what such a file is, for sentences, with its article; stays borrowed. To be called before main.
void file_protect(bool (*is_protected)(const char *path), const char *what);

// Writes a new file beside `path`, syncs it and renames it: there is never a partial file, and an existing one is
// replaced, but never a protected one. A link at `path` is replaced, not followed. ERR_IO; ERR_INPUT: the path is too
// long; ERR_EXISTS: there is a protected file.
MUST_CHECK enum status file_write(const char *path, const void *bytes, size_t count);
// The same without waiting for the disk, for many files that can be made again.
MUST_CHECK enum status file_write_unsynced(const char *path, const void *bytes, size_t count);

// The two halves of it for long outputs: file_begin makes an empty file beside `path` and puts its name into `part`,
// file_end renames it to `path` or, where status is not OK, removes it. Returns status, or its own failure.
enum { FILE_PATH_BYTES = 4096 };
MUST_CHECK enum status file_begin(const char *path, char part[FILE_PATH_BYTES]);
MUST_CHECK enum status file_end(const char *path, const char *part, enum status status);

// Gives a file its name, synced, never in another file's place. Where the file system has no links (FAT, as on memory
// cards), looking and renaming are two steps. ERR_EXISTS: the name is taken; ERR_IO. `from` stays then.
MUST_CHECK enum status file_name_new(const char *from, const char *to);

// No file and no folder is made whose name is empty or begins with -: it was meant as an option, and a shell's * gives
// it to other programs as one. All that follows here and in output.h refuses it. ERR_INPUT.
MUST_CHECK enum status file_check_name(const char *path);

// Before long work: whether a file can be written there. ERR_EXISTS: there is a protected file, which nothing
// overwrites; or another file, and `force` is not given. ERR_MISSING, ERR_IO: its folder is missing, or cannot be
// written. Devices and pipes can be written.
MUST_CHECK enum status file_check_output(const char *path, bool force);
// Likewise whether files can be written into a folder, which need not exist. ERR_EXISTS: it is not empty, and no
// `force`.
MUST_CHECK enum status folder_check_output(const char *path, bool force);

// Both names lead to one file (links are followed).
bool file_is_same(const char *a, const char *b);

bool file_exists(const char *path); // a file or a folder

// Checks a name in line `line` of a list of the folder's files, which may come from a stranger: it leads to no file
// outside of the folder (links are not looked at) and holds nothing that a terminal would obey. ERR_INPUT names the
// line.
MUST_CHECK enum status file_check_listed(const char *folder, const char *list, int line, const char *name);

// By how many bytes the file can still grow: what an ordinary user can write to its file system, and what that takes in
// one file (FAT, as on memory cards, 4 GiB), or this process may write. -1: not known.
int64_t file_room_bytes(const char *path);
// Whether it is the size of one file that ends it, though there is room on the disk.
bool file_is_at_largest(const char *path);

// Makes the folder and its parents; OK when it exists. ERR_IO, ERR_INPUT.
MUST_CHECK enum status folder_make(const char *path);

// Renames a folder; `to` must not exist. ERR_IO.
MUST_CHECK enum status folder_rename(const char *from, const char *to);

// Removes a folder that this program made, with all that is in it; links are removed, not followed. Keeps the sentence
// of the last failure.
void folder_remove(const char *path);
