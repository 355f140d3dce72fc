// Point-to-plane alignment of points with a map's voxels (Chen and Medioni 1992), with Huber's weights. Pure.
#pragma once
#include "surround/alignment/depth_points.h"
#include "surround/alignment/normal_equations.h"
#include "surround/alignment/voxel_map.h"

// Moves *world_from_body so that the points lie on the map's planes: about the floor's normal and along the floor.
// The pose given is a soft prior (5 cm, 1 degree), for directions that the points leave open. At most about `most`
// points are used. more: further evidence; NULL: none. ERR_MEMORY.
MUST_CHECK enum status plane_refine(const struct voxel_map *planes, const struct depth_points *points, int most,
                                    const struct pose_evidence *more, struct pose *world_from_body);
