// Bundle adjustment (Triggs et al. 2000; Ceres): joint least squares over camera
// poses, tag poses and points, from their image positions and measured depths.
//
// Residuals are whitened: the cost is half the sum of squares in units of one
// standard deviation, with a Cauchy kernel of scale 3 (3 sqrt 8 for a tag's eight
// numbers). Held blocks fix the gauge. Deterministic, on the caller's thread; any
// thread may call.
#pragma once
#include "base/geometry.h"

#ifdef __cplusplus
extern "C" {
#endif

struct ba_camera {
    struct pose camera_from_world; // in and out
};

struct ba_square {
    struct pose world_from_square; // in and out
    double side_m;                 // known
    bool held;                     // constant
};

// The four corners of a square in a camera's image. Ideal pixels relative to the principal point: (fx x / z, fy y / z).
struct ba_corners {
    int32_t camera, square;
    double observed[8];  // x, y of each corner, in the order of tag_detection.corner
    double whiten[8][8]; // whiten * (predicted - observed) has unit covariance
};

// A depth sample inside a square: z along the ray (x, y, 1), metres.
struct ba_plane_depth {
    int32_t camera, square;
    double x, y, z, sigma_m;
};

// A point in a camera's image; z = 0: no depth.
struct ba_observation {
    int32_t camera, point;
    double x, y;          // on the plane z = 1
    double covariance[3]; // of the image position: xx, xy, yy, pixels^2
    double z, sigma_m;
};

// How the lens differs from the one by which rays were made: a point in direction (x, y, 1) appears in (focal[0] x b +
// shift[0], focal[1] y b + shift[1], 1) with b = 1 + bend (x^2 + y^2). Focal lengths and principal point are thus those
// of the true lens relative to the given one's, in units of the focal length.
enum { BA_LENS_NUMBERS = 5 };
struct ba_lens {
    double focal[2], shift[2], bend;
    // Out: row-major, in the order above; all 0 where the problem leaves something undetermined.
    double covariance[BA_LENS_NUMBERS * BA_LENS_NUMBERS];
};

struct ba_problem {
    double fx, fy;
    struct ba_lens *lens; // in and out: the lens is estimated, too; NULL: it is as given
    struct ba_camera *cameras;
    struct ba_square *squares;
    struct vec3 *points; // in and out
    const struct ba_corners *corners;
    const struct ba_plane_depth *plane_depths;
    const struct ba_observation *observations;
    int32_t camera_count, square_count, point_count;
    int32_t corner_count, plane_depth_count, observation_count;
    int32_t held_camera;      // index of the camera held constant; -1: none
    int32_t held_points;      // the first so many points are held constant
    bool hold_cameras;        // all cameras are held constant
    int32_t max_iterations;   // of Ceres
    double *cost;             // out: the final robust cost; or NULL
    double *depth_scale;      // in and out: factor that corrects measured depths; NULL: 1, not estimated
    double depth_scale_sigma; // standard deviation of its prior, whose mean is 1
    // out, or NULL: (6 square_count)^2, row-major: the joint covariance of the squares' poses at the solution, with
    // held blocks taken as exact. Each square has a small rotation (x, y, z, radians), then a translation (x, y, z,
    // metres), in its own axes. 0 for squares that are held or not observed; all 0 if the problem is singular.
    double *square_covariance;
};

// ERR_SOLVER: no usable solution; ERR_MEMORY. Then nothing of *problem has changed,
// except that *cost and *square_covariance are undefined. A camera, square or point
// without observations keeps its value.
MUST_CHECK enum status bundle_adjust(const struct ba_problem *problem);

#ifdef __cplusplus
}
#endif
