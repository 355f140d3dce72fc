// The names of the files beside a database, and what lies there (database.h).
#include "platform/files/database.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

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

bool database_is_single_file(const char *path)
{
    static const char *const endings[] = {LOG, "-shm", JOURNAL};
    bool alone = true;
    for (size_t i = 0; i < COUNT_OF(endings) && alone; i++) {
        char *name = database_beside(path, endings[i]);
        struct stat about;
        alone = name && lstat(name, &about);
        free(name);
    }
    return alone;
}
