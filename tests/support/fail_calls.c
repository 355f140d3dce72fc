// Loaded before a program (LD_PRELOAD): makes one of its calls fail. FAIL_CALL=alloc or sqlite, FAIL_AT=N: the N-th
// call of that kind, counted from the program's start; 0: none. FAIL_COUNT=FILE: where the number of calls is written
// at the end.
//
// alloc: malloc, calloc, realloc, strdup of the program itself and of the libraries that read files for it: SQLite,
// libpng, libjpeg-turbo, cJSON, zstd. sqlite: opening, preparing, binding, stepping, running, checkpoints.
#include <dlfcn.h>
#include <errno.h>
#include <link.h>
#include <stdatomic.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

typedef struct sqlite3 sqlite3;
typedef struct sqlite3_stmt sqlite3_stmt;

enum { RANGES_MAX = 64, EARLY_BYTES = 1 << 18, SQLITE_NOMEM = 7, SQLITE_IOERR = 10, SQLITE_FULL = 13 };

static struct {
    uintptr_t begin, end;
} ranges[RANGES_MAX];
static int range_count;
static _Atomic bool ready;
static _Atomic long calls;
static long fail_at;
static bool fails_alloc, fails_sqlite;
static void *(*real_malloc)(size_t), *(*real_calloc)(size_t, size_t), *(*real_realloc)(void *, size_t);

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

static bool is_counted(const char *path)
{
    static const char *const names[] = {"libsqlite3", "libpng", "libturbojpeg", "libjpeg", "libcjson", "libzstd"};
    if (!*path)
        return true; // the program
    for (size_t i = 0; i < sizeof names / sizeof *names; i++)
        if (strstr(path, names[i]))
            return true;
    return false;
}

static int add_object(struct dl_phdr_info *info, size_t size, void *context)
{
    (void)size;
    (void)context;
    for (int i = 0; i < info->dlpi_phnum && is_counted(info->dlpi_name); i++) {
        const ElfW(Phdr) *p = &info->dlpi_phdr[i];
        if (p->p_type == PT_LOAD && (p->p_flags & PF_X) && range_count < RANGES_MAX) {
            ranges[range_count].begin = info->dlpi_addr + p->p_vaddr;
            ranges[range_count++].end = info->dlpi_addr + p->p_vaddr + p->p_memsz;
        }
    }
    return 0;
}

static void find_real(void)
{
    if (real_malloc)
        return;
    real_calloc = dlsym(RTLD_NEXT, "calloc");
    real_realloc = dlsym(RTLD_NEXT, "realloc");
    real_malloc = dlsym(RTLD_NEXT, "malloc");
}

__attribute__((constructor)) static void start(void)
{
    const char *kind = getenv("FAIL_CALL"), *at = getenv("FAIL_AT");
    find_real();
    dl_iterate_phdr(add_object, NULL);
    fails_alloc = kind && !strcmp(kind, "alloc");
    fails_sqlite = kind && !strcmp(kind, "sqlite");
    fail_at = at ? atol(at) : 0;
    ready = true;
}

__attribute__((destructor)) static void end(void)
{
    const char *path = getenv("FAIL_COUNT");
    ready = false;
    FILE *file = path ? fopen(path, "w") : NULL;
    if (file) {
        fprintf(file, "%ld\n", (long)calls);
        fclose(file);
    }
}

static bool fails_now(void) { return ++calls == fail_at; }

static bool allocation_fails(const void *caller)
{
    const uintptr_t at = (uintptr_t)caller;
    if (!ready || !fails_alloc)
        return false;
    for (int i = 0; i < range_count; i++)
        if (at >= ranges[i].begin && at < ranges[i].end) {
            if (!fails_now())
                return false;
            errno = ENOMEM;
            return true;
        }
    return false;
}

void *malloc(size_t size)
{
    if (!real_malloc)
        return early_memory(size);
    return allocation_fails(__builtin_return_address(0)) ? NULL : real_malloc(size);
}

void *calloc(size_t count, size_t size)
{
    if (!real_malloc)
        return early_memory(count * size);
    return allocation_fails(__builtin_return_address(0)) ? NULL : real_calloc(count, size);
}

static bool is_early(const void *memory)
{
    return (const char *)memory >= early && (const char *)memory < early + sizeof early;
}

void free(void *memory)
{
    static void (*real_free)(void *);
    if (is_early(memory))
        return;
    if (!real_free)
        real_free = dlsym(RTLD_NEXT, "free");
    real_free(memory);
}

void *realloc(void *memory, size_t size)
{
    find_real();
    if (is_early(memory)) { // how large it was is not known; as much as there is
        const size_t left = (size_t)(early + sizeof early - (char *)memory);
        void *moved = malloc(size);
        return moved ? memcpy(moved, memory, size < left ? size : left) : NULL;
    }
    return allocation_fails(__builtin_return_address(0)) ? NULL : real_realloc(memory, size);
}

char *strdup(const char *text)
{
    const size_t size = strlen(text) + 1;
    if (allocation_fails(__builtin_return_address(0)))
        return NULL;
    char *copy = real_malloc ? real_malloc(size) : early_memory(size);
    return copy ? memcpy(copy, text, size) : NULL;
}

// ------------------------------------------------------------- SQLite

static bool sqlite_fails(void) { return ready && fails_sqlite && fails_now(); }

#define REAL(name) ((__typeof__(&(name)))dlsym(RTLD_NEXT, #name))

int sqlite3_open_v2(const char *path, sqlite3 **out, int flags, const char *vfs);
int sqlite3_open_v2(const char *path, sqlite3 **out, int flags, const char *vfs)
{
    if (sqlite_fails()) {
        *out = NULL;
        return SQLITE_NOMEM;
    }
    return REAL(sqlite3_open_v2)(path, out, flags, vfs);
}

int sqlite3_prepare_v3(sqlite3 *db, const char *sql, int bytes, unsigned flags, sqlite3_stmt **out, const char **tail);
int sqlite3_prepare_v3(sqlite3 *db, const char *sql, int bytes, unsigned flags, sqlite3_stmt **out, const char **tail)
{
    if (sqlite_fails()) {
        *out = NULL;
        return SQLITE_NOMEM;
    }
    return REAL(sqlite3_prepare_v3)(db, sql, bytes, flags, out, tail);
}

int sqlite3_step(sqlite3_stmt *s);
int sqlite3_step(sqlite3_stmt *s) { return sqlite_fails() ? SQLITE_IOERR : REAL(sqlite3_step)(s); }

int sqlite3_exec(sqlite3 *db, const char *sql, int (*row)(void *, int, char **, char **), void *context, char **error);
int sqlite3_exec(sqlite3 *db, const char *sql, int (*row)(void *, int, char **, char **), void *context, char **error)
{
    return sqlite_fails() ? SQLITE_FULL : REAL(sqlite3_exec)(db, sql, row, context, error);
}

int sqlite3_wal_checkpoint_v2(sqlite3 *db, const char *name, int mode, int *in_log, int *moved);
int sqlite3_wal_checkpoint_v2(sqlite3 *db, const char *name, int mode, int *in_log, int *moved)
{
    return sqlite_fails() ? SQLITE_IOERR : REAL(sqlite3_wal_checkpoint_v2)(db, name, mode, in_log, moved);
}

int sqlite3_bind_blob64(sqlite3_stmt *s, int at, const void *bytes, uint64_t count, void (*release)(void *));
int sqlite3_bind_blob64(sqlite3_stmt *s, int at, const void *bytes, uint64_t count, void (*release)(void *))
{
    return sqlite_fails() ? SQLITE_NOMEM : REAL(sqlite3_bind_blob64)(s, at, bytes, count, release);
}

int sqlite3_bind_text(sqlite3_stmt *s, int at, const char *text, int bytes, void (*release)(void *));
int sqlite3_bind_text(sqlite3_stmt *s, int at, const char *text, int bytes, void (*release)(void *))
{
    return sqlite_fails() ? SQLITE_NOMEM : REAL(sqlite3_bind_text)(s, at, text, bytes, release);
}

int sqlite3_bind_int64(sqlite3_stmt *s, int at, int64_t value);
int sqlite3_bind_int64(sqlite3_stmt *s, int at, int64_t value)
{
    return sqlite_fails() ? SQLITE_NOMEM : REAL(sqlite3_bind_int64)(s, at, value);
}
