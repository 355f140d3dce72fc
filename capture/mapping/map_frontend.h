// What the pictures of a sweep show, each by itself: tags, points, their depth. Found on threads of its
// own while the next pictures come; handed over in the order of the pictures, whichever is ready first.
//
//     map_frontend_open, for each picture: if (map_frontend_full) map_frontend_take, map_frontend_put;
//     then map_frontend_take until NOTHING, map_frontend_close
#pragma once
#include "capture/mapping/map_internal.h"

struct map_frontend;

// A picture as it was put, and what it shows.
struct map_frontend_result {
    int32_t number;            // as it was put
    struct frame frame;        // copies; valid until the next map_frontend_put
    struct map_frame observed; // features and tags; the taker's. No picture, not placed
    int32_t ids[PNP_MAX_TAGS]; // all tags in sight, listed or not, each once
    int32_t id_count;
};

// Calibration and tags of `map` must not change meanwhile. ERR_MEMORY, ERR_INPUT: options.
MUST_CHECK enum status map_frontend_open(struct map_frontend **out, const struct map *map,
                                         const struct mapper_options *options);

// As many pictures as it holds have been put and not taken.
bool map_frontend_full(const struct map_frontend *l);

// Copies the picture. Not while full. ERR_MEMORY.
MUST_CHECK enum status map_frontend_put(struct map_frontend *l, const struct frame *frame, int32_t number);

// Waits for the oldest one. NOTHING: all were taken. What went wrong with it: ERR_MEMORY, ERR_SOLVER; it is taken then.
MUST_CHECK enum status map_frontend_take(struct map_frontend *l, struct map_frontend_result *out);

void map_frontend_close(struct map_frontend **l); // NULL is fine; sets *l = NULL

bool map_depth_usable(const struct calibration *c); // it is of the colour's own pixels
void map_frame_free(struct map_frame *f);           // what it holds; zeroes it
