// Screen bounds by projecting points along the frustum's sides.
#include "reenact/render/screen_bounds.h"

struct gpu_box screen_bounds(const struct lens *lens, const double low[2], const double high[2])
{
    enum { SIDE = 16, MARGIN_PX = 2 };
    const struct gpu_box all = {0, 0, 0, 0};
    const double largest = lens_max_radius2(lens);
    double first[2] = {INFINITY, INFINITY}, last[2] = {-INFINITY, -INFINITY};
    for (int i = 0; i < 4 * (SIDE + 1); i++) { // along the sides, which distortion curves
        const int side = i % 4;                // left, right, top, bottom
        const double along = i / 4 / (double)SIDE;
        const double u = side < 2 ? side : along, v = side < 2 ? along : side - 2;
        const struct vec3 ray = {(1 - u) * low[0] + u * high[0], (1 - v) * low[1] + v * high[1], 1};
        if (!(ray.x * ray.x + ray.y * ray.y <= largest) && !lens_is_ideal(lens))
            return all; // out there the shaders hold the radial factor (lens.glsl)
        const struct pixel px = lens_project(lens, ray);
        if (!isfinite(px.x) || !isfinite(px.y)) // fmin and fmax would pass over NaN
            return all;
        const double at[2] = {px.x, px.y};
        for (int a = 0; a < 2; a++) {
            first[a] = fmin(first[a], at[a]);
            last[a] = fmax(last[a], at[a]);
        }
    }
    const double far[2] = {2.0 * lens->width, 2.0 * lens->height};
    if (!isfinite(first[0]) || !isfinite(first[1]) || !isfinite(last[0]) || !isfinite(last[1]))
        return all;
    for (int a = 0; a < 2; a++) {
        first[a] = fmin(fmax(floor(first[a]) - MARGIN_PX, -far[a]), far[a]);
        last[a] = fmin(fmax(ceil(last[a]) + MARGIN_PX, -far[a]), far[a]);
    }
    return (struct gpu_box){(int)first[0], (int)first[1], (int)(last[0] - first[0]) + 1, (int)(last[1] - first[1]) + 1};
}
