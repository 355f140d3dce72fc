// A camera's lens: pinhole with Brown-Conrady distortion (Brown 1971), coefficients in OpenCV's order.
// Pixels; (0, 0) is the CENTRE of the top-left pixel. Camera axes: x right,
// y down, z forward, metres. Pure functions, safe from any thread.
#pragma once
#include "base/geometry.h"

struct lens {
    int width, height; // pixels, > 0
    double fx, fy, cx, cy;
    double k1, k2, p1, p2, k3; // no unit; all 0 for an ideal lens
    // Rolling shutter: seconds from the exposure of the first row to that of the last. An image's time is that of its
    // middle row. 0: global shutter.
    double readout_s;
    // Standard deviation of the logarithm of one factor common to fx and fy. 0: they were measured.
    double focal_sigma;
};

// The largest focal_sigma that is accepted; chosen by hand.
#define LENS_MAX_FOCAL_SIGMA 0.5

// The largest readout_s that is accepted: longer than that of any known camera.
#define LENS_MAX_READOUT_S 0.2

// Bounds of what is accepted, far beyond any camera's: a focal length from 1 pixel, and nothing beyond a million.
#define LENS_MIN_FOCAL_PX 1.0
#define LENS_MAX_PX       1e6
// And the factor by which the distortion changes a pixel's distance from the centre, halfway to the corners.
#define LENS_MAX_RADIAL 20.0

struct pixel {
    double x, y;
};

// The lenses of a sensor or camera. One that it does not have has width 0.
struct calibration {
    struct lens color;
    struct lens depth;
    bool registered;              // depth pixels lie on the colour camera's
    struct pose color_from_depth; // identity when registered
};

bool lens_is_ideal(const struct lens *lens); // no distortion

// Of an image; 0 without a lens.
static inline size_t lens_pixels(const struct lens *lens) { return (size_t)lens->width * (size_t)lens->height; }

// Both project each point to the same pixel; readout_s and focal_sigma are not compared.
bool lens_equal(const struct lens *a, const struct lens *b);

// The lens of the same image resized to `share` (0..1) of its pixels per axis; at least 16 pixels, or all there are.
struct lens lens_resized(const struct lens *lens, double share);

// The pixel of point `p` (camera axes). z must be > 0.
struct pixel lens_project(const struct lens *lens, struct vec3 p);

// The largest (x / z)^2 + (y / z)^2 for which the distortion is valid: a radius a tenth beyond the image's corners.
double lens_max_radius2(const struct lens *lens);
// As lens_project, but beyond that radius the radial factor is held, so that points outside do not fold into the image.
struct pixel lens_project_clamped(const struct lens *lens, double largest_r2, struct vec3 p);

// The point with z = 1 that projects to `px`; the distortion is inverted by Newton's method to 1e-10.
struct vec3 lens_ray(const struct lens *lens, struct pixel px);

// ERR_INPUT with a sentence when a number is missing, not finite or out of range, or where the distortion cannot be
// inverted within the image.
// `what` names the lens in the sentence ("color" of calibration.json).
MUST_CHECK enum status lens_check(const struct lens *lens, const char *what);
