// Where a camera is in a place, from one picture: finds the tags, refines their
// corners, and fits the pose to all corners of all known tags at once.
// Deterministic; safe from any thread, one `struct locator` to a thread.
#pragma once
#include "capture/recording/place.h"

struct locator;

struct locator_options {
    double quad_decimate; // the tag finder's; 1 = every pixel, slow and sure. Default 1
    double max_rms_px;    // a worse fit is NOTHING. Default 2.5
};
struct locator_options locator_default_options(void);

struct location {
    struct pose world_from_camera;
    double rms_px; // over the corners used
    int32_t tags_used, tags_rejected;
};

// Copies what it needs of `place` and `lens`. ERR_INPUT: no tag in the place and
// nothing else to go by, a senseless lens, two tags with the same number. ERR_MEMORY.
MUST_CHECK enum status locator_open(struct locator **out, const struct place *place, const struct lens *lens,
                                    const struct locator_options *options);
void locator_close(struct locator **l);

// color: RGB of the lens's size. depth: of the same pixels, or NULL.
// OK         *out filled
// NOTHING    no known tag in sight, or none that fits; *out untouched
// AMBIGUOUS  a mirrored pose fits nearly as well; *out holds the better one
MUST_CHECK enum status locator_find(struct locator *l, const uint8_t *color, const uint16_t *depth,
                                    struct location *out);
