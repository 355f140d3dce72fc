// Joint least squares (Ceres) over camera poses, the poses of square tags and
// points, from where they were seen and how far the sensor says they are.
// Errors are whitened; observations lose weight beyond three standard deviations.
// Deterministic, one thread. What is held still fixes the frame of reference.
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
    bool held;                     // stays where it is
};

// The four corners of a square in a camera. Ideal pixels: (fx x / z, fy y / z).
struct ba_corners {
    int32_t camera, square;
    double observed[8];
    double whiten[8][8]; // whiten * (predicted - observed) has unit covariance
};

// Depth along the ray (x, y, 1), inside a square.
struct ba_plane_depth {
    int32_t camera, square;
    double x, y, z, sigma_m;
};

// A point in a camera; z = 0: no depth.
struct ba_observation {
    int32_t camera, point;
    double x, y;          // on the plane z = 1
    double covariance[3]; // of where it was seen: xx, xy, yy, pixels^2
    double z, sigma_m;
};

struct ba_problem {
    double fx, fy;
    struct ba_camera *cameras;
    struct ba_square *squares;
    struct vec3 *points; // in and out
    const struct ba_corners *corners;
    const struct ba_plane_depth *plane_depths;
    const struct ba_observation *observations;
    int32_t camera_count, square_count, point_count;
    int32_t corner_count, plane_depth_count, observation_count;
    int32_t held_camera;      // stays where it is; -1: none does
    int32_t held_points;      // so many, the first ones, stay where they are
    bool hold_cameras;        // all of them stay where they are
    int32_t max_iterations;   // of Ceres
    double *cost;             // out: the robust cost in the end; or NULL
    double *depth_scale;      // in and out: readings of depth times this are true; or NULL: they are true
    double depth_scale_sigma; // it is about 1, within this
    // out: 6 square_count on a side, row-major: the joint covariance of a small turn (radians) and shift (metres) of
    // each square in its own axes, in the end, with what is held as exact. 0 for what is held or seen by nothing, and
    // everywhere where the errors leave something open. Or NULL.
    double *square_covariance;
};

// ERR_SOLVER: no usable solution, everything stays as it was. ERR_MEMORY.
// A camera, square or point that nothing sees stays as it was.
MUST_CHECK enum status bundle_adjust(const struct ba_problem *problem);

#ifdef __cplusplus
}
#endif
