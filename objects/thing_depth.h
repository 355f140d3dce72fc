// Where a thing stands by a depth picture: a single camera knows the distance only from the thing's size. Pure.
#pragma once
#include "base/lens.h"
#include "objects/thing.h"

struct depth_view {
    const uint16_t *depth; // millimetres, 0 = no reading
    struct lens lens;
    struct pose depth_from_color;
};

// Corrects the sighting's distance, along its line of sight, to what the depth samples on the middle of its front say
// (their median), weighted with what the size says; its covariance shrinks. The sighting is of the colour camera.
// NOTHING: too few samples; it stays as it is. AMBIGUOUS: depth contradicts the size by far, so that it may be a
// picture of the thing: it stays as it is, and should not be believed.
MUST_CHECK enum status sighting_by_depth(struct sighting *s, const struct thing *thing, const struct depth_view *view);
