#include "tests/support/power_cut.h"

#include "tests/support/random.h"

#include <pthread.h>
#include <sqlite3.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

enum { SECTOR = 512, FILES_MAX = 16, TEMPORARY = -1 };

// One change of a file since its last sync. data NULL: a truncation to `offset`.
struct change {
    struct change *before;
    int file;
    sqlite3_int64 offset, old_size;
    int count;
    uint8_t *data, *old; // old: what was there, as far as there was something
};

struct cut_file {
    sqlite3_file base;
    int slot;           // TEMPORARY: without a name, gone after a power cut
    sqlite3_file *real; // lies behind this struct
};

static struct {
    pthread_mutex_t lock;
    sqlite3_vfs vfs, *real;
    sqlite3_io_methods methods;
    struct cut_file *files[FILES_MAX];
    struct change *last;
    enum power_cut how;
    int64_t operation, operations;
    struct rng rng;
} cut = {.lock = PTHREAD_MUTEX_INITIALIZER};

static sqlite3_file *real_of(sqlite3_file *file) { return ((struct cut_file *)file)->real; }

// ------------------------------------------------------------- the cut

static sqlite3_file *open_file(int slot) { return cut.files[slot] ? cut.files[slot]->real : NULL; }

static void undo(const struct change *c)
{
    sqlite3_file *f = open_file(c->file);
    if (!f)
        return;
    if (c->old)
        f->pMethods->xWrite(f, c->old, c->count, c->offset);
    f->pMethods->xTruncate(f, c->old_size);
}

static void redo(const struct change *c, bool torn)
{
    sqlite3_file *f = open_file(c->file);
    if (!f)
        return;
    if (!c->data) {
        f->pMethods->xTruncate(f, c->offset);
        return;
    }
    for (int at = 0; at < c->count; at += SECTOR) {
        const int size = c->count - at < SECTOR ? c->count - at : SECTOR;
        if (!torn || rng_uniform(&cut.rng) < 0.5)
            f->pMethods->xWrite(f, c->data + at, size, c->offset + at);
    }
}

static _Noreturn void cut_power(void)
{
    int count = 0;
    for (struct change *c = cut.last; c; c = c->before, count++)
        undo(c); // the newest first
    struct change **order = calloc((size_t)count + 1, sizeof *order);
    int i = count;
    for (struct change *c = cut.last; c && order; c = c->before)
        order[--i] = c;
    if (order && cut.how == POWER_CUT_KEEPS_SOME)
        for (i = count - 1; i > 0; i--) {
            const int k = (int)(rng_uniform(&cut.rng) * (i + 1));
            struct change *held = order[i];
            order[i] = order[k];
            order[k] = held;
        }
    const int first = (int)(rng_uniform(&cut.rng) * (count + 1));
    for (i = 0; order && i < count; i++) {
        if (cut.how == POWER_CUT_KEEPS_FIRST && i <= first)
            redo(order[i], i == first);
        if (cut.how == POWER_CUT_KEEPS_SOME && rng_uniform(&cut.rng) < 0.5)
            redo(order[i], rng_uniform(&cut.rng) < 0.5);
    }
    _exit(POWER_CUT_EXIT);
}

static void count_operation(void)
{
    if (++cut.operations == cut.operation)
        cut_power();
}

// ------------------------------------------------------------- the layer

static void note(struct cut_file *f, const void *data, int count, sqlite3_int64 offset)
{
    if (f->slot == TEMPORARY)
        return;
    struct change *c = calloc(1, sizeof *c);
    if (!c)
        abort();
    *c = (struct change){.before = cut.last, .file = f->slot, .offset = offset, .count = count};
    f->real->pMethods->xFileSize(f->real, &c->old_size);
    if (data) {
        c->data = malloc((size_t)count);
        memcpy(c->data, data, (size_t)count);
        if (offset < c->old_size) {
            c->old = calloc(1, (size_t)count);
            f->real->pMethods->xRead(f->real, c->old, count, offset); // short at the end: zeros, cut off by undo
        }
    } else if (offset < c->old_size) { // what a truncation takes away
        c->count = (int)(c->old_size - offset);
        c->old = calloc(1, (size_t)c->count);
        f->real->pMethods->xRead(f->real, c->old, c->count, offset);
    }
    cut.last = c;
}

static void forget(int slot)
{
    for (struct change **at = &cut.last; *at;) {
        struct change *c = *at;
        if (c->file != slot) {
            at = &c->before;
            continue;
        }
        *at = c->before;
        free(c->data);
        free(c->old);
        free(c);
    }
}

static int cut_close(sqlite3_file *file)
{
    struct cut_file *f = (struct cut_file *)file;
    // Another connection may have the same file open; its unsynced writes outlive this handle as the file's.
    return f->real->pMethods->xClose(f->real);
}

static int cut_write(sqlite3_file *file, const void *data, int count, sqlite3_int64 offset)
{
    pthread_mutex_lock(&cut.lock);
    note((struct cut_file *)file, data, count, offset);
    const int code = real_of(file)->pMethods->xWrite(real_of(file), data, count, offset);
    count_operation();
    pthread_mutex_unlock(&cut.lock);
    return code;
}

static int cut_truncate(sqlite3_file *file, sqlite3_int64 size)
{
    pthread_mutex_lock(&cut.lock);
    note((struct cut_file *)file, NULL, 0, size);
    const int code = real_of(file)->pMethods->xTruncate(real_of(file), size);
    count_operation();
    pthread_mutex_unlock(&cut.lock);
    return code;
}

static int cut_sync(sqlite3_file *file, int flags)
{
    pthread_mutex_lock(&cut.lock);
    count_operation();
    const int code = real_of(file)->pMethods->xSync(real_of(file), flags);
    forget(((struct cut_file *)file)->slot);
    pthread_mutex_unlock(&cut.lock);
    return code;
}

#define PASS(name, parameters, arguments)                                                                              \
    static int cut_##name parameters { return real_of(f)->pMethods->name arguments; }
PASS(xRead, (sqlite3_file * f, void *to, int n, sqlite3_int64 at), (real_of(f), to, n, at))
PASS(xFileSize, (sqlite3_file * f, sqlite3_int64 *size), (real_of(f), size))
PASS(xLock, (sqlite3_file * f, int kind), (real_of(f), kind))
PASS(xUnlock, (sqlite3_file * f, int kind), (real_of(f), kind))
PASS(xCheckReservedLock, (sqlite3_file * f, int *out), (real_of(f), out))
PASS(xFileControl, (sqlite3_file * f, int op, void *arg), (real_of(f), op, arg))
PASS(xSectorSize, (sqlite3_file * f), (real_of(f)))
PASS(xShmMap, (sqlite3_file * f, int page, int size, int extend, void volatile **to),
     (real_of(f), page, size, extend, to))
PASS(xShmLock, (sqlite3_file * f, int offset, int n, int flags), (real_of(f), offset, n, flags))
PASS(xShmUnmap, (sqlite3_file * f, int remove_it), (real_of(f), remove_it))

static void cut_barrier(sqlite3_file *f) { real_of(f)->pMethods->xShmBarrier(real_of(f)); }

// No promises of the file system (atomic writes, safe appends): SQLite is then as careful as it can be.
static int cut_characteristics(sqlite3_file *f)
{
    (void)f;
    return 0;
}

// One slot a path: several connections on one file share its unsynced writes.
static int slot_of(const char *path)
{
    static char paths[FILES_MAX][512];
    for (int i = 0; i < FILES_MAX; i++) {
        if (!strcmp(paths[i], path))
            return i;
        if (!*paths[i]) {
            strncpy(paths[i], path, sizeof paths[i] - 1);
            return i;
        }
    }
    abort();
}

static int cut_open(sqlite3_vfs *vfs, const char *path, sqlite3_file *file, int flags, int *out_flags)
{
    struct cut_file *f = (struct cut_file *)file;
    (void)vfs;
    f->real = (sqlite3_file *)(f + 1);
    f->slot = TEMPORARY;
    const int code = cut.real->xOpen(cut.real, path, f->real, flags, out_flags);
    f->base.pMethods = f->real->pMethods ? &cut.methods : NULL;
    if (code == SQLITE_OK && path) {
        pthread_mutex_lock(&cut.lock);
        f->slot = slot_of(path);
        if (flags & (SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE)) {
            // The power cut writes through a handle of its own: this one may be closed by then.
            struct cut_file *keep = calloc(1, sizeof *keep + (size_t)cut.real->szOsFile);
            keep->real = (sqlite3_file *)(keep + 1);
            if (!cut.files[f->slot] &&
                cut.real->xOpen(cut.real, path, keep->real, flags & ~SQLITE_OPEN_EXCLUSIVE, NULL) == SQLITE_OK)
                cut.files[f->slot] = keep;
        }
        pthread_mutex_unlock(&cut.lock);
    }
    return code;
}

static int cut_delete(sqlite3_vfs *vfs, const char *path, int sync)
{
    (void)vfs;
    pthread_mutex_lock(&cut.lock);
    const int slot = slot_of(path);
    forget(slot);
    cut.files[slot] = NULL; // its handle is of the removed file; leaked: the process is short
    const int code = cut.real->xDelete(cut.real, path, sync);
    pthread_mutex_unlock(&cut.lock);
    return code;
}

void power_cut_install(enum power_cut how, int64_t operation, uint64_t seed)
{
    cut.real = sqlite3_vfs_find(NULL);
    cut.how = how;
    cut.operation = operation;
    cut.rng = (struct rng){seed};
    cut.methods = (sqlite3_io_methods){.iVersion = 2,
                                       .xClose = cut_close,
                                       .xRead = cut_xRead,
                                       .xWrite = cut_write,
                                       .xTruncate = cut_truncate,
                                       .xSync = cut_sync,
                                       .xFileSize = cut_xFileSize,
                                       .xLock = cut_xLock,
                                       .xUnlock = cut_xUnlock,
                                       .xCheckReservedLock = cut_xCheckReservedLock,
                                       .xFileControl = cut_xFileControl,
                                       .xSectorSize = cut_xSectorSize,
                                       .xDeviceCharacteristics = cut_characteristics,
                                       .xShmMap = cut_xShmMap,
                                       .xShmLock = cut_xShmLock,
                                       .xShmBarrier = cut_barrier,
                                       .xShmUnmap = cut_xShmUnmap};
    cut.vfs = *cut.real;
    cut.vfs.zName = "power-cut";
    cut.vfs.szOsFile = (int)sizeof(struct cut_file) + cut.real->szOsFile;
    cut.vfs.xOpen = cut_open;
    cut.vfs.xDelete = cut_delete;
    sqlite3_vfs_register(&cut.vfs, 1);
}

int64_t power_cut_operations(void) { return cut.operations; }
