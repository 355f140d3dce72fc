// What SQLite leaves beside a database.
#pragma once
#include "platform/files/database.h"

#include <stdlib.h>
#include <sys/stat.h>

// There is no log and no journal beside the file.
static inline bool database_is_single_file(const char *path)
{
    static const char *const endings[] = {"-wal", "-shm", "-journal"};
    bool alone = true;
    for (size_t i = 0; i < sizeof endings / sizeof *endings && alone; i++) {
        char *name = database_beside(path, endings[i]);
        struct stat about;
        alone = name && lstat(name, &about);
        free(name);
    }
    return alone;
}
