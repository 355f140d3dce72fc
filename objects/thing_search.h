// Looking for known things in pictures of a single camera whose poses are known: views of a place, or a camera that was
// localised in one. Distance from depth where there is any (thing_depth.h), else from the things' size; what a thing's
// shape and size are is learnt from all pictures together before any is believed.
//
// Memory: 3 bytes a pixel of each picture in which something was found from a viewpoint of its own, 0.1 m or 7 degrees
// from where it was found before, and 2 of its depth.
#pragma once
#include "objects/thing_depth.h"
#include "objects/thing_map.h"

struct thing_search;

// The list must outlive it. ERR_MEMORY, ERR_SOLVER, ERR_INPUT: as recognizer_open. On error *out is NULL.
MUST_CHECK enum status thing_search_open(struct thing_search **out, const struct thing_list *things);
void thing_search_close(struct thing_search **s); // NULL is fine

// The thing was known to stand there before these pictures were taken; said before they are added. So that it can be
// marked as gone: its place was in clear sight (thing_visibility.h) from three viewpoints or more in which depth shows
// that it is empty, or twice as many in which something stands there, and the thing was recognised in none of them.
void thing_search_expect(struct thing_search *s, int thing, const struct pose *world_from_thing,
                         const struct covariance3 *covariance);

// A picture as `lens` took it; depth NULL: none. Everything is copied. ERR_MEMORY, ERR_SOLVER.
MUST_CHECK enum status thing_search_add(struct thing_search *s, const struct lens *lens, struct pose world_from_camera,
                                        const uint8_t *rgb, const struct depth_view *depth);

// The things found, in world axes, and those expected: without a sighting they are where they were, or gone.
// ERR_MEMORY, ERR_SOLVER. *sightings: that the map is made of; *contradicted: left out, because depth and size do not
// fit.
MUST_CHECK enum status thing_search_finish(struct thing_search *s, struct thing_map *out, int *sightings,
                                           int *contradicted);
