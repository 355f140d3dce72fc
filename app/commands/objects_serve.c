// reenact-capture objects serve: the folder of a knowledge base.
#include "app/commands/objects_run.h"

#include "base/text.h"
#include "objects/thing.h"
#include "objects/thing_knowledge.h"
#include "platform/files/file.h"
#include "platform/files/png.h"
#include "platform/files/text_file.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

// The path below the folder that a thing's URL means: no scheme, host, "..", query.
static bool path_of(const struct thing *t, char *out, size_t bytes)
{
    const char *path = strstr(t->url, "://");
    path = path ? strchr(path + 3, '/') : t->url;
    while (path && *path == '/')
        path++;
    if (!path || !*path || strstr(path, "..") || strpbrk(path, "?#\\"))
        return false;
    return (size_t)snprintf(out, bytes, "%s", path) < bytes;
}

static enum status write_new(const char *path, const void *bytes, size_t count, bool force)
{
    const enum status status = file_check_output(path, force);
    return status == OK ? file_write(path, bytes, count) : status;
}

static enum status write_picture(const struct thing *t, const char *path, bool force)
{
    const struct png_layout layout = {PNG_RGB8, t->picture.width, t->picture.height};
    uint8_t *bytes;
    size_t count;
    enum status status = png_encode(&layout, t->picture.rgb, 6, &bytes, &count);
    if (status == OK) {
        status = write_new(path, bytes, count, force);
        free(bytes);
    }
    return status;
}

// The description is what a text file beside the list says of the thing.
static enum status describe(struct thing_knowledge *k, const char *path)
{
    struct text_file file;
    enum status status = text_file_open(&file, path);
    if (status != OK)
        return status;
    snprintf(k->description, sizeof k->description, "%s", file.next);
    text_make_utf8(k->description); // where it is cut, too
    text_file_close(&file);
    return OK;
}

static enum status write_thing(const struct thing *t, const char *objects, const char *folder, bool force)
{
    char path[1024], file[2048], picture[2100], note[2048];
    struct thing_knowledge k = {0};
    if (!path_of(t, path, sizeof path))
        return fail(ERR_INPUT, "'%s': its url '%s' is no path below a folder", t->name, t->url);
    snprintf(file, sizeof file, "%s/%s", folder, path);
    snprintf(picture, sizeof picture, "%s.png", file);
    const char *slash = strrchr(objects, '/');
    snprintf(note, sizeof note, "%.*s%s.txt", slash ? (int)(slash - objects + 1) : 0, objects, t->name);
    snprintf(k.name, sizeof k.name, "%s", t->name);
    snprintf(k.description, sizeof k.description, "%.0f x %.0f mm", 1000 * t->width_m, 1000 * t->height_m);
    enum status status = file_exists(note) ? describe(&k, note) : OK;
    const char *leaf = strrchr(path, '/');
    snprintf(k.image, sizeof k.image, "%.400s.png", leaf ? leaf + 1 : path);
    char parent[2048];
    snprintf(parent, sizeof parent, "%s", file);
    *strrchr(parent, '/') = 0;
    if (status == OK)
        status = folder_make(parent);
    char *json = status == OK ? thing_knowledge_print(&k) : NULL;
    if (status == OK)
        status = json ? write_new(file, json, strlen(json), force) : fail(ERR_MEMORY, "no memory to write %s", file);
    free(json);
    return status == OK ? write_picture(t, picture, force) : status;
}

enum status objects_serve(const char *objects, const char *folder, bool force)
{
    struct thing_list things;
    enum status status = thing_list_read(objects, &things);
    for (int i = 0; i < things.count && status == OK; i++)
        status = write_thing(&things.things[i], objects, folder, force);
    if (status == OK)
        printf("%s: %d things; any web server can show this folder, for example nginx, with default_type "
               "application/ld+json\n",
               folder, things.count);
    thing_list_free(&things);
    return status;
}
