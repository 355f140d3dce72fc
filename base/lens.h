// A camera's lens: pinhole and Brown-Conrady distortion, as OpenCV orders it.
// Pixels; (0, 0) is the CENTRE of the top-left pixel. Camera axes: x right,
// y down, z forward, metres. Pure functions, safe from any thread.
#pragma once
#include "base/geometry.h"

struct lens {
    int width, height; // pixels, > 0
    double fx, fy, cx, cy;
    double k1, k2, p1, p2, k3; // no unit; all 0 for an ideal lens
    // A rolling shutter: how long after the first row the last one is read, seconds. A picture's time is its
    // middle row's. 0: all rows are read at once.
    double readout_s;
    // How unsure fx and fy are, both by the same factor: sigma of its logarithm. 0: they were measured.
    double focal_sigma;
};

// A lens less sure than this says nothing.
#define LENS_MAX_FOCAL_SIGMA 0.5

// No camera takes longer to read a picture.
#define LENS_MAX_READOUT_S 0.2

struct pixel {
    double x, y;
};

// What a sensor or camera knows of itself. A missing picture has width 0.
struct calibration {
    struct lens color;
    struct lens depth;
    bool registered;              // depth pixels are already the colour camera's
    struct pose color_from_depth; // identity when registered
};

bool lens_is_ideal(const struct lens *lens); // no distortion

// Both show each point at the same pixel. How fast they read and how sure they are is not asked.
bool lens_equal(const struct lens *a, const struct lens *b);

// The same lens's picture with that share of its pixels along either side, 0 to 1; at least 16.
struct lens lens_resized(const struct lens *lens, double share);

// Where point `p` (camera axes) falls. z must be > 0.
struct pixel lens_project(const struct lens *lens, struct vec3 p);

// The largest (x / z)^2 + (y / z)^2 that its distortion is meant for: a tenth farther out than the picture's corners.
double lens_max_radius2(const struct lens *lens);
// As lens_project, but beyond that the distortion is held, so that what lies outside does not fall into the picture.
struct pixel lens_project_clamped(const struct lens *lens, double largest_r2, struct vec3 p);

// The point with z = 1 that falls on `px`; distortion undone by Newton to 1e-10.
struct vec3 lens_ray(const struct lens *lens, struct pixel px);

// ERR_INPUT with a sentence when a number is missing, not finite or senseless.
// `what` names the lens in the sentence ("color" of calibration.json).
MUST_CHECK enum status lens_check(const struct lens *lens, const char *what);
