// Two sets of the same points, laid over one another.
#pragma once
#include "platform/geometry.h"

// The rigid motion b_from_a that takes points a to points b best (Horn 1987, by the power
// method on his 4 x 4 matrix). n > 2, not in a line.
struct pose align_points(const struct vec3 *a, const struct vec3 *b, int n);
