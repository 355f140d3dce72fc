#include "reenact/render/lod_error.h"

// Half a step of the likeness's grid, and how far it lies beside the readings once it is laid on them.
static const double FULL_M = 0.5 * VOLUME_STEP_M + 0.004;

double level_cylinders_off_m(const struct likeness *l)
{
    double sum = 0;
    for (int i = 0; i < l->surface.point_count; i++)
        sum += fabs(rest_distance(&l->rest, l->surface.points[i]));
    return l->surface.point_count ? sum / l->surface.point_count : 0;
}

double level_pixels_a_metre(const struct lens *lens, const struct skeleton *in_viewer)
{
    double nearest = INFINITY;
    for (int j = 0; j < JOINT_COUNT; j++)
        if (in_viewer->confidence[j] > 0 && in_viewer->joint[j].z > 0.05)
            nearest = fmin(nearest, in_viewer->joint[j].z);
    return isfinite(nearest) ? lens->fx / nearest : 0;
}

double level_paper_error_m(double cylinders_off_m, double cost_m)
{
    return cylinders_off_m + cost_m / JOINT_COUNT; // equation 5 has the sum over the joints
}

double level_full_error_m(void) { return FULL_M; }
