// The pose world_from_camera of an upright camera (z up) that faces a point.
#pragma once
#include "base/geometry.h"

static inline struct pose bench_look_at(struct vec3 from, struct vec3 at)
{
    struct vec3 z = v3_unit(v3_sub(at, from)), x = v3_unit(v3_cross(z, v3(0, 0, 1))), y = v3_cross(z, x);
    double m[3][3] = {{x.x, y.x, z.x}, {x.y, y.y, z.y}, {x.z, y.z, z.z}};
    return (struct pose){quat_from_matrix(m), from};
}
