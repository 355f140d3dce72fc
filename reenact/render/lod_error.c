// Predicted errors of the levels of detail.
#include "reenact/render/lod_error.h"

// Half a voxel of the TSDF, and 4 mm of residual distance to the depth samples after articulated ICP; chosen by hand.
// docs/notes/retrieval-and-drawing.md compares the predictions with measured silhouette errors.
static const double FULL_ERROR_M = 0.5 * TSDF_VOXEL_M + 0.004;

double lod_cylinder_error_m(const struct avatar *a)
{
    double sum = 0;
    for (int i = 0; i < a->surface.point_count; i++)
        sum += fabs(bind_pose_distance(&a->bind_pose, a->surface.points[i]));
    return a->surface.point_count ? sum / a->surface.point_count : 0;
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
