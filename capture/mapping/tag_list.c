// Reading of tags.json: which tags hang in the place and how large they are.
#include "capture/mapping/mapper.h"
#include "platform/files/json.h"
#include "platform/vision/tag_detector.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

static int by_id(const void *left, const void *right)
{
    const struct mapper_tag *a = left, *b = right;
    return (a->id > b->id) - (a->id < b->id);
}

static enum status read_side(const struct json *member, const char *path, struct mapper_tag *out)
{
    const char *name = json_name(member);
    char *end;
    errno = 0;
    long id = strtol(name, &end, 10);
    if (end == name || *end || errno || id < 0 || id >= TAG_ID_COUNT)
        return fail(ERR_INPUT, "%s: '%s' in side_m is no tag number; tag36h11 has 0 to %d", path, name,
                    TAG_ID_COUNT - 1);
    double side;
    if (!json_get_number(member, &side) || !(side >= 0.005) || !(side <= 5))
        return fail(ERR_INPUT,
                    "%s: the side of tag %ld must be a number of metres between 0.005 and 5, "
                    "the outer edge of its black square",
                    path, id);
    *out = (struct mapper_tag){(int32_t)id, side};
    return OK;
}

static enum status read_list(const struct json *root, const char *path, struct mapper_tag **tags, int32_t *count)
{
    const char *family;
    if (!json_get_string(json_member(root, "family"), &family))
        return fail(ERR_INPUT, "%s: the text 'family' is missing; write \"family\": \"tag36h11\"", path);
    if (strcmp(family, "tag36h11"))
        return fail(ERR_INPUT, "%s: tags of the family '%s' are not known here; print tags of tag36h11", path, family);
    const struct json *sides = json_member(root, "side_m");
    if (!json_is_object(sides) || !json_count(sides))
        return fail(ERR_INPUT,
                    "%s: 'side_m' names no tag; write the side of each tag in metres, as in "
                    "\"side_m\": {\"0\": 0.2}",
                    path);
    int n = json_count(sides);
    if (n > TAG_ID_COUNT)
        return fail(ERR_INPUT, "%s: 'side_m' names %d tags; tag36h11 has %d", path, n, TAG_ID_COUNT);
    struct mapper_tag *list = calloc((size_t)n, sizeof *list);
    if (!list)
        return fail(ERR_MEMORY, "no memory for %d tags", n);
    enum status status = OK;
    const struct json *side = json_first(sides);
    for (int i = 0; side && status == OK; side = json_next(side), i++)
        status = read_side(side, path, &list[i]);
    if (status == OK)
        qsort(list, (size_t)n, sizeof *list, by_id);
    for (int i = 1; i < n && status == OK; i++)
        if (list[i].id == list[i - 1].id)
            status = fail(ERR_INPUT, "%s: tag %d is listed twice", path, (int)list[i].id);
    if (status != OK) {
        free(list);
        return status;
    }
    *tags = list;
    *count = n;
    return OK;
}

enum status mapper_read_tags(const char *path, struct mapper_tag **tags, int32_t *count)
{
    struct json *root;
    *tags = NULL;
    *count = 0;
    enum status status = json_read(path, &root);
    if (status != OK)
        return status;
    status = read_list(root, path, tags, count);
    json_free(&root);
    return status;
}
