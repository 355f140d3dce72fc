#include "platform/files/output.h"

#include "platform/files/file.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

struct output {
    FILE *file;
    char path[FILE_PATH_BYTES], part[FILE_PATH_BYTES];
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

static enum status open_part(struct output *output)
{
    enum status status = file_begin(output->path, output->part);
    if (status != OK || (output->file = fopen(output->part, "w+b")))
        return status;
    status = fail(errno == ENOMEM ? ERR_MEMORY : ERR_IO, "%s cannot be written: %s", output->path, strerror(errno));
    unlink(output->part);
    return status;
}

static enum status open_device(struct output *output)
{
    output->device = true;
    output->file = fopen(output->path, "wb");
    return output->file ? OK : fail(ERR_IO, "%s: %s", output->path, strerror(errno));
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

FILE *output_file(const struct output *output) { return output->file; }

bool output_can_seek(const struct output *output) { return fseek(output->file, 0, SEEK_CUR) == 0; }

enum status output_close(struct output **out, enum status status)
{
    struct output *o = *out;
    if (!o)
        return status;
    *out = NULL;
    struct failure first;
    failure_keep(&first, status);
    bool written = !ferror(o->file);
    written = (o->standard ? fflush(o->file) : fclose(o->file)) == 0 && written;
    if (status == OK && !written)
        status =
            fail(ERR_IO, "%s could not be written: %s", o->standard ? "standard output" : o->path, strerror(errno));
    else if (status != OK)
        status = failure_restore(&first);
    if (!o->standard && !o->device)
        status = file_end(o->path, o->part, status);
    free(o);
    return status;
}
