// One database in one file (SQLite). A thin wrapper: SQL is passed on unchanged,
// SQLite's result codes become a status and a sentence that names the file.
// A handle and its statements belong to one thread at a time.
#pragma once
#include "base/status.h"

// The largest text or blob that is read or written. Chosen by hand: a map of two million landmarks.
enum { DATABASE_BLOB_MAX = 120 << 20 };

struct database;
struct statement; // one prepared SQL statement

enum database_access {
    DATABASE_READ,    // read-only; also while another connection writes
    DATABASE_SALVAGE, // read-only, and accepts a file shorter than its header says
    DATABASE_WRITE,   // an existing file
    DATABASE_CREATE,  // a new file; ERR_EXISTS when the name is taken
};

// Reading changes nothing: what a program that was killed had overwritten, or left in its log, is read from
// PATH-journal or PATH-wal; only a writer puts it back into the file. No file of another name is touched
// (database_files.h). ERR_MISSING: no such file. ERR_FORMAT: a folder, not a database. ERR_CORRUPT: cut or damaged.
// ERR_IO: no permission; writing, and the file has another name (a hard link); another program writes it and its folder
// cannot be written, which reading it meanwhile needs; or PATH-wal or PATH-journal is not proved to be this file's, or
// is damaged. ERR_MEMORY. On error *out is NULL, and DATABASE_CREATE leaves no file.
MUST_CHECK enum status database_open(struct database **out, const char *path, enum database_access access);

// Closes a database of one file (no log) and gives it another name, synced, so that it appears whole or not at all.
// ERR_EXISTS (as database_check_name, too), ERR_IO: the file is removed. Sets *db = NULL in any case.
MUST_CHECK enum status database_rename(struct database **db, const char *to);

// Every statement must be closed before. NULL is fine; sets *db = NULL.
void database_close(struct database **db);

const char *database_path(const struct database *db);
bool database_may_write(const struct database *db);

// Runs one or more statements and discards their rows. ERR_IO: disk full, locked by
// another program, unreadable. ERR_CORRUPT. ERR_MEMORY.
MUST_CHECK enum status database_run(struct database *db, const char *sql);

// The first column of the first row, as a number. NOTHING: no row.
MUST_CHECK enum status database_number(struct database *db, const char *sql, int64_t *out);

// Whether the table has the column; a table that is not there has none.
MUST_CHECK enum status database_has_column(struct database *db, const char *table, const char *column, bool *out);

// After a BEGIN that has been neither committed nor rolled back.
bool database_in_transaction(const struct database *db);

// BEGIN IMMEDIATE of a change: gives the file its mark, if it has none, and writes page 1, so that every journal, and
// every log from its beginning, holds it and can be proved to be the file's (database_sides.c).
MUST_CHECK enum status database_begin(struct database *db);

// Whether that is the view that holds the mark.
bool database_is_mark(const char *name, const char *sql);

// Makes this connection the file's only writer until it is closed; others can
// still read. Changes go to a write-ahead log (PATH-wal). ERR_IO: there is another
// writer.
MUST_CHECK enum status database_lock_writer(struct database *db);

// Whether the file could be changed now, before long work: nothing is written that stays. ERR_IO: another program is
// its writer, or nothing can be made in its folder.
MUST_CHECK enum status database_check_change(struct database *db);

// After the last write: moves the log into the file and deletes the log. While
// readers have the file open, the log stays beside it until the next writer.
MUST_CHECK enum status database_close_wal(struct database *db);

// The name of the file that SQLite keeps beside the database: its own name, which links lead to, and an ending
// ("-wal"). malloc'ed; NULL: no memory.
char *database_beside(const char *path, const char *ending);

// Before a file of that name is made: ERR_EXISTS, a log or a journal of another one that was called so is left, which
// SQLite would take for the new file's. ERR_MEMORY.
MUST_CHECK enum status database_check_name(const char *path);

// Moves the write-ahead log's contents into the file and syncs both. *left: pages
// that had to stay in the log (because of readers or a concurrent writer).
MUST_CHECK enum status database_checkpoint(struct database *db, int64_t *left);

// Moves all of the log into the file, syncs it and cuts the log to nothing, so that what the file no longer holds is
// not in the log either; waits some seconds for readers. NOTHING: it could not, because another program reads the file
// (or moves its log) all the time. Errors as database_checkpoint.
MUST_CHECK enum status database_empty_log(struct database *db);

// Whether the last call failed because the disk, or the largest size of a file, left no room.
bool database_is_full(const struct database *db);

// database_checkpoint while another connection commits, with a third one, `guard`, which must belong to no other
// thread. In SQLite 3.7.0 to 3.51.2 a checkpoint that finds the whole log checkpointed, just as a commit resets the
// log, marks that commit's frames as checkpointed, and they are lost ("The WAL-Reset Bug", sqlite.org/wal.html). The
// guard holds a read lock meanwhile: either that prevents the reset, or, where the whole log is checkpointed, the
// checkpoint. Errors: as database_checkpoint, and ERR_CORRUPT, ERR_IO, ERR_MEMORY of reading.
MUST_CHECK enum status database_checkpoint_beside_writer(struct database *db, struct database *guard, int64_t *left);

// SQLite's own check of every page. ERR_CORRUPT with the first error found.
MUST_CHECK enum status database_check(struct database *db);

// ---- statements
MUST_CHECK enum status statement_open(struct statement **out, struct database *db, const char *sql);
void statement_close(struct statement **statement); // NULL is fine; sets *statement = NULL
// Positions count from 1. Text and blobs are borrowed until statement_reset.
// Binding fails only for a caller's bug, and asserts.
void statement_bind_number(struct statement *statement, int position, int64_t value);
void statement_bind_text(struct statement *statement, int position, const char *text);
void statement_bind_blob(struct statement *statement, int position, const void *bytes,
                         size_t count); // bytes NULL: NULL
// OK: a row is available. NOTHING: no more rows. Otherwise an error.
MUST_CHECK enum status statement_step(struct statement *statement);
void statement_reset(struct statement *statement); // ready for new values; all are NULL again
// Columns count from 0. Borrowed until the next step or reset.
int64_t statement_number(struct statement *statement, int column);
bool statement_is_null(struct statement *statement, int column);
const char *statement_text(struct statement *statement, int column); // "" for NULL or out of memory
// ERR_MEMORY: a column read since the last step could not be had for lack of memory, so "" or NULL is no content.
MUST_CHECK enum status statement_check(struct statement *statement);
// NULL for NULL and for a blob of no bytes; *count is then 0.
const uint8_t *statement_blob(struct statement *statement, int column, size_t *count);
// Steps a statement that returns no rows to its end and resets it.
MUST_CHECK enum status statement_run(struct statement *statement);
