#include "app/viewer/room_things.h"

#include <stdlib.h>

enum status room_things_open(struct room_things *out, struct recording *recording)
{
    *out = (struct room_things){0};
    const enum status status = place_things_read(recording, &out->known);
    if (status == ERR_MEMORY)
        return status;
    const size_t count = (size_t)out->known.count + 1;
    out->shown = calloc(count, sizeof *out->shown);
    out->solids = calloc(count, sizeof *out->solids);
    out->opened = calloc(count, sizeof *out->opened);
    if (!out->shown || !out->solids || !out->opened)
        return fail(ERR_MEMORY, "no memory for what stands in the room");
    for (int i = 0; i < out->known.count; i++) {
        const struct place_thing *t = &out->known.things[i];
        struct room_thing *s = &out->shown[i];
        *s = (struct room_thing){.name = t->name,
                                 .world_from_thing = t->world_from_thing,
                                 .width_m = t->width_m,
                                 .height_m = t->height_m,
                                 .sigma_m = t->sigma_m,
                                 .gone = t->gone};
        covariance_ellipsoid(&t->covariance, s->ellipsoid);
    }
    return OK;
}

void room_things_close(struct room_things *things)
{
    for (int i = 0; i < things->known.count && things->solids; i++)
        thing_solid_close(&things->solids[i]);
    free(things->shown);
    free(things->solids);
    free(things->opened);
    place_things_free(&things->known);
    *things = (struct room_things){0};
}

const struct thing_solid *room_things_solid(struct room_things *things, struct gpu *gpu, int i)
{
    if (!things->opened[i]) {
        things->opened[i] = true; // once: what cannot be opened stays an outline
        if (thing_solid_open(&things->solids[i], gpu, &things->known.things[i]) != OK)
            things->solids[i] = (struct thing_solid){0};
    }
    return &things->solids[i];
}

void room_things_draw(struct room_things *things, struct gpu *gpu, struct solid_renderer *renderer,
                      const struct solid_view *view)
{
    for (int i = 0; i < things->known.count; i++)
        thing_solid_draw(room_things_solid(things, gpu, i), renderer, view, things->known.things[i].world_from_thing);
}
