// What tsdf.c and tsdf_integrate.c share: what is behind tsdf.h. For those alone.
#pragma once
#include "reenact/avatar/tsdf.h"

// Distances are kept up to here, metres.
#define TSDF_TRUNCATION_M 0.045F

// A point of the grid that is kept.
struct tsdf_cell {
    int32_t at;     // in the grid
    float place[3]; // in the bind pose
    struct skin_weights skin;
};

// What is known at a point of the grid, side by side, for it is asked for together.
struct tsdf_voxel {
    float distance, weight; // weight 0: not kept
    float seen;             // the part of its weight that readings of a surface near it gave
};

// A pixel of a depth_frame, likewise.
struct labelled_sample {
    uint16_t depth;
    uint8_t part, edge, half;
};

// Cells with the same bones, worked on together.
enum { TSDF_LANES = 8 };
struct tsdf_block {
    int32_t at[TSDF_LANES]; // those from `count` on are as the first
    float place[3][TSDF_LANES], weight[SKIN_BONES][TSDF_LANES];
    uint8_t bone[SKIN_BONES]; // as the first: it has no more
    uint8_t count;
};

struct tsdf {
    struct bind_pose bind_pose;
    struct calibration calibration;
    struct pose depth_from_color;
    struct vec3 corner;
    double step; // between neighbouring points of the grid, metres
    int size[3];
    struct tsdf_cell *cells;
    int cell_count;
    struct tsdf_cell *active_cells; // copies of those that readings still go into, in their order; NULL: all
    int active_count;
    struct tsdf_block *blocks; // of these, or of all; NULL: no frame was added since
    int block_count;
    struct tsdf_voxel *voxels;       // of the grid
    struct labelled_sample *samples; // of the frame that is added
};
