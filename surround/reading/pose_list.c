#include "surround/reading/pose_list.h"

#include "base/text.h"
#include "platform/files/file.h"
#include "platform/files/text_file.h"

#include <ctype.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

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
    struct text_file file;
    enum status status = text_file_open(&file, path);
    if (status != OK)
        return status;
    struct timed_pose *list = malloc(text_file_lines_left(&file) * sizeof *list);
    if (!list)
        status = fail(ERR_MEMORY, "out of memory");
    int n = 0;
    for (const char *line; status == OK && (line = text_file_line(&file)); n++) {
        if (parse_entry(line, n, &list[n]) != OK)
            status = fail(ERR_INPUT, "%s line %d is no pose: time (or name and number) and tx ty tz qx qy qz qw", path,
                          file.line);
        else if (n && list[n - 1].time_ns > list[n].time_ns)
            status = fail(ERR_INPUT, "%s line %d: the times do not rise; sort the lines", path, file.line);
    }
    if (status == OK && !n)
        status = fail(ERR_INPUT, "%s holds no pose", path);
    text_file_close(&file);
    if (status != OK) {
        free(list);
        return status;
    }
    *out = list;
    *count = n;
    return OK;
}

static enum status parse_file(const char *folder, const char *name, const struct text_file *list, const char *line,
                              struct timed_file *out)
{
    char *rest, file[512];
    if (!parse_time(line, &rest, &out->time_ns) || sscanf(rest, "%511s", file) != 1)
        return fail(ERR_INPUT, "%s/%s line %d is no time and file", folder, name, list->line);
    if ((size_t)snprintf(out->path, sizeof out->path, "%s/%s", folder, file) >= sizeof out->path)
        return fail(ERR_INPUT, "%s/%s line %d: the path is too long", folder, name, list->line);
    return file_check_listed(folder, name, list->line, file);
}

enum status file_list_read(const char *folder, const char *name, struct timed_file **out, int *count)
{
    char path[2048];
    snprintf(path, sizeof path, "%s/%s", folder, name);
    struct text_file file;
    enum status status = text_file_open(&file, path);
    if (status != OK)
        return status;
    struct timed_file *list = malloc(text_file_lines_left(&file) * sizeof *list);
    if (!list)
        status = fail(ERR_MEMORY, "out of memory");
    int n = 0;
    for (const char *line; status == OK && (line = text_file_line(&file)); n++) {
        status = parse_file(folder, name, &file, line, &list[n]);
        if (status == OK && n && list[n - 1].time_ns >= list[n].time_ns)
            status = fail(ERR_INPUT, "%s line %d: the times do not rise; sort the lines", path, file.line);
    }
    if (status == OK && !n)
        status = fail(ERR_INPUT, "%s names no file", path);
    text_file_close(&file);
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
