// Unifies a moving robot's depth: each new capture is aligned with the earlier ones and added to them (Okura 2014,
// section 3.3). The odometry's motion since the last capture is the guess; branch and bound on the floor's plane by the
// L0 norm finds the basin; point-to-plane least squares over the map's voxels (Chen and Medioni 1992), on the floor's
// plane, gives the last millimetres.
//
// World: the body's axes at the first capture. Pure but for memory; one thread at a time.
#pragma once
#include "surround/alignment/branch_and_bound.h"
#include "surround/alignment/depth_points.h"
#include "surround/alignment/normal_equations.h"
#include "surround/alignment/voxel_map.h"

struct depth_alignment {
    struct voxel_map surface; // all points
    struct voxel_map planes;  // 10 cm: for the refinement
    struct voxel_map outline; // 2 cm, z = 0: points of the compared heights
    int capture_count;
    struct pose odometry, world_from_body; // of the newest capture
    struct search_result search;           // of the newest capture
    struct pose_evidence more;             // beside the planes, for the refinement; set by the caller before an add
};

// surface_m: side of the voxels that all points are averaged in. ERR_MEMORY.
MUST_CHECK enum status depth_alignment_open(struct depth_alignment *a, double surface_m);
void depth_alignment_close(struct depth_alignment *a); // what was zeroed, too

// Aligns and adds a capture. *world_from_body: where it was. NOTHING: the points do not fit the earlier ones, not even
// after the widened search; then *world_from_body is the odometry's, and the points are not added. ERR_MEMORY.
MUST_CHECK enum status depth_alignment_add(struct depth_alignment *a, const struct depth_points *points,
                                           struct pose odometry, struct pose *world_from_body);

// Adds points whose pose is known.
MUST_CHECK enum status depth_alignment_unify(struct depth_alignment *a, const struct depth_points *points,
                                             struct pose world_from_body);

// The body's pose at a time between captures or before the newest has arrived: the last aligned pose, moved on by the
// odometry since.
struct pose depth_alignment_bridge(const struct depth_alignment *a, struct pose odometry);
