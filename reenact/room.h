// The room about the actor, as far as a sensor saw it: what may stand between him
// and whoever looks. Gathered from the views of the empty place and from some of
// the take's frames (a truncated signed distance on a coarse grid). The floor is
// left out, it hides nobody; and where the actor's own body passed, no room is. Pure.
#pragma once
#include "reenact/likeness.h"

// Triangles in the world's axes, metres; either side may face outwards.
struct room {
    float (*points)[3];
    uint16_t *corners; // corner_count, three to a triangle
    int point_count, corner_count;
    struct room_ball *balls; // that hold all of it, for a quick look whether any of it matters
    int ball_count;
};
struct room_ball {
    struct vec3 middle;
    double radius_m;
};

// The take's frames have to be located in the place's world. rays: as for
// likeness_make. NOTHING: the place or the take has no depth, nothing stands about,
// or watch (perhaps NULL) does not want it any more. ERR_CORRUPT, ERR_IO, ERR_MEMORY.
MUST_CHECK enum status room_make(struct room *out, const struct place *place, struct take *take,
                                 const struct likeness_watch *watch);
void room_free(struct room *room); // leaves it zeroed

// May any of it be before a body whose joints those are (camera axes, metres)?
// viewer_from_room: into the same axes.
bool room_may_hide(const struct room *room, const struct part_map *viewer_from_room, const struct skeleton *in_viewer);
