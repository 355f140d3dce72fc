// reenact-capture objects list and note: the things of a recording, and what is written of them by hand.
#include "app/commands/objects_run.h"

#include "base/text.h"
#include "objects/thing_knowledge.h"
#include "recording/recorded_things.h"
#include "app/commands/command.h"
#include "platform/files/json.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static enum status read_things(const char *path, struct recorded_thing **things, int *count)
{
    struct recording *r;
    *things = NULL;
    *count = 0;
    enum status status = recording_open(&r, path);
    if (status == OK)
        status = recording_read_things(r, things, count);
    recording_free(&r);
    return status;
}

static void knowledge_of(const struct recorded_thing *t, struct thing_knowledge *k)
{
    if (!t->knowledge || thing_knowledge_parse(t->knowledge, strlen(t->knowledge), t->url, k) != OK)
        *k = (struct thing_knowledge){0};
}

static double sigma_m(const struct recorded_thing *t) { return sqrt(covariance3_trace(&t->covariance)); }

static void print_thing(const struct recorded_thing *t)
{
    const struct vec3 at = t->world_from_thing.translation;
    struct thing_knowledge k;
    knowledge_of(t, &k);
    printf("%s at %.3f %.3f %.3f m", t->name, at.x, at.y, at.z);
    if (sigma_m(t) > 0)
        printf(", to %.1f mm", 1e3 * sigma_m(t));
    printf("%s\n", t->gone ? ", gone" : "");
    const char *const lines[][2] = {{"name", k.name},         {"description", k.description},   {"weight", k.weight},
                                    {"material", k.material}, {"instructions", k.instructions}, {"model", k.model},
                                    {"note", t->note}};
    for (size_t i = 0; i < COUNT_OF(lines); i++)
        if (lines[i][1][0])
            printf("  %s: %s\n", lines[i][0], lines[i][1]);
}

static void add_thing(struct json *list, const struct recorded_thing *t)
{
    struct json *thing = json_add_object(list, NULL), *at = json_add_array(thing, "position_m");
    const struct vec3 p = t->world_from_thing.translation;
    struct thing_knowledge k;
    knowledge_of(t, &k);
    json_push_number(at, p.x);
    json_push_number(at, p.y);
    json_push_number(at, p.z);
    json_add_string(thing, "name", t->name);
    json_add_number(thing, "sigma_m", sigma_m(t));
    json_add_number(thing, "sightings", t->sightings);
    json_add_bool(thing, "gone", t->gone);
    json_add_string(thing, "url", t->url);
    json_add_string(thing, "note", t->note);
    json_add_string(thing, "description", k.description);
    json_add_string(thing, "weight", k.weight);
    json_add_string(thing, "material", k.material);
    json_add_string(thing, "instructions", k.instructions);
    json_add_string(thing, "model", k.model);
}

enum status objects_list(const char *path, bool as_json)
{
    struct recorded_thing *things;
    int count;
    enum status status = read_things(path, &things, &count);
    if (status == OK && as_json) {
        struct json *root = json_new_object(), *list = json_add_array(root, "things");
        for (int i = 0; i < count; i++)
            add_thing(list, &things[i]);
        status = command_print_json(&root);
    }
    for (int i = 0; i < count && status == OK && !as_json; i++)
        print_thing(&things[i]);
    char shown[TEXT_SHOWN_BYTES];
    if (status == OK && !count && !as_json)
        printf("%s holds no things; reenact-capture objects finds them, and objects note --at adds one\n",
               text_shown(path, shown));
    recorded_things_free(&things, count);
    return status;
}

enum status objects_note(const char *path, const char *name, const char *text, const struct vec3 *at)
{
    struct recorded_thing *things, *grown;
    int count, i = 0;
    enum status status = read_things(path, &things, &count);
    if (status != OK)
        return status;
    while (i < count && strcmp(things[i].name, name))
        i++;
    if (!text_is_printable(name) || !text_is_printable(text))
        status = fail(ERR_INPUT, "a name or note must be UTF-8 without control characters");
    else if (strlen(name) >= sizeof things->name || strlen(text) >= sizeof things->note)
        status = fail(ERR_INPUT, "a name has at most %zu bytes, a note %zu", sizeof things->name - 1,
                      sizeof things->note - 1);
    else if (i == count && !at)
        status = fail(ERR_MISSING, "%s has no thing '%s'; with --at X,Y,Z it is added", path, name);
    else if (i == count && !(grown = realloc(things, sizeof *grown * ((size_t)count + 1))))
        status = fail(ERR_MEMORY, "no memory for another thing");
    if (status == OK && i == count) {
        things = grown;
        things[count++] = (struct recorded_thing){.world_from_thing = POSE_IDENTITY};
        strcpy(things[i].name, name);
    }
    if (status == OK) {
        strcpy(things[i].note, text);
        if (at)
            things[i].world_from_thing.translation = *at;
        status = recording_write_things(path, things, count);
    }
    recorded_things_free(&things, count);
    return status;
}
