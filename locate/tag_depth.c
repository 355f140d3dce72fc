#include "locate/tag_depth.h"

#include "base/linear_algebra.h"
#include "locate/planar_pose.h"

static const double ROBUST = 3;         // standard deviations: scale of the Cauchy kernel; chosen by hand
static const double DEPTH_SHARE = 0.25; // errors of neighbouring depth pixels are correlated; chosen by hand

void tag_read_depth(const struct tag_observation *seen, const struct lens *lens, const uint16_t *depth,
                    struct tag_depth *out)
{
    double h[9];
    out->count = 0;
    if (!planar_homography(seen->ray, h))
        return;
    double values[TAG_DEPTH_SAMPLES];
    enum { GRID = 6 };
    for (int i = 0; i < GRID * GRID; i++) {
        double u = ((i % GRID) + 0.5) * 2 / GRID - 1, v = ((i / GRID) + 0.5) * 2 / GRID - 1;
        double w = h[6] * u + h[7] * v + h[8];
        struct vec3 ray = v3((h[0] * u + h[1] * v + h[2]) / w, (h[3] * u + h[4] * v + h[5]) / w, 1);
        struct pixel px = lens_project(lens, ray);
        int x = (int)floor(px.x + 0.5), y = (int)floor(px.y + 0.5);
        if (!(px.x > -0.5 && px.y > -0.5) || x >= lens->width || y >= lens->height)
            continue;
        double z = depth[(size_t)y * (size_t)lens->width + (size_t)x] * 1e-3;
        if (z == 0)
            continue;
        ray = lens_ray(lens, (struct pixel){x, y}); // of the pixel that was read
        out->sample[out->count++] = (struct depth_sample){ray.x, ray.y, z};
    }
    // Flying pixels and things in front of the tag are outliers of the plane 1 / z = a x + b y + c through the rest:
    // iteratively reweighted least squares, at first without robust weights.
    double a = 0, b = 0, c = 0;
    for (int round = 0; round < 4; round++) {
        double n[9] = {0}, g[3] = {0};
        for (int i = 0; i < out->count; i++) {
            const struct depth_sample *s = &out->sample[i];
            double q[3] = {s->x, s->y, 1},
                   error = round ? (s->z - 1 / (a * s->x + b * s->y + c)) / depth_absolute_sigma_m(s->z) : 0;
            values[i] = error;
            double weight =
                1 / (1 + error * error / (ROBUST * ROBUST)) * pow(s->z, 4) / pow(depth_absolute_sigma_m(s->z), 2);
            for (int k = 0; k < 3; k++) {
                g[k] += weight * q[k] / s->z;
                for (int l = 0; l < 3; l++)
                    n[k * 3 + l] += weight * q[k] * q[l];
            }
        }
        if (out->count < 6 || !cholesky_factor(n, 3)) {
            out->count = 0;
            return;
        }
        cholesky_solve(n, 3, g);
        a = g[0], b = g[1], c = g[2];
    }
    int kept = 0, levels = 0;
    for (int i = 0; i < out->count; i++)
        if (fabs(values[i]) < 4)
            out->sample[kept++] = out->sample[i];
    out->count = kept;
    for (int i = 0; i < kept; i++) {
        bool fresh = true;
        for (int k = 0; k < i; k++)
            fresh = fresh && out->sample[k].z != out->sample[i].z;
        levels += fresh;
    }
    out->share = DEPTH_SHARE * fmin(1, 3.0 * levels / fmax(1, kept));
}
