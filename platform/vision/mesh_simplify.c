#include "platform/vision/mesh_simplify.h"

#include <meshoptimizer.h>

int mesh_simplify(const struct simplify_mesh *mesh, int max_corners, float error, int32_t *out)
{
    const float *points = mesh->points[0];
    size_t count = (size_t)mesh->point_count, stride = sizeof *mesh->points;
    if (max_corners > mesh->corner_count) // the library asserts on a mesh that is coarse already
        max_corners = mesh->corner_count;
    float scale = meshopt_simplifyScale(points, count, stride); // meshoptimizer's error is relative to the extent
    size_t left = meshopt_simplify((unsigned *)out, (const unsigned *)mesh->corners, (size_t)mesh->corner_count, points,
                                   count, stride, (size_t)max_corners, error / scale, 0, NULL);
    meshopt_optimizeVertexCache((unsigned *)out, (const unsigned *)out, left, count);
    return (int)left;
}
