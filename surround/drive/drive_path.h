// Where a robot has been, as a line on the floor of bounded length in memory: when it is full every second point goes,
// and points are kept twice as far apart from then on. Pure.
#pragma once
#include "base/geometry.h"

enum { DRIVE_PATH_POINTS = 256 };

struct drive_path {                    // zeroed: empty
    struct vec3 at[DRIVE_PATH_POINTS]; // world, m; the first where it began
    int count;
    double spacing_m; // least distance between neighbours
};

void drive_path_add(struct drive_path *p, struct vec3 at);
