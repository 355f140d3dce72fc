// The means of an alignment's voxels as points, to make depth of. Pure but for memory.
#pragma once
#include "surround/alignment/voxel_map.h"
#include "surround/depth/dense_depth.h"

struct surface_points {
    float (*xyz)[3];
    float *weights; // of each point; of 1 mm standard deviation: 1
    int count;
    size_t room;
};

// Replaces what is in *s. ERR_MEMORY.
MUST_CHECK enum status surface_points_gather(struct surface_points *s, const struct voxel_map *map);
void surface_points_free(struct surface_points *s); // what was zeroed, too
struct world_points surface_points_world(const struct surface_points *s);
