// Where the tablet is, picture after picture: the seam between the app and
// whatever locates. Today every picture is located for itself.
#pragma once
#include "locate/locate.h"

struct finder;

// Copies what it needs. ERR_INPUT, ERR_MEMORY as locator_open.
MUST_CHECK enum status finder_open(struct finder **out, const struct place *place, const struct lens *lens);
void finder_close(struct finder **f); // NULL is fine

// color: RGB of the lens's size; time_ns: when it was taken, rising.
// OK and AMBIGUOUS: *world_from_camera is filled. NOTHING: it does not know. Errors as locator_find.
MUST_CHECK enum status finder_find(struct finder *f, const uint8_t *color, int64_t time_ns,
                                   struct pose *world_from_camera);
