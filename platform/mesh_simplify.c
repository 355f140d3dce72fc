#include "platform/mesh_simplify.h"

#include <meshoptimizer.h>

int mesh_simplify(const float (*points)[3], int point_count, const int32_t *corners, int corner_count, int most,
                  float error, int32_t *out)
{
    size_t count = (size_t)point_count, stride = sizeof *points;
    float scale = meshopt_simplifyScale(points[0], count, stride);
    size_t left = meshopt_simplify((unsigned *)out, (const unsigned *)corners, (size_t)corner_count, points[0], count,
                                   stride, (size_t)most, error / scale, 0, NULL);
    meshopt_optimizeVertexCache((unsigned *)out, (const unsigned *)out, left, count);
    return (int)left;
}
