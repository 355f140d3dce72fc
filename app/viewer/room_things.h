// A recording's things as a map shows them: what is drawn of each over it, and their bodies on the GPU. The GPU's
// thread.
#pragma once
#include "app/place/place_things.h"
#include "app/ui/room_page.h"

struct room_things {
    struct place_things known;
    struct room_thing *shown;   // of each
    struct thing_solid *solids; // of each, opened when first drawn
    bool *opened;
};

// What of them is damaged is no error: there are none then. ERR_MEMORY; room_things_close is needed then, too.
MUST_CHECK enum status room_things_open(struct room_things *out, struct recording *recording);
void room_things_close(struct room_things *things); // zeroed is fine

// The thing's body; empty where that cannot be made: the thing stays an outline.
const struct thing_solid *room_things_solid(struct room_things *things, struct gpu *gpu, int i);
// All bodies, in the place's world.
void room_things_draw(struct room_things *things, struct gpu *gpu, struct solid_renderer *renderer,
                      const struct solid_view *view);
