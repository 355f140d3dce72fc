#include "surround/alignment/depth_points.h"

#include "base/depth_noise.h"

#include <stdlib.h>

void depth_points_free(struct depth_points *points)
{
    free(points->xyz);
    free(points->sigma);
    *points = (struct depth_points){0};
}

static bool on_surface(const uint16_t *depth, int width, int height, int u, int v)
{
    const uint16_t *at = depth + (size_t)v * (size_t)width + (size_t)u;
    const double z = *at * 1e-3;
    if (z < 0.05)
        return false;
    // Noise of both samples, and a slope of 80 degrees over a pixel at f = 285
    const double most_mm = 1e3 * (depth_difference_m(z) + 0.02 * z);
    const int steps[4] = {u > 0 ? -1 : 0, u + 1 < width ? 1 : 0, v > 0 ? -width : 0, v + 1 < height ? width : 0};
    for (int i = 0; i < 4; i++)
        if (at[steps[i]] && fabs((double)at[steps[i]] - *at) > most_mm)
            return false;
    return true;
}

enum status depth_points_add(struct depth_points *points, const uint16_t *depth, const struct lens *lens,
                             struct pose body_from_camera, int step)
{
    const int more = ((lens->width + step - 1) / step) * ((lens->height + step - 1) / step);
    if (points->count + more > points->room) {
        const int room = points->count + more;
        float(*xyz)[3] = realloc(points->xyz, (size_t)room * sizeof *xyz);
        if (xyz)
            points->xyz = xyz;
        float *sigma = realloc(points->sigma, (size_t)room * sizeof *sigma);
        if (sigma)
            points->sigma = sigma;
        if (!xyz || !sigma)
            return fail(ERR_MEMORY, "out of memory");
        points->room = room;
    }
    double m[3][3];
    quat_to_matrix(body_from_camera.rotation, m);
    const struct vec3 t = body_from_camera.translation;
    for (int v = 0; v < lens->height; v += step)
        for (int u = 0; u < lens->width; u += step) {
            if (!on_surface(depth, lens->width, lens->height, u, v))
                continue;
            const double z = depth[(size_t)v * (size_t)lens->width + (size_t)u] * 1e-3;
            const double x = (u - lens->cx) / lens->fx * z, y = (v - lens->cy) / lens->fy * z;
            float *out = points->xyz[points->count];
            out[0] = (float)(m[0][0] * x + m[0][1] * y + m[0][2] * z + t.x);
            out[1] = (float)(m[1][0] * x + m[1][1] * y + m[1][2] * z + t.y);
            out[2] = (float)(m[2][0] * x + m[2][1] * y + m[2][2] * z + t.z);
            points->sigma[points->count++] = (float)depth_absolute_sigma_m(z);
        }
    return OK;
}
