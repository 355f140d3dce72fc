#include "reenact/surround/reading/pose_list.h"

#include "base/text.h"
#include "platform/file.h"

#include <ctype.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

// The next line that is neither empty nor a comment, ended by 0; NULL: none. *number: of that line, from 1.
static char *next_line(char **text, int *number)
{
    while (**text) {
        char *line = *text, *end = strchr(line, '\n');
        *text = end ? end + 1 : line + strlen(line);
        if (end)
            *end = 0;
        ++*number;
        while (isspace((unsigned char)*line))
            line++;
        if (*line && *line != '#')
            return line;
    }
    return NULL;
}

static bool parse_pose(const char *text, struct pose *out)
{
    struct vec3 *t = &out->translation;
    struct quat *q = &out->rotation;
    if (sscanf(text, "%lf %lf %lf %lf %lf %lf %lf", &t->x, &t->y, &t->z, &q->x, &q->y, &q->z, &q->w) != 7 ||
        !pose_finite(*out) || fabs(t->x) > 1e7 || fabs(t->y) > 1e7 || fabs(t->z) > 1e7)
        return false;
    const double length2 = q->x * q->x + q->y * q->y + q->z * q->z + q->w * q->w;
    *out = (struct pose){quat_unit(*q), *t};
    return length2 > 0.5 && length2 < 2;
}

static bool parse_time(const char *text, char **rest, int64_t *time_ns)
{
    const double seconds = strtod(text, rest);
    if (*rest == text || !(fabs(seconds) < SECONDS_MOST))
        return false;
    *time_ns = llround(seconds * 1e9);
    return true;
}

// "NAME/NUMBER" of a view without a time; a name must not lead out of the folder.
static bool parse_name(const char *text, char **rest, char out[64])
{
    char name[32], number[24];
    int used = 0;
    if (sscanf(text, "%31s %23s %n", name, number, &used) != 2 || !used || strchr(name, '/') || strchr(number, '/') ||
        name[0] == '.' || number[0] == '.')
        return false;
    snprintf(out, 64, "%s/%s", name, number);
    *rest = (char *)(uintptr_t)text + used;
    return true;
}

static enum status parse_entry(const char *line, int index, struct timed_pose *out)
{
    char *rest;
    *out = (struct timed_pose){0};
    if (isalpha((unsigned char)*line) || *line == '_') {
        if (!parse_name(line, &rest, out->name))
            return NOTHING;
    } else {
        snprintf(out->name, sizeof out->name, "%04d", index);
        if (!parse_time(line, &rest, &out->time_ns))
            return NOTHING;
    }
    return parse_pose(rest, &out->pose) ? OK : NOTHING;
}

enum status pose_list_read(const char *path, struct timed_pose **out, int *count)
{
    uint8_t *bytes;
    size_t size;
    enum status status = file_read(path, &bytes, &size);
    if (status != OK)
        return status;
    struct timed_pose *list = malloc((size / 16 + 1) * sizeof *list); // a pose's line is longer than 16 bytes
    if (!list)
        status = fail(ERR_MEMORY, "out of memory");
    char *text = (char *)bytes, *line;
    int n = 0, number = 0;
    while (status == OK && (line = next_line(&text, &number))) {
        if (strlen(line) < 16 || parse_entry(line, n, &list[n]) != OK)
            status = fail(ERR_INPUT, "%s line %d is no pose: time (or name and number) and tx ty tz qx qy qz qw", path,
                          number);
        else if (n && list[n - 1].time_ns > list[n].time_ns)
            status = fail(ERR_INPUT, "%s line %d: the times do not rise; sort the lines", path, number);
        n++;
    }
    if (status == OK && !n)
        status = fail(ERR_INPUT, "%s holds no pose", path);
    free(bytes);
    if (status != OK) {
        free(list);
        return status;
    }
    *out = list;
    *count = n;
    return OK;
}

enum status file_list_read(const char *folder, const char *name, struct timed_file **out, int *count)
{
    char path[2048];
    snprintf(path, sizeof path, "%s/%s", folder, name);
    uint8_t *bytes;
    size_t size;
    enum status status = file_read(path, &bytes, &size);
    if (status != OK)
        return status;
    struct timed_file *list = malloc((size / 3 + 1) * sizeof *list);
    if (!list)
        status = fail(ERR_MEMORY, "out of memory");
    char *text = (char *)bytes, *line, *rest, file[512];
    int n = 0, number = 0;
    while (status == OK && (line = next_line(&text, &number))) {
        if (strlen(line) < 3 || !parse_time(line, &rest, &list[n].time_ns) || sscanf(rest, "%511s", file) != 1)
            status = fail(ERR_INPUT, "%s line %d is no time and file", path, number);
        else if (n && list[n - 1].time_ns >= list[n].time_ns)
            status = fail(ERR_INPUT, "%s line %d: the times do not rise; sort the lines", path, number);
        else if ((status = file_check_listed(folder, name, number, file)) == OK)
            snprintf(list[n].path, sizeof list[n].path, "%.500s/%s", folder, file);
        n++;
    }
    if (status == OK && !n)
        status = fail(ERR_INPUT, "%s names no file", path);
    free(bytes);
    if (status != OK) {
        free(list);
        return status;
    }
    *out = list;
    *count = n;
    return OK;
}

struct pose pose_list_at(const struct timed_pose *list, int count, int64_t time_ns)
{
    int after = 0; // how many are before the time
    for (int end = count; after < end;) {
        const int middle = after + (end - after) / 2;
        if (list[middle].time_ns < time_ns)
            after = middle + 1;
        else
            end = middle;
    }
    if (after == 0)
        return list[0].pose;
    if (after == count)
        return list[count - 1].pose;
    const struct timed_pose *a = &list[after - 1], *b = &list[after];
    const double t = (double)(time_ns - a->time_ns) / (double)(b->time_ns - a->time_ns);
    return (struct pose){quat_slerp(a->pose.rotation, b->pose.rotation, t),
                         v3_mix(a->pose.translation, b->pose.translation, t)};
}
