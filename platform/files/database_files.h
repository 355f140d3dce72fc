// A layer under SQLite (a VFS over its own for this system) through which every database is opened: FILE, FILE-journal,
// FILE-wal and FILE-shm are all that it touches. A journal may name any file of the user's to be deleted with it, and a
// journal or a log of another file destroys the one that it is put back into; SQLite asks for no proof.
//
// - Any other name is refused. Temporary files without a name are not.
// - A reader changes nothing and makes nothing. What an unfinished change has overwritten, and what a killed program
//   has left in its log, it reads from there, page by page, and SQLite sees one sound file without either. While it
//   reads, a shared flock on the log keeps writers away (database_lock_writer takes an exclusive one); between
//   transactions it looks anew. Beside a writer that is at work it reads the log as SQLite does.
// - A journal or a log is used, by writers, too, only where it is proved to be this file's (database_sides.c).
//   Otherwise SQLite's call fails, and the sentence is kept here.
//
// One for each connection, in its thread. database.c is the user.
#pragma once
#include "base/status.h"

struct database_files;

// `path` is for sentences and borrowed.
MUST_CHECK enum status database_files_open(struct database_files **out, const char *path, bool writes);
// After sqlite3_close. NULL is fine; sets *f = NULL.
void database_files_close(struct database_files **f);

const char *database_files_layer(const struct database_files *files); // its name for sqlite3_open_v2

// Why the last lock could not be had because of a file beside the database: an error with its sentence, or OK.
MUST_CHECK enum status database_files_trouble(const struct database_files *files);

// Whether another connection is writing, whose log is read.
bool database_files_are_live(const struct database_files *files);
