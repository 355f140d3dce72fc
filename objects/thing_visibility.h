// Whether a picture shows the place of a thing so clearly that the thing would be recognised if it stood there. Pure.
#pragma once
#include "objects/thing_depth.h"

enum thing_sight {
    SIGHT_NONE,     // out of the picture, too small, too slanted, hidden, or it cannot be told
    SIGHT_OCCUPIED, // something stands at its place
    SIGHT_EMPTY,    // what is seen there is farther away than the thing would be
};

// camera_from_thing: where it is thought to stand. lens: of the picture; depth: of the same instant, without which
// nothing hides it that could be known of: SIGHT_NONE.
enum thing_sight thing_sight_of(const struct thing *thing, struct pose camera_from_thing, const struct lens *lens,
                                const struct depth_view *depth);
