#include "platform/files/installed.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

// The first of the folders, seen from the program's own, that has a file of that name.
static const char *find_file(const char *const *folders, size_t count, const char *name, char out[INSTALLED_PATH_BYTES])
{
    char program[2048], path[INSTALLED_PATH_BYTES];
    const ssize_t length = readlink("/proc/self/exe", program, sizeof program - 1);
    if (length <= 0)
        return NULL;
    program[length] = 0;
    char *slash = strrchr(program, '/');
    if (slash)
        *slash = 0;
    for (size_t i = 0; i < count; i++) {
        if (snprintf(path, sizeof path, "%s/%s/%s", program, folders[i], name) >= (int)sizeof path)
            continue;
        char *real = realpath(path, NULL); // without ..
        if (!real)
            continue;
        snprintf(out, INSTALLED_PATH_BYTES, "%s", real);
        free(real);
        return out;
    }
    return NULL;
}

const char *installed_text(const char *name, char out[INSTALLED_PATH_BYTES])
{
    static const char *const folders[] = {"../share/doc/reenact/docs", "../../../docs"};
    if (!find_file(folders, COUNT_OF(folders), name, out))
        snprintf(out, INSTALLED_PATH_BYTES, "docs/%s", name);
    return out;
}

const char *installed_sample(char out[INSTALLED_PATH_BYTES])
{
    static const char *const folders[] = {"../share/reenact"}; // a build folder has it where an installation has it
    return find_file(folders, COUNT_OF(folders), "sample.reenact", out);
}

const char *installed_tool(const char *name, char out[INSTALLED_PATH_BYTES])
{
    static const char *const folders[] = {"../libexec/reenact", "../../../tools"};
    return find_file(folders, COUNT_OF(folders), name, out);
}
