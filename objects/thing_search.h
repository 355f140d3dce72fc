// Looking for known things in pictures of a single camera whose poses are known: views of a place, or a camera that was
// localised in one. Distance from depth where there is any (thing_map.h), else from the things' size; what a thing's
// shape and size are is learnt from all pictures together before any is believed.
//
// Memory: 3 bytes a pixel of each picture in which something was found from a viewpoint of its own, 0.1 m or 7 degrees
// from where it was found before, and 2 of its depth.
#pragma once
#include "objects/thing_map.h"
#include "platform/sensors/source.h"

// ---------------------------------------------------------------- sweep pictures

// The pictures of a sweep, kept until their poses are known, so that things can be looked for in them afterwards.
//
// Memory: at most SWEEP_PICTURES_MAX pictures: the JPEG of each, and its depth at half the resolution (0.15 MB at
// 640 x 480). Of a long sweep every second, fourth … is kept, counted from the first, as the mapper does.

enum { SWEEP_PICTURES_MAX = 240 };

struct sweep_picture {
    int64_t time_ns;
    uint8_t *jpeg;
    size_t jpeg_bytes;
    uint16_t *depth;  // of sweep_pictures.depth_lens; NULL: none
    double sharpness; // share of the image's contrast that is between neighbouring pixels
};

struct sweep_pictures {
    struct calibration calibration; // of the source
    struct lens depth_lens;         // of the pictures' depth; width 0: there is none
    struct sweep_picture pictures[SWEEP_PICTURES_MAX];
    int count;
    int64_t seen, stride; // frames with colour; of which every stride'th is kept
};

void sweep_pictures_start(struct sweep_pictures *pictures, const struct calibration *calibration);
void sweep_pictures_free(struct sweep_pictures *pictures); // zeroed is fine

// Copies what it needs. ERR_MEMORY.
MUST_CHECK enum status sweep_pictures_add(struct sweep_pictures *pictures, const struct frame *frame);

// Sharp enough to look for things: not blurred by motion, against the sharpest of the pictures just before and after.
bool sweep_picture_is_sharp(const struct sweep_pictures *pictures, int picture);

// ---------------------------------------------------------------- thing search

struct thing_search;

// The list must outlive it. ERR_MEMORY, ERR_SOLVER, ERR_INPUT: as recognizer_open. On error *out is NULL.
MUST_CHECK enum status thing_search_open(struct thing_search **out, const struct thing_list *things);
void thing_search_close(struct thing_search **search); // NULL is fine

// The thing was known to stand there before these pictures were taken; said before they are added. So that it can be
// marked as gone: its place was in clear sight (thing_map.h) from three viewpoints or more in which depth shows
// that it is empty, or twice as many in which something stands there, and the thing was recognised in none of them.
void thing_search_expect(struct thing_search *search, int thing, const struct pose *world_from_thing,
                         const struct covariance3 *covariance);

// A picture as `lens` took it; depth NULL: none. Everything is copied. ERR_MEMORY, ERR_SOLVER.
MUST_CHECK enum status thing_search_add(struct thing_search *search, const struct lens *lens,
                                        struct pose world_from_camera, const uint8_t *rgb,
                                        const struct depth_view *depth);

// The things found, in world axes, and those expected: without a sighting they are where they were, or gone.
// ERR_MEMORY, ERR_SOLVER. *sightings: that the map is made of; *contradicted: left out, because depth and size do not
// fit.
MUST_CHECK enum status thing_search_finish(struct thing_search *search, struct thing_map *out, int *sightings,
                                           int *contradicted);
