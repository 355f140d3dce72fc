// Two sets of the same points, laid over one another.
#pragma once
#include "capture/recording/place.h"

// The rigid motion b_from_a that takes points a to points b best (Horn 1987, by the power
// method on his 4 x 4 matrix). n > 2, not in a line.
struct pose align_points(const struct vec3 *a, const struct vec3 *b, int n);

// The same from a place's axes to the truth's, by the corners of its tags. What they are then off by, rms,
// metres; INFINITY where there is no tag, or the truth knows one of them not.
double align_tags(const struct place *place, const struct place_tag *truth, int32_t truth_count,
                  struct pose *truth_from_place);
