#include "platform/output.h"

#include "platform/file.h"

#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

struct output {
    FILE *file;
    char path[PATH_MAX], part[PATH_MAX];
    bool standard; // standard output
    bool device;   // `path` is a device or a pipe, written where it is
};

static bool is_standard(const char *path) { return !strcmp(path, "-"); }

enum status output_check(const char *path, const char *input, bool force)
{
    if (is_standard(path))
        return OK;
    if (input && file_is_same(path, input))
        return fail(ERR_INPUT, "%s is the recording itself; give another name", path);
    return file_check_output(path, force);
}

// Makes PATH.part, or PATH.part1 and so on where that is another's: nothing that exists is written over.
static enum status open_part(struct output *o)
{
    enum { MOST = 100 };
    for (int i = 0; i < MOST; i++) {
        const int length = i ? snprintf(o->part, sizeof o->part, "%s.part%d", o->path, i)
                             : snprintf(o->part, sizeof o->part, "%s.part", o->path);
        if (length >= (int)sizeof o->part)
            return fail(ERR_INPUT, "the path %.60s… is too long", o->path);
        const int file = open(o->part, O_RDWR | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
        if (file < 0 && errno == EEXIST)
            continue;
        if (file < 0)
            return fail(ERR_IO, "%s: %s", o->part, strerror(errno));
        if ((o->file = fdopen(file, "w+b")))
            return OK;
        close(file);
        unlink(o->part);
        return fail(ERR_MEMORY, "no memory to write %s", o->path);
    }
    return fail(ERR_EXISTS, "%s.part and others are there; remove what an earlier run left", o->path);
}

static enum status open_device(struct output *o)
{
    o->device = true;
    o->file = fopen(o->path, "wb");
    return o->file ? OK : fail(ERR_IO, "%s: %s", o->path, strerror(errno));
}

enum status output_open(struct output **out, const char *path)
{
    struct output *o = *out = calloc(1, sizeof *o);
    if (!o)
        return fail(ERR_MEMORY, "no memory to write %s", path);
    o->standard = is_standard(path);
    struct stat about;
    enum status status = OK;
    if (o->standard)
        o->file = stdout;
    else if (snprintf(o->path, sizeof o->path, "%s", path) >= (int)sizeof o->path)
        status = fail(ERR_INPUT, "the path %.60s… is too long", path);
    else if (stat(path, &about) == 0 && !S_ISREG(about.st_mode) && !S_ISDIR(about.st_mode))
        status = open_device(o);
    else
        status = open_part(o);
    if (status != OK) {
        free(o);
        *out = NULL;
    }
    return status;
}

FILE *output_file(const struct output *o) { return o->file; }

bool output_can_seek(const struct output *o) { return fseek(o->file, 0, SEEK_CUR) == 0; }

enum status output_close(struct output **out, enum status status)
{
    struct output *o = *out;
    if (!o)
        return status;
    *out = NULL;
    struct failure first;
    failure_keep(&first, status);
    bool written = !ferror(o->file);
    const bool renamed = !o->standard && !o->device;
    if (renamed && written && status == OK)
        written = fflush(o->file) == 0 && fsync(fileno(o->file)) == 0; // before it takes another file's place
    written = (o->standard ? fflush(o->file) : fclose(o->file)) == 0 && written;
    const char *name = o->standard ? "standard output" : o->path;
    if (status == OK && (!written || (renamed && rename(o->part, o->path))))
        status = fail(ERR_IO, "%s could not be written: %s", name, strerror(errno));
    else if (status != OK)
        status = failure_restore(&first);
    if (status != OK && renamed)
        unlink(o->part);
    free(o);
    return status;
}
