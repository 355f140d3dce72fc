// Pose of a camera from tags and landmarks (PnP).
//
// Minimises the robust, whitened reprojection error of tag corners and landmarks, and depth residuals where there is
// depth, by Levenberg-Marquardt (base/least_squares.h). Robust kernel: Cauchy, c^2 ln(1 + chi^2 / c^2), one kernel a
// tag (all eight numbers of its corners), a landmark (with its depth) or a depth sample. Tags give the starting points:
// both planar poses of each tag (IPPE, see below); tags that disagree with the best pose are left out.
//
// The pose is camera_from_world. It is updated on the left: T <- exp(d) T. The order of every 6-vector is
// (rotation x, y, z in radians; translation x, y, z in metres), in camera axes (x right, y down, z forward). Matrices
// are row-major. Costs have no unit: whitened squares, chi squared where errors are small.
//
// Pure; no allocation, but large arrays on the stack (about 40 KiB). Safe from any thread.
#pragma once
#include "base/geometry.h"
#include "locate/rolling_shutter.h"
#include "locate/tag_corners.h"
#include "locate/tag_model.h"
#include "recording/place.h"

// ---------------------------------------------------------------- pose solver

enum { PNP_MAX_TAGS = 64 };

// The reprojection error of what the camera cannot see: behind it or, of a tag, from its back.
#define PNP_NOT_VISIBLE 1e9

struct pnp_tag {
    const struct tag_observation *seen;
    const struct tag_depth *depth; // or NULL
    struct pose world_from_tag;
    double side_m;
    double map_px;           // standard deviation of its corners beside the image noise
    const float *covariance; // of the map's pose of it, as in struct place_tag; NULL: exact
    bool used;               // in: takes part in a fit; out of pnp_solve: agrees with the pose
    double rms_px;           // out of pnp_solve: reprojection error of its corners
};

// A landmark seen on the ray (x, y, 1).
struct pnp_point {
    struct vec3 world;
    double x, y;
    double sigma_px;      // of either coordinate, added to `covariance`
    double z;             // measured depth, metres; 0: none
    double covariance[3]; // added to sigma_px: xx, xy, yy, pixels^2
    double time_s;        // when its row was read, as shutter_row_time
    double z_variance;    // of the map's distance along z, m^2
};

// What the pose of one camera image is estimated from. All borrowed.
struct pose_problem {
    struct pnp_tag *tags; // only pnp_solve writes to them (used, rms_px)
    int tag_count;        // 0 .. PNP_MAX_TAGS; the same tag may be there twice
    const struct pnp_point *points;
    int point_count;
    double fx, fy; // pixels; turn rays into pixels
    // Uncertainty added to every tag corner and every point, pixels: greater than 0 for a start that is far off.
    // With tag_px > 0 depth inside tags is left out.
    double tag_px, point_px;
    // NULL: no rolling shutter. Else the camera's velocity while the image is read is estimated, too.
    struct shutter_motion *motion;
};

struct pnp_solution {
    struct pose camera_from_world;
    struct pose other;        // with AMBIGUOUS: the second best
    double rms_px;            // over the corners used
    double cost;              // of the tags used
    double other_excess_cost; // how much higher the other's cost is
    int32_t used;
    struct shutter_motion motion, other_motion; // with a rolling shutter
};

// From the tags alone; points, tag_px and point_px are not used, *motion is the prior and is not changed.
// Of several tags with the same number at most one is used.
// OK
// NOTHING    no pose fits within max_rms_px; *out untouched
// AMBIGUOUS  two distinct poses fit about equally well; *out holds the better one
enum status pnp_solve(const struct pose_problem *problem, double max_rms_px, struct pnp_solution *out);

// Refines *camera_from_world (and *problem->motion) by the tags with `used` set and all points. Returns the robust
// cost. A start from which nothing improves is left as it is.
double pnp_refine(const struct pose_problem *problem, struct pose *camera_from_world);

// The covariance of the error of pnp_refine's pose; tag_px and point_px are taken as 0. Residuals larger than their
// covariances explain scale it up, smaller ones do not scale it down. False: the problem leaves a motion
// undetermined; *covariance untouched.
bool pnp_covariance(const struct pose_problem *problem, const struct pose *camera_from_world, double covariance[36]);

// The information matrix (inverse covariance) of the same, never scaled.
void pnp_information(const struct pose_problem *problem, const struct pose *camera_from_world, double information[36]);

// Makes the problem's estimate of the velocity, with its information, the prior in *problem->motion.
void pnp_update_velocity_prior(const struct pose_problem *problem, const struct pose *camera_from_world);

// Root mean square reprojection error of one tag's corners, pixels; or PNP_NOT_VISIBLE.
double pnp_tag_rms(const struct pnp_tag *tag, const struct shutter_motion *motion, const struct pose *camera_from_world,
                   double fx, double fy);

// The robust cost of one tag, corners (with extra_px) and depth.
double pnp_tag_cost(const struct pnp_tag *tag, const struct pose *camera_from_world, double extra_px, double fx,
                    double fy);

// Reprojection error of a point in its standard deviations (Mahalanobis distance); or PNP_NOT_VISIBLE.
double pnp_point_error(const struct pnp_point *p, const struct shutter_motion *motion,
                       const struct pose *camera_from_world, double fx, double fy);

// ---------------------------------------------------------------- planar pose

// Planar pose: the pose of one square from its four corners. Infinitesimal plane-based pose estimation (IPPE, Collins &
// Bartoli 2014): both solutions in closed form, since a square seen nearly without perspective looks the same mirrored.
// Camera axes: x right, y down, z forward; rays lie on the plane z = 1. Pure.

// The homography from the square's own (u, v) to the plane z = 1; corner k is at (-1,-1), (1,-1), (1,1), (-1,1).
// Closed form of Heckbert 1989. Row-major, h[8] = 1. False: three corners in a line, or a number that is not finite.
bool planar_homography(const struct vec3 ray[4], double h[9]);

// ray: the corners in place.h's order. Writes the poses camera_from_tag that put the square in front of the camera with
// its face towards it, and returns how many: 0, 1 or 2. Not refined: exact only for exact corners.
int planar_poses(double side_m, const struct vec3 ray[4], struct pose camera_from_tag[2]);

// A lower bound of the distance, metres, between where a square is and where it is expected: the smaller of its two
// solutions', less 3 % of the range, since the range of a distant square is uncertain by a share of it (chosen by
// hand). 0 also when the corners give no pose.
double planar_pose_offset_m(double side_m, const struct vec3 ray[4], const struct pose *expected_camera_from_tag);
