// Fits the floor plane to a depth image: RANSAC (Fischler and Bolles 1981) over three-point planes, then weighted least
// squares over the inliers. Points under a plane count against it, since nothing is below a floor. Depth camera's axes,
// metres. Pure; the pseudo-random samples are the same in every call.
#pragma once
#include "base/lens.h"

struct grid_ray {
    float x, y; // x/z and y/z of the ray through a cell's middle
};

struct floor_plane {
    struct vec3 up;  // unit normal, out of the floor
    double height_m; // the camera's height over it
};

// depth: width * height cells, mm, 0 = no depth. Finds the lowest large plane within 45 degrees of level for a camera
// held upright, at least 0.8 m wide both ways. False: none is visible; *out is then unchanged.
bool floor_plane_fit(const uint16_t *depth, const struct grid_ray *ray, int width, int height, struct floor_plane *out);

// The same in a depth image of that lens, of which it takes about every eighth pixel both ways. Scratch memory is the
// thread's.
bool floor_plane_find(const struct lens *lens, const uint16_t *depth, struct floor_plane *out);
