// Mesh simplification by edge collapse with quadric error metrics (meshoptimizer; Garland & Heckbert 1997). Pure and
// deterministic; any thread may call.
#pragma once
#include "base/status.h"

struct simplify_mesh {
    const float (*points)[3];
    const int32_t *corners; // indices of points, three to a triangle
    int point_count, corner_count;
};

// Removes points, in the order of the least change of the surface, until `max_corners` corners are left or the next
// removal would move the surface by more than `error` (units of the points). The points that remain do not move.
// out[corner_count] receives the remaining corners, ordered for the GPU's vertex cache. Returns their number.
int mesh_simplify(const struct simplify_mesh *mesh, int max_corners, float error, int32_t *out);
