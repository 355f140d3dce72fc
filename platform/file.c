#include "platform/file.h"

#include <errno.h>
#include <ftw.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

enum status file_read(const char *path, uint8_t **bytes, size_t *count)
{
    struct stat about;
    if (stat(path, &about))
        return fail(errno == ENOENT || errno == ENOTDIR ? ERR_MISSING : ERR_IO, "%s: %s", path, strerror(errno));
    if (!S_ISREG(about.st_mode))
        return fail(ERR_INPUT, "%s is not a file", path);
    FILE *file = fopen(path, "rb");
    if (!file)
        return fail(ERR_IO, "%s: %s", path, strerror(errno));
    size_t size = (size_t)about.st_size;
    uint8_t *buffer = malloc(size + 1);
    if (!buffer) {
        fclose(file);
        return fail(ERR_MEMORY, "no memory to read the %zu bytes of %s", size, path);
    }
    size_t got = fread(buffer, 1, size, file);
    bool failed = ferror(file);
    fclose(file);
    if (failed) {
        free(buffer);
        return fail(ERR_IO, "%s could not be read", path);
    }
    buffer[got] = 0;
    *bytes = buffer;
    *count = got;
    return OK;
}

enum status file_write(const char *path, const void *bytes, size_t count)
{
    char part[4096];
    if (snprintf(part, sizeof part, "%s.part", path) >= (int)sizeof part)
        return fail(ERR_INPUT, "the path %.60s… is too long", path);
    FILE *file = fopen(part, "wb");
    if (!file)
        return fail(ERR_IO, "%s: %s", part, strerror(errno));
    bool written = fwrite(bytes, 1, count, file) == count;
    written = fclose(file) == 0 && written;
    if (!written || rename(part, path)) {
        enum status status = fail(ERR_IO, "%s could not be written: %s", path, strerror(errno));
        unlink(part);
        return status;
    }
    return OK;
}

bool file_exists(const char *path)
{
    struct stat about;
    return stat(path, &about) == 0;
}

enum status folder_make(const char *path)
{
    char partial[4096];
    if (snprintf(partial, sizeof partial, "%s", path) >= (int)sizeof partial)
        return fail(ERR_INPUT, "the path %.60s… is too long", path);
    for (char *at = partial + 1;; at++) {
        if (*at && *at != '/')
            continue;
        char held = *at;
        *at = 0;
        struct stat about;
        if (mkdir(partial, 0777) && errno != EEXIST)
            return fail(ERR_IO, "the folder %s cannot be made: %s", partial, strerror(errno));
        if (stat(partial, &about) == 0 && !S_ISDIR(about.st_mode))
            return fail(ERR_IO, "%s is a file where a folder was wanted", partial);
        *at = held;
        if (!held)
            return OK;
    }
}

enum status folder_rename(const char *from, const char *to)
{
    return rename(from, to) ? fail(ERR_IO, "%s could not be written: %s", to, strerror(errno)) : OK;
}

static int remove_entry(const char *path, const struct stat *about, int kind, struct FTW *where)
{
    (void)about;
    (void)kind;
    (void)where;
    return remove(path);
}

void folder_remove(const char *path)
{
    enum { OPEN_FOLDERS = 8 };
    (void)nftw(path, remove_entry, OPEN_FOLDERS, FTW_DEPTH | FTW_PHYS);
}
