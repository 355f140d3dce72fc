// Keeping things in a recording, with what a knowledge base says of them.
#include "app/commands/objects_run.h"

#include "objects/thing_update.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const struct recorded_thing *find(const struct recorded_thing *things, int count, const char *name)
{
    for (int i = 0; i < count; i++)
        if (!strcmp(things[i].name, name))
            return &things[i];
    return NULL;
}

// The thing as the map has it now; what the recording knows of it already goes on.
static enum status make_thing(struct recorded_thing *out, const struct recorded_thing *before,
                              const struct mapped_thing *t, const struct thing *thing)
{
    enum status status = OK;
    *out = (struct recorded_thing){0};
    if (before)
        status = recorded_thing_copy(out, before);
    strcpy(out->name, thing->name);
    out->world_from_thing = t->world_from_thing;
    out->covariance = t->covariance;
    out->width_m = thing->width_m;
    out->height_m = thing->height_m;
    out->sightings = t->sightings + (t->known && before ? before->sightings : 0);
    out->gone = t->gone;
    return status;
}

static void ask_knowledge(const struct objects_arguments *a, const char *reference, struct recorded_thing *out)
{
    struct http_limits limits = http_default_limits();
    struct thing_update update;
    limits.login = a->knowledge;
    thing_update_ask(out, a->knowledge, reference, &limits, &update);
    if (update.trouble[0])
        fprintf(stderr, "warning: nothing new is known of '%s': %s\n", out->name, update.trouble);
    if (update.content_trouble[0])
        fprintf(stderr, "warning: '%s': %s\n", out->name, update.content_trouble);
}

// Fills now[]; *written: how many it holds, also after a failure.
static enum status collect(const struct thing_map *map, const struct thing_list *things,
                           const struct objects_arguments *a, const struct recorded_thing *before, int count,
                           struct recorded_thing *now, int *written)
{
    enum status status = OK;
    for (int i = 0; i < map->count && status == OK; i++) {
        if (!map->things[i].sightings && !map->things[i].gone) // known, and out of sight
            continue;
        const struct thing *thing = &things->things[map->things[i].thing];
        struct recorded_thing *out = &now[(*written)++];
        status = make_thing(out, find(before, count, thing->name), &map->things[i], thing);
        if (status == OK && a->knowledge && thing->url[0])
            ask_knowledge(a, thing->url, out);
    }
    const int mapped = *written;
    for (int i = 0; i < count && status == OK; i++)
        if (!find(now, mapped, before[i].name)) // not seen in this run, or named by hand
            status = recorded_thing_copy(&now[(*written)++], &before[i]);
    return status;
}

enum status objects_into(const struct thing_map *map, const struct thing_list *things,
                         const struct objects_arguments *a)
{
    struct recording *recording;
    struct recorded_thing *before = NULL, *now = NULL;
    int count = 0, written = 0;
    enum status status = recording_open(&recording, a->into);
    if (status == OK)
        status = recording_read_things(recording, &before, &count);
    recording_free(&recording);
    if (status == OK && !(now = calloc((size_t)(map->count + count) + 1, sizeof *now)))
        status = fail(ERR_MEMORY, "no memory for the things of %s", a->into);
    if (status == OK)
        status = collect(map, things, a, before, count, now, &written);
    if (status == OK)
        status = recording_write_things(a->into, now, written);
    recorded_things_free(&now, written);
    recorded_things_free(&before, count);
    return status;
}
