// A recorded place as surroundings: its views that hold both colour and depth, drawn from a free viewpoint
// (surroundings.h). What was not filmed is marked there. Pure but for memory.
#pragma once
#include "recording/place.h"
#include "surround/surroundings.h"

// How many of the place's views can be used.
int filmed_room_views(const struct place *place);

// view: the lens of what will be drawn, ideal. how NULL: the default of SURROUNDINGS_FILMED. The place may be freed
// afterwards. A view whose picture is damaged is left out. ERR_INPUT: it was filmed without a colour camera;
// ERR_MEMORY. On error *room is zeroed. surroundings_close closes it.
MUST_CHECK enum status filmed_room_open(struct surroundings *room, const struct place *place, const struct lens *view,
                                        const struct surroundings_options *options);

// Draws another size or lens from now on. ERR_MEMORY: nothing can be drawn until the next success.
MUST_CHECK enum status filmed_room_set_lens(struct surroundings *room, const struct lens *view);

// Frees the depth of pictures beyond the `max` that are nearest to the viewpoint, as surroundings_draw ranks them; it
// is made again when needed. ERR_MEMORY.
MUST_CHECK enum status filmed_room_trim(struct surroundings *room, struct pose world_from_view, int max);
