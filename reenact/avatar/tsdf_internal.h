// The state of a TSDF, shared by tsdf.c, tsdf_integrate.c and tsdf_store.c. For those and for tests only.
#pragma once
#include "reenact/avatar/tsdf.h"

#define TSDF_TRUNCATION_M 0.045F // distances are clamped to this; 5 voxels

// A grid point that is near a bone.
struct tsdf_cell {
    int32_t at;     // its index in the grid
    float point[3]; // bind-pose axes
    struct skin_weights skin;
};

// The value at a grid point; one struct, since all of it is read together.
struct tsdf_voxel {
    float distance, weight; // weight 0: not near a bone, no value
    float seen;             // the part of the weight that came from depth samples of a surface near it
};

// A pixel of a depth frame, likewise.
struct labelled_sample {
    uint16_t depth;
    uint8_t part, edge, half;
};

// Cells with the same bones, processed together.
enum { TSDF_LANES = 8 };
struct tsdf_block {
    int32_t at[TSDF_LANES]; // lanes from `count` on repeat the first
    float point[3][TSDF_LANES], weight[SKIN_BONES][TSDF_LANES];
    uint8_t bone[SKIN_BONES]; // unused bones repeat the first, with weight 0
    uint8_t count;
};

enum { TSDF_POINTS_MOST = 32000000 }; // of a grid, 384 MB: ten times what a dancer's takes (3.3 million)

struct tsdf {
    struct bind_pose bind_pose;
    struct calibration calibration;
    struct pose depth_from_color;
    struct vec3 corner;
    double step; // between neighbouring grid points, metres
    int threads;
    int size[3]; // index of point (x, y, z): (z * size[1] + y) * size[0] + x
    struct tsdf_cell *cells;
    int cell_count;
    struct tsdf_cell *active_cells; // copies of those that are still integrated, in their order; NULL: all are
    int active_count;
    struct tsdf_block *blocks; // of the active cells; NULL: no frame was integrated since they changed
    int block_count;
    struct tsdf_voxel *voxels;       // of the grid
    struct labelled_sample *samples; // of the frame that is being integrated
};
