// Loaded before a program (LD_PRELOAD): makes one of its calls fail. FAIL_CALL=alloc, new or sqlite; FAIL_SITE=X,
// FAIL_TURN=N: the N-th call from the site of that number (tests/support/fail_sites.h); none without. FAIL_COUNT=FILE:
// where is written at the end whether a call failed, and each site's calls and blocks that were never freed. A program
// that hangs is ended by SIGALRM.
//
// alloc: malloc, calloc, realloc, aligned_alloc, strdup of the program itself and of the libraries that read files for
// it: SQLite, libpng, libjpeg-turbo, cJSON, zstd. new: the program's C++ operators, which throw std::bad_alloc. sqlite:
// opening, preparing, binding, stepping, running, checkpoints, asking for columns.
#include "tests/support/fail_sites.h"

#include <dlfcn.h>
#include <errno.h>
#include <stdatomic.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

typedef struct sqlite3 sqlite3;
typedef struct sqlite3_stmt sqlite3_stmt;

enum { HANGS_S = 120, EARLY_BYTES = 1 << 18, SQLITE_NOMEM = 7, SQLITE_IOERR = 10, SQLITE_FULL = 13 };

static const char *const libraries[] = {"libsqlite3", "libpng", "libturbojpeg", "libjpeg", "libcjson", "libzstd", NULL};

static _Atomic bool ready, failed;
static uint64_t fail_site;
static long fail_turn;
static bool fails_alloc, fails_new, fails_sqlite;
static void *(*real_malloc)(size_t), *(*real_calloc)(size_t, size_t), *(*real_realloc)(void *, size_t);
static void (*real_free)(void *);

// dlsym, and the constructors of libraries (libstdc++ takes 72 KiB), allocate before the real functions are known.
static char early[EARLY_BYTES];
static size_t early_used;

static void *early_memory(size_t size)
{
    size = (size + 15) & ~(size_t)15;
    if (early_used + size > sizeof early)
        abort();
    early_used += size;
    return early + early_used - size;
}

static void find_real(void)
{
    if (real_malloc)
        return;
    real_calloc = dlsym(RTLD_NEXT, "calloc");
    real_realloc = dlsym(RTLD_NEXT, "realloc");
    real_free = dlsym(RTLD_NEXT, "free");
    real_malloc = dlsym(RTLD_NEXT, "malloc");
}

__attribute__((constructor)) static void start(void)
{
    const char *kind = getenv("FAIL_CALL"), *site = getenv("FAIL_SITE"), *turn = getenv("FAIL_TURN");
    find_real();
    sites_start(libraries);
    fails_alloc = kind && !strcmp(kind, "alloc");
    fails_new = kind && !strcmp(kind, "new");
    fails_sqlite = kind && !strcmp(kind, "sqlite");
    fail_site = site ? strtoull(site, NULL, 16) : 0;
    fail_turn = turn ? atol(turn) : 0;
    alarm(HANGS_S);
    ready = true;
}

__attribute__((destructor)) static void end(void)
{
    const char *path = getenv("FAIL_COUNT");
    ready = false;
    if (path)
        sites_write(path, failed);
}

// How the programs end: without the destructors.
_Noreturn void _exit(int code)
{
    void (*real)(int) = NULL;
    end();
    real = dlsym(RTLD_NEXT, "_exit");
    real(code);
    abort();
}

static bool fails_now(int *site)
{
    long turn;
    *site = site_of_call(&turn);
    if (*site < 0 || site_number(*site) != fail_site || turn != fail_turn)
        return false;
    failed = true;
    return true;
}

// *site: the call site to which the block is counted; -1: to none, its caller is not among the modules looked at.
static bool allocation_fails(bool of_kind, const void *caller, int *site)
{
    *site = -1;
    if (!ready || !of_kind || !sites_hold(caller) || !fails_now(site))
        return false;
    errno = ENOMEM;
    return true;
}

static void *taken(int site, void *block)
{
    site_takes(site, block);
    return block;
}

#define CALLER __builtin_return_address(0)

void *malloc(size_t size)
{
    int site;
    if (!real_malloc)
        return early_memory(size);
    return allocation_fails(fails_alloc, CALLER, &site) ? NULL : taken(site, real_malloc(size));
}

void *calloc(size_t count, size_t size)
{
    int site;
    if (!real_malloc)
        return early_memory(count * size);
    return allocation_fails(fails_alloc, CALLER, &site) ? NULL : taken(site, real_calloc(count, size));
}

void *aligned_alloc(size_t alignment, size_t size)
{
    static void *(*real)(size_t, size_t);
    int site;
    if (!real)
        real = dlsym(RTLD_NEXT, "aligned_alloc");
    return allocation_fails(fails_alloc, CALLER, &site) ? NULL : taken(site, real(alignment, size));
}

static bool is_early(const void *memory)
{
    return (const char *)memory >= early && (const char *)memory < early + sizeof early;
}

void free(void *memory)
{
    if (is_early(memory))
        return;
    find_real();
    if (ready)
        site_gives_back(memory);
    real_free(memory);
}

void *realloc(void *memory, size_t size)
{
    int site;
    find_real();
    if (is_early(memory)) { // how large it was is not known; as much as there is
        const size_t left = (size_t)(early + sizeof early - (char *)memory);
        void *moved = malloc(size);
        return moved ? memcpy(moved, memory, size < left ? size : left) : NULL;
    }
    if (allocation_fails(fails_alloc, CALLER, &site))
        return NULL;
    if (ready)
        site_gives_back(memory);
    return taken(site, real_realloc(memory, size));
}

char *strdup(const char *text)
{
    const size_t size = strlen(text) + 1;
    int site;
    if (allocation_fails(fails_alloc, CALLER, &site))
        return NULL;
    char *copy = real_malloc ? taken(site, real_malloc(size)) : early_memory(size);
    return copy ? memcpy(copy, text, size) : NULL;
}

// ------------------------------------------------------------- C++

// Where an allocation fails, as in the standard (C++17, [new.delete.single]): the program's handler is called, if it
// has one, and then it is tried again. Without one the real operator is asked for more than can be, and throws.
static void *new_by(void *(*real)(size_t), size_t size, const void *caller)
{
    int site;
    if (allocation_fails(fails_new, caller, &site)) {
        void (*(*get_handler)(void))(void) = dlsym(RTLD_DEFAULT, "_ZSt15get_new_handlerv");
        void (*handler)(void) = get_handler ? get_handler() : NULL;
        if (handler)
            handler(); // may throw
        else
            size = PTRDIFF_MAX;
    }
    return taken(site, real(size));
}

void *_Znwm(size_t size); // operator new
void *_Znwm(size_t size)
{
    static void *(*real)(size_t);
    if (!real)
        real = dlsym(RTLD_NEXT, "_Znwm");
    return new_by(real, size, CALLER);
}

void *_Znam(size_t size); // operator new[]
void *_Znam(size_t size)
{
    static void *(*real)(size_t);
    if (!real)
        real = dlsym(RTLD_NEXT, "_Znam");
    return new_by(real, size, CALLER);
}

// ------------------------------------------------------------- SQLite

// SQLite calls itself, too; that is not counted.
static bool sqlite_call_fails(const void *caller)
{
    int site;
    return ready && fails_sqlite && sites_hold_in_program(caller) && fails_now(&site);
}

#define FAILS() sqlite_call_fails(CALLER)

#define REAL(name) ((__typeof__(&(name)))dlsym(RTLD_NEXT, #name))

int sqlite3_open_v2(const char *path, sqlite3 **out, int flags, const char *vfs);
int sqlite3_open_v2(const char *path, sqlite3 **out, int flags, const char *vfs)
{
    if (FAILS()) {
        *out = NULL;
        return SQLITE_NOMEM;
    }
    return REAL(sqlite3_open_v2)(path, out, flags, vfs);
}

int sqlite3_prepare_v3(sqlite3 *db, const char *sql, int bytes, unsigned flags, sqlite3_stmt **out, const char **tail);
int sqlite3_prepare_v3(sqlite3 *db, const char *sql, int bytes, unsigned flags, sqlite3_stmt **out, const char **tail)
{
    if (FAILS()) {
        *out = NULL;
        return SQLITE_NOMEM;
    }
    return REAL(sqlite3_prepare_v3)(db, sql, bytes, flags, out, tail);
}

int sqlite3_step(sqlite3_stmt *s);
int sqlite3_step(sqlite3_stmt *s) { return FAILS() ? SQLITE_IOERR : REAL(sqlite3_step)(s); }

int sqlite3_exec(sqlite3 *db, const char *sql, int (*row)(void *, int, char **, char **), void *context, char **error);
int sqlite3_exec(sqlite3 *db, const char *sql, int (*row)(void *, int, char **, char **), void *context, char **error)
{
    return FAILS() ? SQLITE_FULL : REAL(sqlite3_exec)(db, sql, row, context, error);
}

int sqlite3_wal_checkpoint_v2(sqlite3 *db, const char *name, int mode, int *in_log, int *moved);
int sqlite3_wal_checkpoint_v2(sqlite3 *db, const char *name, int mode, int *in_log, int *moved)
{
    return FAILS() ? SQLITE_IOERR : REAL(sqlite3_wal_checkpoint_v2)(db, name, mode, in_log, moved);
}

int sqlite3_bind_blob64(sqlite3_stmt *s, int at, const void *bytes, uint64_t count, void (*release)(void *));
int sqlite3_bind_blob64(sqlite3_stmt *s, int at, const void *bytes, uint64_t count, void (*release)(void *))
{
    return FAILS() ? SQLITE_NOMEM : REAL(sqlite3_bind_blob64)(s, at, bytes, count, release);
}

int sqlite3_bind_text(sqlite3_stmt *s, int at, const char *text, int bytes, void (*release)(void *));
int sqlite3_bind_text(sqlite3_stmt *s, int at, const char *text, int bytes, void (*release)(void *))
{
    return FAILS() ? SQLITE_NOMEM : REAL(sqlite3_bind_text)(s, at, text, bytes, release);
}

int sqlite3_bind_int64(sqlite3_stmt *s, int at, int64_t value);
int sqlite3_bind_int64(sqlite3_stmt *s, int at, int64_t value)
{
    return FAILS() ? SQLITE_NOMEM : REAL(sqlite3_bind_int64)(s, at, value);
}

int sqlite3_bind_null(sqlite3_stmt *s, int at);
int sqlite3_bind_null(sqlite3_stmt *s, int at) { return FAILS() ? SQLITE_NOMEM : REAL(sqlite3_bind_null)(s, at); }

int sqlite3_table_column_metadata(sqlite3 *db, const char *name, const char *table, const char *column,
                                  const char **type, const char **collation, int *not_null, int *key, int *counts);
int sqlite3_table_column_metadata(sqlite3 *db, const char *name, const char *table, const char *column,
                                  const char **type, const char **collation, int *not_null, int *key, int *counts)
{
    return FAILS()
               ? SQLITE_NOMEM
               : REAL(sqlite3_table_column_metadata)(db, name, table, column, type, collation, not_null, key, counts);
}
