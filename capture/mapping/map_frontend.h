// The front end of the mapper: what each image of a sweep shows by itself, that is tags (AprilTag 36h11, refined to
// subpixels), ORB features and their depth. Done on two threads while the next images come; results are handed over in
// the order of the images, whichever is ready first, so that they do not depend on timing.
//
//     map_frontend_open, for each image: if (map_frontend_full) map_frontend_take, map_frontend_put;
//     then map_frontend_take until NOTHING, map_frontend_close
//
// One handle, one calling thread. Memory: four images with their depth.
#pragma once
#include "capture/mapping/map_internal.h"

struct map_frontend;

// An image as it was put, and what it shows.
struct map_frontend_result {
    int32_t number;            // as given to map_frontend_put
    struct frame frame;        // the front end's copies; valid until the next map_frontend_put
    struct map_frame observed; // features and tags; owned by the caller. No image, not placed
    int32_t ids[PNP_MAX_TAGS]; // all tags in the image, listed or not, each once
    int32_t id_count;
};

// Calibration and tags of `map` must not change while it is open. ERR_MEMORY, ERR_INPUT: options. On failure
// *out = NULL.
MUST_CHECK enum status map_frontend_open(struct map_frontend **out, const struct map *map,
                                         const struct mapper_options *options);

// True when it holds as many images as it can: take one before the next put.
bool map_frontend_full(const struct map_frontend *frontend);

// Copies the image. Not while full. ERR_MEMORY: the image was not put.
MUST_CHECK enum status map_frontend_put(struct map_frontend *frontend, const struct frame *frame, int32_t number);

// Waits for the oldest image. NOTHING: all were taken. ERR_MEMORY, ERR_SOLVER: this image failed; it counts as taken.
MUST_CHECK enum status map_frontend_take(struct map_frontend *frontend, struct map_frontend_result *out);

void map_frontend_close(struct map_frontend **l); // NULL is fine; sets *l = NULL

bool map_depth_usable(const struct calibration *calibration); // depth pixels lie on colour pixels, at the same size
void map_frame_free(struct map_frame *frame);                 // frees what it holds; zeroes it
