#include "objects/thing.h"

#include "base/text.h"
#include "platform/network/address.h"
#include "platform/files/json.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

// `name` beside the file `path`.
static void beside(const char *path, const char *name, char *out, size_t bytes)
{
    const char *slash = strrchr(path, '/');
    const int folder = name[0] == '/' || !slash ? 0 : (int)(slash - path + 1);
    snprintf(out, bytes, "%.*s%s", folder, path, name);
}

static enum status read_thing(const struct json *object, const char *path, struct thing *out)
{
    const char *name = NULL, *picture = NULL, *url = "";
    char file[1024];
    if (!json_get_string(json_member(object, "name"), &name) || !*name || strlen(name) >= THING_NAME_BYTES)
        return fail(ERR_INPUT, "%s: each object needs a \"name\" of at most %d bytes", path, THING_NAME_BYTES - 1);
    if (!text_is_printable(name))
        return fail(ERR_INPUT, "%s: an object's name is not UTF-8 or holds control characters", path);
    if (!json_get_string(json_member(object, "picture"), &picture))
        return fail(ERR_INPUT, "%s: '%s' needs a \"picture\"", path, name);
    (void)json_get_string(json_member(object, "url"), &url);
    if (!text_is_printable(url))
        return fail(ERR_INPUT, "%s: the url of '%s' is not UTF-8 or holds control characters", path, name);
    if (strlen(url) >= THING_URL_BYTES)
        return fail(ERR_INPUT, "%s: the url of '%s' is longer than %d bytes", path, name, THING_URL_BYTES - 1);
    if (!json_get_number(json_member(object, "width_m"), &out->width_m) ||
        !json_get_number(json_member(object, "height_m"), &out->height_m) ||
        !(out->width_m > 0.001 && out->width_m < 100 && out->height_m > 0.001 && out->height_m < 100))
        return fail(ERR_INPUT, "%s: '%s' needs \"width_m\" and \"height_m\", in metres", path, name);
    strcpy(out->name, name);
    strcpy(out->url, url);
    address_hide_user(out->url); // it is kept and shown
    beside(path, picture, file, sizeof file);
    enum status status = image_read(file, &out->picture);
    if (status == OK && (out->picture.width < 24 || out->picture.height < 24))
        status = fail(ERR_INPUT, "%s: the picture is smaller than 24 x 24 pixels", file);
    return status;
}

enum status thing_list_read(const char *path, struct thing_list *out)
{
    struct json *root;
    *out = (struct thing_list){0};
    enum status status = json_read(path, &root);
    const struct json *objects = json_member(root, "objects");
    const int count = json_count(objects);
    if (status == OK && (!json_is_array(objects) || count < 1 || count > THINGS_MOST))
        status = fail(ERR_INPUT, "%s: \"objects\" lists 1 to %d things", path, THINGS_MOST);
    if (status == OK && !(out->things = calloc((size_t)count, sizeof *out->things)))
        status = fail(ERR_MEMORY, "%s: no memory", path);
    for (int i = 0; i < count && status == OK; i++) {
        status = read_thing(json_at(objects, i), path, &out->things[i]);
        out->count++;
        for (int k = 0; k < i && status == OK; k++)
            if (!strcmp(out->things[k].name, out->things[i].name))
                status = fail(ERR_INPUT, "%s: two things have the name '%s'", path, out->things[i].name);
    }
    json_free(&root);
    if (status != OK)
        thing_list_free(out);
    return status;
}

void thing_list_free(struct thing_list *list)
{
    for (int i = 0; i < list->count; i++)
        free(list->things[i].picture.rgb);
    free(list->things);
    *list = (struct thing_list){0};
}
