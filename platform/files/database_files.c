#include "platform/files/database_files.h"

#include "platform/files/database_sides.h"

#include <sqlite3.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { COUNTER_AT = 24, COUNTER_BYTES = 16, VALID_AT = 92, VERSIONS_AT = 18, LOG_VERSION = 2, JOURNAL_VERSION = 1 };

struct database_files {
    sqlite3_vfs vfs, *system;
    char layer[40];
    struct opened *main;
    struct database_sides sides;
};

// An open file. The system's own lies in a block of its own: its size is not known when the layer is made.
struct opened {
    sqlite3_file base;
    struct database_files *files;
    sqlite3_file *system;
    int lock;
};

static struct opened *opened_of(sqlite3_file *file) { return (struct opened *)file; }
static sqlite3_file *system_of(sqlite3_file *file) { return opened_of(file)->system; }
static bool is_main(const struct opened *opened) { return opened->files->main == opened; }

static bool read_main(void *from, void *to, size_t count, int64_t at)
{
    const struct database_files *f = from;
    sqlite3_file *file = f->main->system;
    return file->pMethods->xRead(file, to, (int)count, at) == SQLITE_OK;
}

static int64_t size_of_main(const struct database_files *files)
{
    sqlite3_int64 bytes = 0;
    sqlite3_file *file = files->main->system;
    return file->pMethods->xFileSize(file, &bytes) == SQLITE_OK ? bytes : 0;
}

static bool is_being_changed(void *from)
{
    const struct database_files *f = from;
    int reserved = 0;
    sqlite3_file *file = f->main->system;
    return file->pMethods->xCheckReservedLock(file, &reserved) == SQLITE_OK && reserved;
}

// ------------------------------------------------------------- the file

static int close_file(sqlite3_file *file)
{
    struct opened *o = opened_of(file);
    const int code = o->system->pMethods->xClose(o->system);
    free(o->system);
    o->system = NULL;
    o->base.pMethods = NULL;
    if (is_main(o))
        o->files->main = NULL;
    return code;
}

static void add_generation(const struct database_files *files, uint8_t *at)
{
    const uint32_t sum = database_number_at(at) + files->sides.generation;
    for (int i = 0; i < 4; i++)
        at[i] = (uint8_t)(sum >> (24 - 8 * i));
}

// The header as SQLite must take it.
static void pass_header_on(const struct database_files *files, uint8_t *bytes, int count, int64_t at)
{
    if (at == 0 && count >= DATABASE_HEADER_BYTES && files->sides.without_log)
        for (int i = VERSIONS_AT; i < VERSIONS_AT + 2; i++)
            bytes[i] = bytes[i] == LOG_VERSION ? JOURNAL_VERSION : bytes[i];
    if (files->sides.live || files->sides.writes)
        return;
    if (at == 0 && count >= DATABASE_HEADER_BYTES) {
        add_generation(files, bytes + COUNTER_AT);
        add_generation(files, bytes + VALID_AT);
    } else if (at == COUNTER_AT && count == COUNTER_BYTES) {
        add_generation(files, bytes);
    }
}

// A reader with its lock, which sees the file with what lies beside it.
static bool reads_beside(const struct opened *opened)
{
    return is_main(opened) && !opened->files->sides.writes && !opened->files->sides.live &&
           opened->lock != SQLITE_LOCK_NONE;
}

static int read_file(sqlite3_file *file, void *to, int count, sqlite3_int64 at)
{
    const struct opened *o = opened_of(file);
    struct database_files *f = o->files;
    int code = SQLITE_OK;
    if (!is_main(o))
        return o->system->pMethods->xRead(o->system, to, count, at);
    const bool looks = reads_beside(o);
    const enum status beside = looks ? database_sides_read(&f->sides, to, (size_t)count, at) : NOTHING;
    if (beside == NOTHING)
        code = o->system->pMethods->xRead(o->system, to, count, at);
    else if (beside != OK)
        code = SQLITE_IOERR_READ;
    if (code == SQLITE_OK)
        pass_header_on(f, to, count, at);
    return code;
}

static int size_of_file(sqlite3_file *file, sqlite3_int64 *bytes)
{
    const struct opened *o = opened_of(file);
    int64_t with_pages;
    if (!reads_beside(o) || !database_sides_have_pages(&o->files->sides, &with_pages))
        return o->system->pMethods->xFileSize(o->system, bytes);
    *bytes = with_pages;
    return SQLITE_OK;
}

static bool may_change(const struct opened *opened) { return !is_main(opened) || opened->files->sides.writes; }

static int write_file(sqlite3_file *file, const void *bytes, int count, sqlite3_int64 at)
{
    struct opened *o = opened_of(file);
    if (!may_change(o))
        return SQLITE_IOERR_WRITE;
    if (is_main(o) && at == 0) {
        o->files->sides.wrote_header = true;
        o->files->sides.without_log = false;
    }
    return o->system->pMethods->xWrite(o->system, bytes, count, at);
}

static int cut_file(sqlite3_file *file, sqlite3_int64 bytes)
{
    sqlite3_file *system = system_of(file);
    return may_change(opened_of(file)) ? system->pMethods->xTruncate(system, bytes) : SQLITE_IOERR_TRUNCATE;
}

static int lock_file(sqlite3_file *file, int kind)
{
    struct opened *o = opened_of(file);
    const int before = o->lock;
    if (before == SQLITE_LOCK_NONE)
        o->files->sides.trouble = OK;
    int code = o->system->pMethods->xLock(o->system, kind);
    if (code != SQLITE_OK)
        return code;
    o->lock = kind > before ? kind : before;
    if (!is_main(o) || before != SQLITE_LOCK_NONE)
        return SQLITE_OK;
    const struct main_file main_file = {{read_main, o->files, size_of_main(o->files)}, is_being_changed};
    if (database_sides_look(&o->files->sides, &main_file))
        return SQLITE_OK;
    o->system->pMethods->xUnlock(o->system, SQLITE_LOCK_NONE);
    o->lock = SQLITE_LOCK_NONE;
    return SQLITE_IOERR_LOCK;
}

static int unlock_file(sqlite3_file *file, int kind)
{
    struct opened *o = opened_of(file);
    if (is_main(o) && kind == SQLITE_LOCK_NONE)
        database_sides_let_go(&o->files->sides);
    const int code = o->system->pMethods->xUnlock(o->system, kind);
    if (kind < o->lock)
        o->lock = kind;
    return code;
}

// Locks in the log's index: the first is that of a commit, the second that of moving the log into the file. Neither may
// be done under a reader of a log that was left, whom SQLite does not know of.
static int lock_index(sqlite3_file *file, int first, int count, int flags)
{
    enum { CHANGES_UP_TO = 1 };
    struct opened *o = opened_of(file);
    struct database_sides *sides = &o->files->sides;
    const bool changes = is_main(o) && sides->writes && first <= CHANGES_UP_TO && flags & SQLITE_SHM_EXCLUSIVE;
    const bool takes = changes && flags & SQLITE_SHM_LOCK;
    if (takes && !database_sides_claim_log(sides))
        return SQLITE_BUSY;
    const int code = o->system->pMethods->xShmLock(o->system, first, count, flags);
    if (changes && (!takes || code != SQLITE_OK))
        database_sides_give_log(sides);
    return code;
}

// A reader of a log that was left removes nothing.
static int unmap_index(sqlite3_file *file, int removes)
{
    sqlite3_file *system = system_of(file);
    return system->pMethods->xShmUnmap(system, removes && opened_of(file)->files->sides.writes);
}

// Pages are mapped only where SQLite reads the file as it is.
static int fetch_page(sqlite3_file *file, sqlite3_int64 at, int count, void **out)
{
    sqlite3_file *system = system_of(file);
    *out = NULL;
    return opened_of(file)->files->sides.writes ? system->pMethods->xFetch(system, at, count, out) : SQLITE_OK;
}

#define PASS(name, parameters, arguments)                                                                              \
    static int pass_##name parameters { return system_of(f)->pMethods->name arguments; }
PASS(xSync, (sqlite3_file * f, int flags), (system_of(f), flags))
PASS(xCheckReservedLock, (sqlite3_file * f, int *out), (system_of(f), out))
PASS(xFileControl, (sqlite3_file * f, int what, void *value), (system_of(f), what, value))
PASS(xSectorSize, (sqlite3_file * f), (system_of(f)))
PASS(xDeviceCharacteristics, (sqlite3_file * f), (system_of(f)))
PASS(xShmMap, (sqlite3_file * f, int part, int size, int grows, void volatile **to),
     (system_of(f), part, size, grows, to))
PASS(xUnfetch, (sqlite3_file * f, sqlite3_int64 at, void *page), (system_of(f), at, page))

static void pass_barrier(sqlite3_file *f) { system_of(f)->pMethods->xShmBarrier(system_of(f)); }

#define METHODS(version)                                                                                               \
    {                                                                                                                  \
        .iVersion = (version), .xClose = close_file, .xRead = read_file, .xWrite = write_file, .xTruncate = cut_file,  \
        .xSync = pass_xSync, .xFileSize = size_of_file, .xLock = lock_file, .xUnlock = unlock_file,                    \
        .xCheckReservedLock = pass_xCheckReservedLock, .xFileControl = pass_xFileControl,                              \
        .xSectorSize = pass_xSectorSize, .xDeviceCharacteristics = pass_xDeviceCharacteristics,                        \
        .xShmMap = pass_xShmMap, .xShmLock = lock_index, .xShmBarrier = pass_barrier, .xShmUnmap = unmap_index,        \
        .xFetch = fetch_page, .xUnfetch = pass_xUnfetch                                                                \
    }
static const sqlite3_io_methods methods[] = {METHODS(1), METHODS(2), METHODS(3)};

// ------------------------------------------------------------- names

static struct database_files *files_of(sqlite3_vfs *vfs) { return vfs->pAppData; }

static bool is_side(const struct database_files *files, enum side_kind kind, const char *name)
{
    return database_sides_is(&files->sides, kind, name);
}

// The flags to open it with; 0: it is refused.
static int flags_for(const struct database_files *files, const char *name, int flags)
{
    if (!name)
        return flags; // temporary
    if (flags & SQLITE_OPEN_MAIN_DB)
        return files->main ? 0 : flags;
    if (is_side(files, SIDE_JOURNAL, name))
        return files->sides.writes ? flags : 0;
    if (is_side(files, SIDE_LOG, name))
        return files->sides.writes ? flags
                                   : (flags & ~(SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE)) | SQLITE_OPEN_READONLY;
    return 0;
}

static int open_file(sqlite3_vfs *vfs, const char *name, sqlite3_file *file, int wanted, int *out_flags)
{
    struct database_files *f = files_of(vfs);
    struct opened *o = opened_of(file);
    const int flags = flags_for(f, name, wanted);
    *o = (struct opened){.files = f};
    if (!flags)
        return SQLITE_CANTOPEN;
    if (name && flags & SQLITE_OPEN_MAIN_DB && !database_sides_name(&f->sides, name))
        return SQLITE_NOMEM;
    o->system = calloc(1, (size_t)f->system->szOsFile);
    if (!o->system)
        return SQLITE_NOMEM;
    const int code = f->system->xOpen(f->system, name, o->system, flags, out_flags);
    if (!o->system->pMethods) {
        free(o->system);
        o->system = NULL;
        return code;
    }
    const int version = o->system->pMethods->iVersion;
    o->base.pMethods = &methods[version > 3 ? 2 : version - 1];
    if (name && flags & SQLITE_OPEN_MAIN_DB)
        f->main = o;
    return code;
}

static int delete_file(sqlite3_vfs *vfs, const char *name, int sync)
{
    struct database_files *f = files_of(vfs);
    const bool ours = f->sides.writes && (is_side(f, SIDE_JOURNAL, name) || is_side(f, SIDE_LOG, name));
    return ours ? f->system->xDelete(f->system, name, sync) : SQLITE_IOERR_DELETE;
}

// To a reader there is no journal, and a log only where a writer is at work on it.
static int look_for_file(sqlite3_vfs *vfs, const char *name, int flags, int *out)
{
    const struct database_files *f = files_of(vfs);
    *out = 0;
    if (!is_side(f, SIDE_JOURNAL, name) && !is_side(f, SIDE_LOG, name))
        return SQLITE_IOERR_ACCESS;
    if (!f->sides.writes && !(f->sides.live && is_side(f, SIDE_LOG, name)))
        return SQLITE_OK;
    return f->system->xAccess(f->system, name, flags, out);
}

static int resolve_path(sqlite3_vfs *vfs, const char *name, int room, char *out)
{
    sqlite3_vfs *system = files_of(vfs)->system;
    return system->xFullPathname(system, name, room, out);
}

static int random_bytes(sqlite3_vfs *vfs, int count, char *out)
{
    sqlite3_vfs *system = files_of(vfs)->system;
    return system->xRandomness(system, count, out);
}

static int wait_us(sqlite3_vfs *vfs, int us)
{
    sqlite3_vfs *system = files_of(vfs)->system;
    return system->xSleep(system, us);
}

static int day_now(sqlite3_vfs *vfs, double *days)
{
    sqlite3_vfs *system = files_of(vfs)->system;
    return system->xCurrentTime(system, days);
}

static int last_error(sqlite3_vfs *vfs, int room, char *out)
{
    sqlite3_vfs *system = files_of(vfs)->system;
    return system->xGetLastError ? system->xGetLastError(system, room, out) : 0;
}

// ------------------------------------------------------------- one connection's

enum status database_files_open(struct database_files **out, const char *path, bool writes)
{
    struct database_files *f = *out = calloc(1, sizeof *f);
    if (!f)
        return fail(ERR_MEMORY, "no memory to open %s", path);
    f->system = sqlite3_vfs_find(NULL);
    database_sides_init(&f->sides, path, writes);
    snprintf(f->layer, sizeof f->layer, "recording-%p", (void *)f);
    f->vfs = (sqlite3_vfs){.iVersion = 1,
                           .szOsFile = (int)sizeof(struct opened),
                           .mxPathname = f->system ? f->system->mxPathname : 0,
                           .zName = f->layer,
                           .pAppData = f,
                           .xOpen = open_file,
                           .xDelete = delete_file,
                           .xAccess = look_for_file,
                           .xFullPathname = resolve_path,
                           .xRandomness = random_bytes,
                           .xSleep = wait_us,
                           .xCurrentTime = day_now,
                           .xGetLastError = last_error};
    if (f->system && sqlite3_vfs_register(&f->vfs, 0) == SQLITE_OK)
        return OK;
    free(f);
    *out = NULL;
    return fail(ERR_MEMORY, "no memory to open %s", path);
}

void database_files_close(struct database_files **files)
{
    struct database_files *f = *files;
    if (!f)
        return;
    sqlite3_vfs_unregister(&f->vfs);
    database_sides_free(&f->sides);
    free(f);
    *files = NULL;
}

const char *database_files_layer(const struct database_files *files) { return files->layer; }

enum status database_files_trouble(const struct database_files *files)
{
    return files->sides.trouble == OK ? OK : fail(files->sides.trouble, "%s", files->sides.sentence);
}

bool database_files_are_live(const struct database_files *files) { return files->sides.live; }
