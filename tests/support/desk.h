// A made-up desk: things with painted fronts before a painted wall, their reference pictures, and a stereo rig that
// films them through bent lenses. For tests and benchmarks of recognition; ray-traced, 2 x 2 rays a pixel, no shadows.
#pragma once
#include "capture/calibration/stereo_calibration.h"
#include "objects/thing.h"

enum { DESK_THINGS = 8 }; // the first half stands there, the second half looks like it and is absent

struct desk {
    struct thing_list things;
    struct thing storage[DESK_THINGS];
    struct image texture[DESK_THINGS]; // of the front, or once round a solid
    bool turned[DESK_THINGS];
    struct pose world_from_thing[DESK_THINGS]; // origin: middle of the front
    struct image wall;                         // 4 m wide at z = 2, in pixels of 4 mm
    struct stereo_rig rig;
};

// False: out of memory.
bool desk_make(struct desk *d, uint64_t seed);
void desk_free(struct desk *d);

// What a camera sees, with noise of `noise` grey levels; rgb: lens->width * lens->height * 3 bytes. The world is that
// of the things: x right, y down, z away.
void desk_film(const struct desk *d, const struct lens *lens, const struct pose *world_from_camera, double noise,
               uint64_t seed, uint8_t *rgb);
