// Rigid alignment of two sets of corresponding points, to compare estimates with truth in one frame. Pure functions; no
// memory, no errors.
#pragma once
#include "recording/place.h"

// The rigid motion b_from_a that maps points a to points b with the least squared error (Horn 1987: power iteration on
// the 4 x 4 matrix). Requires n > 2 points that are not collinear.
struct pose align_points(const struct vec3 *a, const struct vec3 *b, int n);

// Aligns a place's axes with the truth's by the corners of their common tags and returns what is left, rms in metres;
// INFINITY where there is no tag, or where a tag is missing in the truth.
double align_tags(const struct place *place, const struct place_tag *truth, int32_t truth_count,
                  struct pose *truth_from_place);
