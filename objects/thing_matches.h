// Which features of an image resemble those of a thing's picture. Pure.
#pragma once
#include "objects/thing_view.h"

struct thing_match {
    const struct scale_feature *model, *scene;
    int32_t distance2; // squared Euclidean distance of the descriptors
};

// For each feature of the model the two nearest of the view, in the same channel, as far as they are near at all.
// Writes at most `capacity`; returns their number.
int thing_matches(const struct thing_model *m, const struct thing_view *v, struct thing_match *out, int capacity);
