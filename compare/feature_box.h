// The smallest box that holds several feature frames: what a lower bound of their costs is computed from.
#pragma once
#include "compare/alignment.h"

struct feature_box {
    int16_t low[FEATURE_NUMBERS], high[FEATURE_NUMBERS]; // as feature_frame.number
};

// Of the frames first .. end - 1; at least one.
struct feature_box feature_box_of(const struct features *features, int32_t first, int32_t end);

// No pair of frames from the two boxes costs less (feature_cost).
int32_t feature_box_cost(const struct feature_box *a, const struct feature_box *b);
