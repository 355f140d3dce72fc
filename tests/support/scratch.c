#include "tests/support/scratch.h"

#include "platform/files/file.h"

#include <ftw.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

struct scratch scratch_make(void)
{
    struct scratch scratch;
    const char *base = getenv("TMPDIR");
    snprintf(scratch.path, sizeof scratch.path, "%.100s/reenact-test-XXXXXX", base ? base : "/tmp");
    if (!mkdtemp(scratch.path))
        abort();
    return scratch;
}

static int remove_one(const char *path, const struct stat *about, int kind, struct FTW *where)
{
    (void)about;
    (void)kind;
    (void)where;
    return remove(path);
}

void scratch_remove(struct scratch *scratch)
{
    nftw(scratch->path, remove_one, 16, FTW_DEPTH | FTW_PHYS);
    scratch->path[0] = 0;
}

const char *scratch_file(const struct scratch *scratch, const char *name)
{
    static char ring[16][512];
    static int next;
    char *text = ring[next++ % 16];
    snprintf(text, sizeof ring[0], "%s/%s", scratch->path, name);
    return text;
}

void scratch_write(const struct scratch *scratch, const char *name, const void *bytes, size_t count)
{
    char path[512];
    snprintf(path, sizeof path, "%s/%s", scratch->path, name);
    char *slash = strrchr(path, '/');
    *slash = 0;
    if (folder_make(path) != OK)
        abort();
    *slash = '/';
    unlink(path); // file_write replaces no recording
    if (file_write(path, bytes, count) != OK)
        abort();
}

void scratch_text(const struct scratch *scratch, const char *name, const char *text)
{
    scratch_write(scratch, name, text, strlen(text));
}
