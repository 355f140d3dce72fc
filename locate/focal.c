#include "locate/focal.h"

#include <stdlib.h>

// The cost is a parabola about this far.
static const double STEP = 0.02;
// Sure enough to be told.
static const double MOST_SIGMA = 0.02;

// The robust cost of the best pose for a focal length that many times as long: all rays
// lie nearer to the axis.
static double cost_at(const struct fit_tag *tags, int count, const struct fit_point *points, int point_count, double fx,
                      double fy, struct pose pose, double longer, struct sighting *seen, struct fit_tag *own,
                      struct fit_point *moved)
{
    double by = 1 / (1 + longer);
    for (int i = 0; i < count; i++) {
        seen[i] = *tags[i].seen;
        own[i] = tags[i];
        own[i].seen = &seen[i];
        own[i].depth = NULL;
        for (int k = 0; k < 4; k++) {
            seen[i].ray[k].x *= by;
            seen[i].ray[k].y *= by;
        }
    }
    for (int i = 0; i < point_count; i++) {
        moved[i] = points[i];
        moved[i].x *= by;
        moved[i].y *= by;
    }
    // In the pixels of the longer lens nothing is known better than before.
    return fit_refine(own, count, 0, moved, point_count, 0, fx * (1 + longer), fy * (1 + longer), &pose);
}

bool focal_check(const struct fit_tag *tags, int count, const struct fit_point *points, int point_count, double fx,
                 double fy, const struct pose *camera_from_world, struct focal *out)
{
    struct sighting *seen = malloc(((size_t)count + 1) * sizeof *seen);
    struct fit_tag *own = malloc(((size_t)count + 1) * sizeof *own);
    struct fit_point *moved = malloc(((size_t)point_count + 1) * sizeof *moved);
    bool known = false;
    if (seen && own && moved) {
        double at = 0; // two steps: the first may lead far
        for (int round = 0; round < 2; round++) {
            double cost[3];
            for (int k = 0; k < 3; k++)
                cost[k] = cost_at(tags, count, points, point_count, fx, fy, *camera_from_world, at + (k - 1) * STEP,
                                  seen, own, moved);
            double bend = (cost[0] - 2 * cost[1] + cost[2]) / (STEP * STEP), slope = (cost[2] - cost[0]) / (2 * STEP);
            known = bend > 0;
            if (!known)
                break;
            at = fmin(fmax(at - slope / bend, -0.2), 0.2);
            *out = (struct focal){at, sqrt(2 / bend)};
        }
    }
    free(seen);
    free(own);
    free(moved);
    return known && out->sigma < MOST_SIGMA && fabs(out->longer) < 0.19;
}
