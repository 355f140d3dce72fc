#include "platform/files/database.h"

#include "platform/files/database_files.h"
#include "platform/files/database_sides.h"
#include "platform/files/file.h"

#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <sqlite3.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

// ---------------------------------------------------------------- database names

// The names of the files beside a database, and what lies there (database.h).

// SQLite's files beside the database: its write-ahead log, and the rollback journal with what a change that was not
// finished has overwritten.
static const char LOG[] = "-wal", JOURNAL[] = "-journal";

char *database_beside(const char *path, const char *ending)
{
    char *real = realpath(path, NULL);
    const char *file = real ? real : path;
    char *name = !real && errno == ENOMEM ? NULL : malloc(strlen(file) + strlen(ending) + 1);
    if (name)
        sprintf(name, "%s%s", file, ending);
    free(real);
    return name;
}

// There is none, or nothing in it.
static bool is_empty_beside(const char *path, const char *ending)
{
    char *name = database_beside(path, ending);
    if (!name)
        return false;
    struct stat about;
    bool empty = lstat(name, &about) ? errno == ENOENT : S_ISREG(about.st_mode) && about.st_size == 0;
    free(name);
    return empty;
}

enum status database_check_name(const char *path)
{
    static const char *const endings[] = {LOG, JOURNAL};
    for (size_t i = 0; i < COUNT_OF(endings); i++) {
        char *name = database_beside(path, endings[i]);
        if (!name)
            return fail(ERR_MEMORY, "no memory to make %s", path);
        enum status status = OK;
        if (!is_empty_beside(path, endings[i]))
            status = fail(ERR_EXISTS,
                          "%s holds the last part of another file that was called so: put it back beside that file, or "
                          "remove it, or choose another name",
                          name);
        free(name);
        if (status != OK)
            return status;
    }
    return OK;
}

// ---------------------------------------------------------------- database

struct database {
    sqlite3 *handle;
    struct database_files *files;
    char *path;
    bool may_write;
    int writer_lock; // descriptor of the log, locked while this is the only writer; -1: not locked
};

struct statement {
    sqlite3_stmt *handle;
    struct database *db;
    int bound; // SQLITE_OK, or why a value could not be bound since the last reset
};

static enum status fail_to_grow(const char *path)
{
    if (file_is_at_largest(path))
        return fail(
            ERR_IO,
            "%s cannot grow: its file system, as on memory cards, or a limit of this shell takes no larger file; "
            "go on in another file",
            path);
    return fail(ERR_IO, "%s cannot grow: the disk is full", path);
}

// Whether the input or output error came of a full disk. SQLite reads errno late and may find it overwritten with 0.
static bool is_out_of_room(int code, int system_errno)
{
    return (code & 0xff) == SQLITE_IOERR &&
           (system_errno == ENOSPC || system_errno == EFBIG || system_errno == EDQUOT ||
            (!system_errno && (code == SQLITE_IOERR_WRITE || code == SQLITE_IOERR_SHMSIZE)));
}

// Turns SQLite's result code into a status and a sentence for the user.
static enum status fail_sqlite(const struct database *db, int code)
{
    const char *path = db->path;
    const enum status beside = database_files_trouble(db->files);
    if (beside != OK)
        return beside;
    const char *why = db->handle ? sqlite3_errmsg(db->handle) : sqlite3_errstr(code);
    int system_errno = db->handle ? sqlite3_system_errno(db->handle) : 0;
    switch (code & 0xff) {
    case SQLITE_NOMEM: return fail(ERR_MEMORY, "no memory to work on %s", path);
    case SQLITE_NOTADB: return file_fail_not_recording(path);
    case SQLITE_CORRUPT: return fail(ERR_CORRUPT, "%s is damaged (%s); try reenact-capture repair", path, why);
    case SQLITE_FULL: return fail_to_grow(path);
    case SQLITE_BUSY:
    case SQLITE_PROTOCOL:
    case SQLITE_LOCKED:
        return fail(ERR_IO, "%s is in use by another program: close the other program, then run it again", path);
    case SQLITE_READONLY: return fail(ERR_IO, "%s or its folder cannot be written", path);
    case SQLITE_CANTOPEN:
        if (system_errno == ENAMETOOLONG)
            return fail(ERR_IO, "%s has too long a name to be changed: leave room for \"-journal\"", path);
        return fail(ERR_IO, "%s cannot be opened: %s", path,
                    system_errno ? strerror(system_errno) : "the system gives no reason");
    case SQLITE_IOERR:
        if (is_out_of_room(code, system_errno))
            return fail_to_grow(path);
        return fail(ERR_IO, "%s cannot be read or written to its end: %s (SQLite: %s)", path,
                    system_errno ? strerror(system_errno) : "the system gives no reason", why);
    case SQLITE_TOOBIG:
        return fail(ERR_CORRUPT, "%s holds or would hold a piece of more than %d MB", path, DATABASE_BLOB_MAX >> 20);
    default: return fail(ERR_CORRUPT, "%s does not hold what a recording holds (SQLite: %s)", path, why);
    }
}

// ------------------------------------------------------------- opening

// stat and access only: opening and closing the file here would drop the locks
// that other connections of this process hold on it (POSIX).
static enum status check_path(const char *path, enum database_access access_wanted)
{
    struct stat about;
    if (stat(path, &about))
        return fail(errno == ENOENT || errno == ENOTDIR ? ERR_MISSING : ERR_IO, "%s: %s", path, strerror(errno));
    if (S_ISDIR(about.st_mode))
        return fail(ERR_FORMAT, "%s is a folder, not a recording", path);
    if (!S_ISREG(about.st_mode))
        return fail(ERR_FORMAT, "%s is not a file", path);
    if (access(path, R_OK))
        return fail(ERR_IO, "%s: no permission to read it", path);
    if (access_wanted == DATABASE_WRITE && access(path, W_OK))
        return fail(ERR_IO, "%s: no permission to write to it", path);
    // SQLite names its log after the file: by the other name half of what is written would be read, and overwritten.
    if (access_wanted == DATABASE_WRITE && about.st_nlink > 1)
        return fail(ERR_IO, "%s has another name (a hard link), so it can only be read; write to a copy of it", path);
    return OK;
}

static enum status make_file(const char *path)
{
    if (file_check_name(path) != OK)
        return ERR_INPUT;
    int file = open(path, O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
    if (file < 0 && errno == EEXIST)
        return fail(ERR_EXISTS, "%s is there already; choose another name or remove it first", path);
    if (file < 0)
        return fail(ERR_IO, "%s cannot be made: %s", path, strerror(errno));
    close(file);
    return OK;
}

// Opens and reads the first page. Returns SQLite's code.
static int connect_to(struct database *db, enum database_access access_wanted)
{
    const bool reads = access_wanted == DATABASE_READ || access_wanted == DATABASE_SALVAGE;
    const int flags = SQLITE_OPEN_NOMUTEX | (reads ? SQLITE_OPEN_READONLY : SQLITE_OPEN_READWRITE);
    // SQLite may be built so that it takes a name that begins with file: for an address, which may name another layer.
    char *name = malloc(strlen(db->path) + 3);
    if (!name)
        return SQLITE_NOMEM;
    sprintf(name, "%s%s", db->path[0] == '/' ? "" : "./", db->path);
    int code = sqlite3_open_v2(name, &db->handle, flags, database_files_layer(db->files));
    free(name);
    if (code != SQLITE_OK)
        return code;
    sqlite3_extended_result_codes(db->handle, 1);
    sqlite3_busy_timeout(db->handle, 3000);
    // A file from outside may carry a malicious schema: triggers that delete what is added, views that compute without
    // end, rows that claim a gigabyte.
    sqlite3_db_config(db->handle, SQLITE_DBCONFIG_ENABLE_TRIGGER, 0, NULL);
    sqlite3_db_config(db->handle, SQLITE_DBCONFIG_ENABLE_VIEW, 0, NULL);
    sqlite3_limit(db->handle, SQLITE_LIMIT_LENGTH, DATABASE_BLOB_MAX);
    sqlite3_db_config(db->handle, SQLITE_DBCONFIG_DEFENSIVE, access_wanted != DATABASE_SALVAGE, NULL);
    sqlite3_db_config(db->handle, SQLITE_DBCONFIG_TRUSTED_SCHEMA, 0, NULL);
    if (access_wanted == DATABASE_SALVAGE) {
        code = sqlite3_exec(db->handle, "PRAGMA writable_schema = ON", NULL, NULL, NULL);
        if (code != SQLITE_OK)
            return code;
    }
    // What is deleted or replaced by anybody shows a person: its bytes are overwritten with zeros.
    code = sqlite3_exec(db->handle, "PRAGMA cell_size_check = ON; PRAGMA secure_delete = ON", NULL, NULL, NULL);
    return code == SQLITE_OK ? sqlite3_exec(db->handle, "SELECT count(*) FROM sqlite_schema", NULL, NULL, NULL) : code;
}

// A reader shares an index with the writer, which it must be able to write to.
static enum status fail_beside_writer(const struct database *db)
{
    return fail(ERR_IO,
                "%s is being written by another program, and can be read meanwhile only where its folder can be "
                "written; try again when that has ended",
                db->path);
}

// A column that is computed (GENERATED ALWAYS) can claim 120 MB and the time to fill them in each row of a file of a
// few kilobytes. No recording has one, and no damaged bit makes one.
static enum status refuse_computed_columns(struct database *db, enum database_access access_wanted)
{
    int64_t any;
    const enum status status = database_number(
        db, "SELECT 1 FROM sqlite_schema AS s, pragma_table_xinfo(s.name) AS c WHERE c.hidden > 1 LIMIT 1", &any);
    if (status == OK)
        return fail(ERR_CORRUPT, "%s is not as a recording is: it has columns that are computed", db->path);
    return status == NOTHING || (access_wanted == DATABASE_SALVAGE && status != ERR_MEMORY) ? OK : status;
}

enum status database_open(struct database **out, const char *path, enum database_access access_wanted)
{
    const bool reads = access_wanted == DATABASE_READ || access_wanted == DATABASE_SALVAGE;
    *out = NULL;
    enum status status = access_wanted == DATABASE_CREATE ? make_file(path) : check_path(path, access_wanted);
    if (status != OK)
        return status;
    struct database *db = calloc(1, sizeof *db);
    if (db) {
        db->path = strdup(path);
        db->may_write = !reads;
        db->writer_lock = -1;
    }
    if (!db || !db->path)
        status = fail(ERR_MEMORY, "no memory to open %s", path);
    else
        status = database_files_open(&db->files, db->path, !reads);
    if (status == OK) {
        const int code = connect_to(db, access_wanted);
        if (reads && database_files_are_live(db->files) &&
            ((code & 0xff) == SQLITE_CANTOPEN || (code & 0xff) == SQLITE_READONLY))
            status = fail_beside_writer(db);
        else if (code != SQLITE_OK)
            status = fail_sqlite(db, code);
        if (status == OK)
            status = refuse_computed_columns(db, access_wanted);
    }
    if (status != OK) {
        database_close(&db);
        if (access_wanted == DATABASE_CREATE)
            unlink(path);
    }
    *out = db;
    return status;
}

void database_close(struct database **db)
{
    if (!*db)
        return;
    int code = sqlite3_close((*db)->handle);
    assert(code == SQLITE_OK && "a statement is still open");
    (void)code;
    database_files_close(&(*db)->files);
    if ((*db)->writer_lock >= 0)
        close((*db)->writer_lock);
    free((*db)->path);
    free(*db);
    *db = NULL;
}

const char *database_path(const struct database *db) { return db->path; }

bool database_may_write(const struct database *db) { return db->may_write; }

enum status database_rename(struct database **db, const char *to)
{
    struct database *closing = *db;
    enum status status = OK;
    int file = open(closing->path, O_RDONLY | O_CLOEXEC);
    sqlite3_close(closing->handle);
    closing->handle = NULL;
    if (file < 0 || fsync(file))
        status = fail(ERR_IO, "%s: %s", closing->path, strerror(errno));
    if (file >= 0)
        close(file);
    if (status == OK)
        status = database_check_name(to);
    if (status == OK)
        status = file_name_new(closing->path, to);
    if (status != OK)
        unlink(closing->path);
    database_close(db);
    return status;
}

// ------------------------------------------------------------- whole statements

enum status database_run(struct database *db, const char *sql)
{
    int code = sqlite3_exec(db->handle, sql, NULL, NULL, NULL);
    return code == SQLITE_OK ? OK : fail_sqlite(db, code);
}

enum status database_number(struct database *db, const char *sql, int64_t *out)
{
    struct statement *s;
    enum status status = statement_open(&s, db, sql);
    if (status == OK)
        status = statement_step(s);
    if (status == OK)
        *out = statement_number(s, 0);
    statement_close(&s);
    return status;
}

enum status database_has_column(struct database *db, const char *table, const char *column, bool *out)
{
    const int code = sqlite3_table_column_metadata(db->handle, NULL, table, column, NULL, NULL, NULL, NULL, NULL);
    *out = code == SQLITE_OK;
    return code == SQLITE_OK || (code & 0xff) == SQLITE_ERROR ? OK : fail_sqlite(db, code);
}

bool database_in_transaction(const struct database *db) { return !sqlite3_get_autocommit(db->handle); }

// Readers of a log that was left share a lock on it while they read (database_files.h); a writer keeps it.
static enum status take_log(const struct database *db)
{
    enum { STEP_US = 10000, MAX_STEPS = 300 }; // as long as SQLite's own locks are waited for
    for (int i = 0; flock(db->writer_lock, LOCK_EX | LOCK_NB) && errno == EWOULDBLOCK; i++) {
        if (flock(db->writer_lock, LOCK_SH | LOCK_NB) && errno == EWOULDBLOCK)
            return fail(ERR_IO, "%s is being written by another program; wait until that has ended", db->path);
        flock(db->writer_lock, LOCK_UN);
        if (i == MAX_STEPS)
            return fail(ERR_IO, "%s is in use by another program; try again when that has ended", db->path);
        usleep(STEP_US);
    }
    return OK;
}

// SQLite locks the file and PATH-shm, never the log, so a lock on the log cannot collide with SQLite's. NOTHING: there
// is no log.
static enum status lock_log(struct database *db)
{
    char *name = database_beside(db->path, "-wal");
    if (!name)
        return fail(ERR_MEMORY, "no memory to open %s", db->path);
    enum status opened = OK;
    db->writer_lock = open(name, O_RDONLY | O_CLOEXEC);
    if (db->writer_lock < 0)
        opened = errno == ENOENT ? NOTHING : fail(ERR_IO, "%s cannot be opened: %s", name, strerror(errno));
    free(name);
    if (opened != OK)
        return opened;
    return take_log(db);
}

enum status database_lock_writer(struct database *db)
{
    // NORMAL: a commit does not wait for the disk, a checkpoint does. 64 MiB of
    // cache hold any batch, so that nothing is written before it is committed.
    enum status status =
        database_run(db, "PRAGMA journal_mode = WAL; PRAGMA synchronous = NORMAL; PRAGMA wal_autocheckpoint = 0;"
                         "PRAGMA cache_size = -65536; BEGIN IMMEDIATE; COMMIT");
    if (status == OK)
        status = lock_log(db);
    if (status == OK)
        status = database_begin(db);
    if (status == OK)
        status = database_run(db, "COMMIT");
    return status == NOTHING ? fail(ERR_IO, "%s: its log cannot be made", db->path) : status;
}

static enum status add_mark(struct database *db)
{
    uint8_t bits[DATABASE_MARK_DIGITS / 2];
    char sql[sizeof DATABASE_MARK_BEGIN + DATABASE_MARK_DIGITS + 2];
    size_t used = (size_t)snprintf(sql, sizeof sql, DATABASE_MARK_BEGIN);
    sqlite3_randomness((int)sizeof bits, bits);
    for (size_t i = 0; i < sizeof bits; i++)
        used += (size_t)snprintf(sql + used, sizeof sql - used, "%02x", bits[i]);
    snprintf(sql + used, sizeof sql - used, "'");
    return database_run(db, sql);
}

bool database_is_mark(const char *name, const char *sql)
{
    static const char begin[] = DATABASE_MARK_BEGIN;
    const size_t before = sizeof begin - 1;
    return !strcmp(name, "identity") && !strncmp(sql, begin, before) &&
           strspn(sql + before, "0123456789abcdef") == DATABASE_MARK_DIGITS &&
           !strcmp(sql + before + DATABASE_MARK_DIGITS, "'");
}

static enum status write_page_one(struct database *db)
{
    int64_t version = 0;
    char same[48];
    const enum status status = database_number(db, "PRAGMA user_version", &version);
    snprintf(same, sizeof same, "PRAGMA user_version = %" PRId64, version);
    return status == OK ? database_run(db, same) : status;
}

enum status database_begin(struct database *db)
{
    int64_t marks = 0;
    enum status status = database_run(db, "BEGIN IMMEDIATE");
    if (status == OK)
        status = database_number(db, "SELECT count(*) FROM sqlite_schema WHERE name = 'identity'", &marks);
    if (status != OK)
        return status;
    return marks ? write_page_one(db) : add_mark(db);
}

enum status database_check_change(struct database *db)
{
    enum status status = lock_log(db);
    if (status >= OK)
        status = database_run(db, "BEGIN IMMEDIATE");
    if (status != OK)
        return status;
    // A first change is what makes the files that SQLite needs beside this one.
    status = write_page_one(db);
    struct failure first;
    failure_keep(&first, status);
    const enum status back = database_run(db, "ROLLBACK");
    return status == OK ? back : failure_restore(&first);
}

enum status database_close_wal(struct database *db)
{
    int64_t left;
    enum status status = database_checkpoint(db, &left);
    if (status != OK)
        return status;
    sqlite3_busy_timeout(db->handle, 0);
    // FULL: the journal of this change is on the disk before its header says how much of it counts.
    int code = sqlite3_exec(db->handle, "PRAGMA synchronous = FULL; PRAGMA journal_mode = DELETE", NULL, NULL, NULL);
    return code == SQLITE_OK || (code & 0xff) == SQLITE_BUSY ? OK : fail_sqlite(db, code);
}

enum status database_checkpoint(struct database *db, int64_t *left)
{
    int in_log = 0, moved = 0;
    int code = sqlite3_wal_checkpoint_v2(db->handle, NULL, SQLITE_CHECKPOINT_PASSIVE, &in_log, &moved);
    *left = in_log > moved ? in_log - moved : 0;
    if (code == SQLITE_BUSY) // another checkpoint is running
        return OK;
    return code == SQLITE_OK ? OK : fail_sqlite(db, code);
}

enum status database_empty_log(struct database *db)
{
    int in_log = 0, moved = 0;
    const int code = sqlite3_wal_checkpoint_v2(db->handle, NULL, SQLITE_CHECKPOINT_TRUNCATE, &in_log, &moved);
    if ((code & 0xff) == SQLITE_BUSY || (code & 0xff) == SQLITE_LOCKED)
        return NOTHING;
    return code == SQLITE_OK ? OK : fail_sqlite(db, code);
}

bool database_is_full(const struct database *db)
{
    const int code = sqlite3_extended_errcode(db->handle);
    return (code & 0xff) == SQLITE_FULL || is_out_of_room(code, sqlite3_system_errno(db->handle));
}

enum status database_checkpoint_beside_writer(struct database *db, struct database *guard, int64_t *left)
{
    struct statement *reading;
    enum status status = statement_open(&reading, guard, "SELECT 1 FROM sqlite_schema");
    if (status == OK)
        status = statement_step(reading); // has the read lock until it is closed
    if (status == OK || status == NOTHING)
        status = database_checkpoint(db, left);
    statement_close(&reading);
    return status;
}

enum status database_check(struct database *db)
{
    struct statement *s;
    enum status status = statement_open(&s, db, "PRAGMA integrity_check(1)");
    if (status == OK)
        status = statement_step(s);
    if (status == OK && strcmp(statement_text(s, 0), "ok")) {
        char complaint[300];
        snprintf(complaint, sizeof complaint, "%s", statement_text(s, 0));
        for (char *c = complaint; *c; c++)
            if (*c == '\n')
                *c = ' ';
        status = fail(ERR_CORRUPT, "%s is damaged: %s", db->path, complaint);
    }
    statement_close(&s);
    return status;
}

// ------------------------------------------------------------- statements

enum status statement_open(struct statement **out, struct database *db, const char *sql)
{
    struct statement *s = calloc(1, sizeof *s);
    *out = NULL;
    if (!s)
        return fail(ERR_MEMORY, "no memory to work on %s", db->path);
    s->db = db;
    int code = sqlite3_prepare_v3(db->handle, sql, -1, SQLITE_PREPARE_PERSISTENT, &s->handle, NULL);
    if (code != SQLITE_OK) {
        free(s);
        return fail_sqlite(db, code);
    }
    *out = s;
    return OK;
}

void statement_close(struct statement **statement)
{
    if (!*statement)
        return;
    sqlite3_finalize((*statement)->handle);
    free(*statement);
    *statement = NULL;
}

// A value that could not be bound fails the next step: a row with NULL in its place would be worse than none.
static void note_bound(struct statement *statement, int code)
{
    assert(code != SQLITE_RANGE && code != SQLITE_MISUSE);
    if (statement->bound == SQLITE_OK)
        statement->bound = code;
}

void statement_bind_number(struct statement *statement, int position, int64_t value)
{
    note_bound(statement, sqlite3_bind_int64(statement->handle, position, value));
}

void statement_bind_text(struct statement *statement, int position, const char *text)
{
    note_bound(statement, sqlite3_bind_text(statement->handle, position, text, -1, SQLITE_STATIC));
}

void statement_bind_blob(struct statement *statement, int position, const void *bytes, size_t count)
{
    if (bytes)
        note_bound(statement, sqlite3_bind_blob64(statement->handle, position, bytes, count, SQLITE_STATIC));
    else
        note_bound(statement, sqlite3_bind_null(statement->handle, position));
}

enum status statement_step(struct statement *statement)
{
    int code = statement->bound == SQLITE_OK ? sqlite3_step(statement->handle) : statement->bound;
    if (code == SQLITE_ROW)
        return OK;
    return code == SQLITE_DONE ? NOTHING : fail_sqlite(statement->db, code);
}

void statement_reset(struct statement *statement)
{
    sqlite3_reset(statement->handle); // returns the last step's error again
    sqlite3_clear_bindings(statement->handle);
    statement->bound = SQLITE_OK;
}

enum status statement_check(struct statement *statement)
{
    return sqlite3_errcode(statement->db->handle) == SQLITE_NOMEM ? fail_sqlite(statement->db, SQLITE_NOMEM) : OK;
}

int64_t statement_number(struct statement *statement, int column)
{
    return sqlite3_column_int64(statement->handle, column);
}

bool statement_is_null(struct statement *statement, int column)
{
    return sqlite3_column_type(statement->handle, column) == SQLITE_NULL;
}

const char *statement_text(struct statement *statement, int column)
{
    const unsigned char *text = sqlite3_column_text(statement->handle, column);
    return text ? (const char *)text : "";
}

const uint8_t *statement_blob(struct statement *statement, int column, size_t *count)
{
    const uint8_t *bytes = sqlite3_column_blob(statement->handle, column);
    *count = bytes ? (size_t)sqlite3_column_bytes(statement->handle, column) : 0;
    return bytes;
}

enum status statement_run(struct statement *statement)
{
    enum status status;
    do
        status = statement_step(statement);
    while (status == OK);
    statement_reset(statement);
    return status == NOTHING ? OK : status;
}
