#include "reenact/render/lod_error.h"

// Half a step of the avatar's grid, and how far it lies beside the readings once it is laid on them.
static const double FULL_ERROR_M = 0.5 * TSDF_VOXEL_M + 0.004;

double lod_cylinder_error_m(const struct avatar *l)
{
    double sum = 0;
    for (int i = 0; i < l->surface.point_count; i++)
        sum += fabs(bind_pose_distance(&l->bind_pose, l->surface.points[i]));
    return l->surface.point_count ? sum / l->surface.point_count : 0;
}

double lod_pixels_per_metre(const struct lens *lens, const struct skeleton *in_viewer)
{
    double nearest = INFINITY;
    for (int j = 0; j < JOINT_COUNT; j++)
        if (in_viewer->confidence[j] > 0 && in_viewer->joint[j].z > 0.05)
            nearest = fmin(nearest, in_viewer->joint[j].z);
    return isfinite(nearest) ? lens->fx / nearest : 0;
}

double lod_paper_error_m(double cylinder_error_m, double cost_m)
{
    return cylinder_error_m + cost_m / JOINT_COUNT; // equation 5 has the sum over the joints
}

double lod_full_error_m(void) { return FULL_ERROR_M; }
