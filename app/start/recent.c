#include "app/start/recent.h"

#include "platform/files/file.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { LINE_BYTES = RECENT_PATH_BYTES + 32, FILE_BYTES = RECENT_MAX * LINE_BYTES };

bool recent_file_path(char *out, size_t capacity)
{
    const char *state = getenv("XDG_STATE_HOME"), *home = getenv("HOME");
    int length = 0;
    if (state && *state == '/') // relative ones are to be ignored, by the XDG base directory specification
        length = snprintf(out, capacity, "%s/reenact/recent", state);
    else if (home && *home == '/')
        length = snprintf(out, capacity, "%s/.local/state/reenact/recent", home);
    return length > 0 && (size_t)length < capacity;
}

static bool contains(const struct recent_list *list, const char *path)
{
    for (int i = 0; i < list->count; i++)
        if (!strcmp(list->at[i].path, path))
            return true;
    return false;
}

static void read_line(const char *line, size_t length, struct recent_list *list)
{
    char *end;
    const int64_t opened_s = strtoll(line, &end, 10);
    const size_t used = (size_t)(end - line), bytes = length - used - 1;
    if (list->count >= RECENT_MAX || end == line || used + 1 >= length || *end != ' ' || end[1] != '/' ||
        bytes >= RECENT_PATH_BYTES)
        return;
    struct recent *entry = &list->at[list->count];
    entry->opened_s = opened_s;
    memcpy(entry->path, end + 1, bytes);
    entry->path[bytes] = 0;
    if (!contains(list, entry->path))
        list->count++;
}

void recent_read(const char *file, struct recent_list *out)
{
    uint8_t *bytes = NULL;
    size_t count = 0;
    out->count = 0;
    if (!file_exists(file) || file_read(file, &bytes, &count) != OK)
        return;
    for (const char *line = (const char *)bytes; count <= FILE_BYTES && *line;) {
        const size_t length = strcspn(line, "\n");
        read_line(line, length, out);
        line += length + (line[length] == '\n');
    }
    free(bytes);
}

static enum status write_list(const char *file, const struct recent_list *list)
{
    char folder[RECENT_PATH_BYTES], *text = malloc(FILE_BYTES);
    size_t used = 0;
    if (!text)
        return fail(ERR_MEMORY, "no memory to note what was opened");
    for (int i = 0; i < list->count; i++)
        used += (size_t)snprintf(text + used, FILE_BYTES - used, "%lld %s\n", (long long)list->at[i].opened_s,
                                 list->at[i].path);
    snprintf(folder, sizeof folder, "%s", file);
    char *slash = strrchr(folder, '/');
    if (slash)
        *slash = 0;
    enum status status = folder_make(folder);
    if (status == OK)
        status = file_write(file, text, used);
    free(text);
    return status;
}

static void drop(struct recent_list *list, const char *path)
{
    int kept = 0;
    for (int i = 0; i < list->count; i++)
        if (strcmp(list->at[i].path, path) != 0)
            list->at[kept++] = list->at[i];
    list->count = kept;
}

enum status recent_add(const char *file, const char *recording, int64_t now_s)
{
    char *path = realpath(recording, NULL);
    struct recent_list *list = malloc(sizeof *list);
    enum status status = OK;
    if (!list)
        status = fail(ERR_MEMORY, "no memory to note what was opened");
    else if (!path || strlen(path) >= RECENT_PATH_BYTES || strchr(path, '\n'))
        status = fail(ERR_INPUT, "%s cannot be noted among the recordings that were opened", recording);
    if (status == OK) {
        recent_read(file, list);
        drop(list, path);
        list->count -= list->count == RECENT_MAX;
        memmove(list->at + 1, list->at, sizeof *list->at * (size_t)list->count);
        list->at[0].opened_s = now_s;
        snprintf(list->at[0].path, sizeof list->at[0].path, "%s", path);
        list->count++;
        status = write_list(file, list);
    }
    free(list);
    free(path);
    return status;
}

enum status recent_remove(const char *file, const char *recording)
{
    struct recent_list *list = malloc(sizeof *list);
    if (!list)
        return fail(ERR_MEMORY, "no memory to note what was opened");
    recent_read(file, list);
    drop(list, recording);
    const enum status status = write_list(file, list);
    free(list);
    return status;
}
