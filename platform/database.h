// One database in one file (SQLite). A thin wrapper: SQL goes through as it is,
// SQLite's answers become a status and a sentence that names the file.
// One handle and its statements belong to one thread at a time.
#pragma once
#include "base/status.h"

struct database;
struct statement; // one prepared SQL statement

enum database_access {
    DATABASE_READ,    // read-only; also while another connection writes
    DATABASE_SALVAGE, // read-only, and does not mind that the file is shorter than it says
    DATABASE_WRITE,   // an existing file
    DATABASE_CREATE,  // a new file; ERR_EXISTS when anything of that name is there
};

// ERR_MISSING: no such file. ERR_FORMAT: a folder, not a database. ERR_CORRUPT:
// cut or damaged. ERR_IO: no permission, or changes lie in PATH-wal and the
// folder is not writable, as it must be to read them. ERR_MEMORY.
// On error *out is NULL, and of DATABASE_CREATE no file stays.
MUST_CHECK enum status database_open(struct database **out, const char *path, enum database_access access);

// Closes; every statement must be closed before. NULL is fine; sets *db = NULL.
void database_close(struct database **db);

const char *database_path(const struct database *db);

// Runs one or more statements, answers thrown away. ERR_IO: disk full, locked by
// another program, unreadable. ERR_CORRUPT. ERR_MEMORY.
MUST_CHECK enum status database_run(struct database *db, const char *sql);

// The first column of the first row, as a number. NOTHING: no row.
MUST_CHECK enum status database_number(struct database *db, const char *sql, int64_t *out);

// Inside a BEGIN that has neither been committed nor rolled back.
bool database_in_transaction(const struct database *db);

// Makes this connection the file's only writer until it is closed, others read
// on; changes go to a write-ahead log (PATH-wal). ERR_IO: another writer is at work.
MUST_CHECK enum status database_lock_writer(struct database *db);

// The end of writing: moves the log into the file and leaves that one file
// alone. While readers have it open, the log stays beside it until the next writer.
MUST_CHECK enum status database_close_wal(struct database *db);

// Nothing lies beside the file: no log, no journal.
bool database_is_single_file(const char *path);

// Moves what the write-ahead log holds into the file itself and syncs both.
// *left is how many pages had to stay in the log (readers, a writer at work).
MUST_CHECK enum status database_checkpoint(struct database *db, int64_t *left);

// SQLite's own check of every page. ERR_CORRUPT with the first complaint.
MUST_CHECK enum status database_check(struct database *db);

// ---- statements
MUST_CHECK enum status statement_open(struct statement **out, struct database *db, const char *sql);
void statement_close(struct statement **s); // NULL is fine; sets *s = NULL
// Positions count from 1. Text and blobs are borrowed until statement_reset.
// Binding fails only for a caller's bug, and asserts.
void statement_bind_number(struct statement *s, int position, int64_t value);
void statement_bind_text(struct statement *s, int position, const char *text);
void statement_bind_blob(struct statement *s, int position, const void *bytes, size_t count); // bytes NULL: NULL
// OK: a row is there. NOTHING: done. Else an error.
MUST_CHECK enum status statement_step(struct statement *s);
void statement_reset(struct statement *s); // ready for new values; all are NULL again
// Columns count from 0. Borrowed until the next step or reset.
int64_t statement_number(struct statement *s, int column);
const char *statement_text(struct statement *s, int column); // "" for NULL or when memory ran out
// NULL for NULL and for a blob of no bytes; *count is then 0.
const uint8_t *statement_blob(struct statement *s, int column, size_t *count);
// Steps a statement without answers to its end and resets it.
MUST_CHECK enum status statement_run(struct statement *s);
