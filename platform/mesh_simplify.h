// The same shape with fewer triangles, by meshoptimizer. Pure; deterministic.
#pragma once
#include "base/status.h"

// Takes out one point after the other, each time the one whose absence moves the surface
// least, until `most` corners are left or the next would move it by more than `error`; the
// other points stay where they are. points: three floats each. corners: corner_count
// numbers of points, three to a triangle. out[corner_count]: in an order in which neighbours follow one
// another, so that a GPU works out each point but once. Returns how many corners are left.
int mesh_simplify(const float (*points)[3], int point_count, const int32_t *corners, int corner_count, int most,
                  float error, int32_t *out);
