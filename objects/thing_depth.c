#include "objects/thing_depth.h"

#include "base/depth_noise.h"

#include <stdlib.h>

// Chosen by hand. MIDDLE: half of the front's share that is sampled: nearer to its rim a solid is bent away. BIAS: of a
// structured-light sensor's depth that is common to neighbouring samples, share of the depth. CONTRADICTION: share of
// the distance beyond which size and depth speak of two things.
enum { SIDE = 9, LEAST = 12 };
#define MIDDLE        0.18
#define BIAS          0.004
#define CONTRADICTION 0.15

static int compare(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

// Measured over predicted depth at points of the front's middle, sorted; their number.
static int ratios_of(const struct sighting *s, const struct thing *thing, const struct depth_view *view,
                     double ratio[SIDE * SIDE])
{
    int count = 0;
    for (int i = 0; i < SIDE * SIDE; i++) {
        const double u = 2.0 * (i % SIDE) / (SIDE - 1) - 1, v = 2.0 * (i / SIDE) / (SIDE - 1) - 1;
        const struct vec3 at = v3(MIDDLE * u * thing->width_m, MIDDLE * v * thing->height_m, 0);
        const struct vec3 p = pose_apply(view->depth_from_color, pose_apply(s->left_from_thing, at));
        if (!(p.z > 0.1))
            continue;
        const struct pixel px = lens_project(&view->lens, p);
        const double x = floor(px.x + 0.5), y = floor(px.y + 0.5);
        if (!(x >= 0 && y >= 0 && x < view->lens.width && y < view->lens.height))
            continue;
        const uint16_t mm = view->depth[(size_t)y * (size_t)view->lens.width + (size_t)x];
        if (mm)
            ratio[count++] = mm * 1e-3 / p.z;
    }
    qsort(ratio, (size_t)count, sizeof *ratio, compare);
    return count;
}

enum status sighting_by_depth(struct sighting *s, const struct thing *thing, const struct depth_view *view)
{
    double ratio[SIDE * SIDE];
    const int count = ratios_of(s, thing, view, ratio);
    if (count < LEAST)
        return NOTHING;
    const struct vec3 at = s->left_from_thing.translation, ray = v3_unit(at);
    const double distance = v3_length(at), measured = distance * ratio[count / 2];
    const double before = covariance3_along(&s->covariance, ray);
    if (!(fabs(measured - distance) < CONTRADICTION * distance + 4 * sqrt(before)))
        return AMBIGUOUS;
    const double noise = depth_sigma_m(measured), bias = BIAS * measured;
    const double variance = bias * bias + 1.5707963 * noise * noise / count; // of a median: pi / 2 of a mean's
    const double gain = before / (before + variance);
    const double fused = distance + gain * (measured - distance);
    // All of it lies along the ray; only the component along it shrinks.
    const struct covariance3 shrink = covariance3_outer(v3_scale(ray, sqrt(gain * before)));
    const struct covariance3 minus = covariance3_scale(&shrink, -1);
    s->left_from_thing.translation = v3_scale(at, fused / distance);
    s->covariance = covariance3_add(&s->covariance, &minus);
    return OK;
}
