// The floor in a depth image, by random sampling that draws the same samples
// every time. Depth camera's axes, metres.
#pragma once
#include "base/geometry.h"

struct grid_ray {
    float x, y; // x/z and y/z of the ray through a cell's middle
};

struct floor_plane {
    struct vec3 up;  // unit, out of the floor
    double height_m; // the camera's height over it
};

// depth: width * height cells, mm, 0 = no reading. Finds the lowest large plane
// within 45 degrees of level for a camera held upright. False: none in sight.
bool floor_plane_fit(const uint16_t *depth, const struct grid_ray *ray, int width, int height, struct floor_plane *out);
