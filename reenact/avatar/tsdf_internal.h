// What tsdf.c and tsdf_integrate.c share: what is behind tsdf.h. For those alone.
#pragma once
#include "reenact/avatar/tsdf.h"

// Distances are kept up to here, metres.
#define VOLUME_OUTSIDE_M 0.045F

// A point of the grid that is kept.
struct cell {
    int32_t at;     // in the grid
    float place[3]; // in the rest pose
    struct skin skin;
};

// What is known at a point of the grid, side by side, for it is asked for together.
struct point {
    float distance, trust; // trust 0: not kept
    float seen;            // the part of its trust that readings of a surface near it gave
};

// A pixel of a sight, likewise.
struct witness {
    uint16_t depth;
    uint8_t part, edge, half;
};

// Cells with the same bones, worked on together.
enum { VOLUME_LANES = 8 };
struct cell_block {
    int32_t at[VOLUME_LANES]; // those from `count` on are as the first
    float place[3][VOLUME_LANES], weight[SKIN_BONES][VOLUME_LANES];
    uint8_t bone[SKIN_BONES]; // as the first: it has no more
    uint8_t count;
};

struct volume {
    struct rest rest;
    struct calibration calibration;
    struct pose depth_from_color;
    struct vec3 corner;
    double step; // between neighbouring points of the grid, metres
    int size[3];
    struct cell *cells;
    int cell_count;
    struct cell *heeding; // copies of those that readings still go into, in their order; NULL: all
    int heeding_count;
    struct cell_block *blocks; // of these, or of all; NULL: no frame was added since
    int block_count;
    struct point *points;      // of the grid
    struct witness *witnesses; // of the frame that is added
};
