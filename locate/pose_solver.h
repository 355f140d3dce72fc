// A camera's pose from tags whose place is known: all corners of all tags at
// once, each weighed by how well it was seen, depth where there is some. Every
// tag's two mirrored poses are tried as a start, tags that do not fit the rest
// are left out. Pure; no allocation.
#pragma once
#include "capture/recording/place.h"
#include "locate/tag_corners.h"
#include "locate/rolling_shutter.h"
#include "locate/planar_pose.h"
#include "locate/tag_depth.h"

enum { PNP_MAX_TAGS = 64 };

struct pnp_tag {
    const struct tag_observation *seen;
    const struct tag_depth *depth; // or NULL
    struct pose world_from_tag;
    double side_m;
    double map_px;           // how well its corners are seen, beside the picture's noise: standard deviation
    const float *covariance; // how surely the map has it, as struct place_tag; or NULL: exactly
    bool used;               // out: in agreement with the pose
    double rms_px;           // out: reprojection error of its corners
};

// A natural point whose place is known, seen on the ray (x, y, 1).
struct pnp_point {
    struct vec3 world;
    double x, y;
    double sigma_px;      // of either coordinate, beside `covariance`
    double z;             // depth read there, metres; 0: none
    double covariance[3]; // beside sigma_px: xx, xy, yy, pixels^2
    double time_s;        // when its row was read, as shutter_row_time
    double z_variance;    // of the place's own distance, m^2
};

struct pnp_solution {
    struct pose camera_from_world;
    struct pose other;        // with AMBIGUOUS: the second best
    double rms_px;            // over the corners used
    double cost;              // robust, whitened; of the tags used
    double other_excess_cost; // by how much the other's cost is higher
    int32_t used;
    struct shutter_motion motion, other_motion; // with a rolling shutter
};

// fx, fy: what a pixel is. motion: what is known of the camera's before; NULL: no rolling shutter. 0 <= count <=
// PNP_MAX_TAGS; the same tag may be there twice, one at most is used. OK, NOTHING (no pose fits within max_rms_px; *out
// untouched) or AMBIGUOUS
// (*out is the better of two poses that are apart but fit alike).
enum status pnp_solve(struct pnp_tag *tags, int count, double fx, double fy, double max_rms_px,
                      const struct shutter_motion *motion, struct pnp_solution *out);

// Levenberg-Marquardt on camera_from_world over the tags with `used` set and all
// points. tag_px, point_px: uncertainty added to every corner and every point,
// for a start that is far off. motion: the speed is fitted too; NULL: no rolling shutter.
// Returns the robust cost.
double pnp_refine(const struct pnp_tag *tags, int count, double tag_px, const struct pnp_point *points, int point_count,
                  double point_px, double fx, double fy, struct shutter_motion *motion, struct pose *camera_from_world);

// How sure pnp_refine's pose is: the covariance of a small motion (turn, then shift; camera
// axes, radians and metres) of the camera, row-major. Errors larger than the evidence owns
// to make it larger, smaller ones do not make it smaller. False: the evidence leaves a
// motion open; *covariance untouched.
bool pnp_covariance(const struct pnp_tag *tags, int count, const struct pnp_point *points, int point_count, double fx,
                    double fy, const struct shutter_motion *motion, const struct pose *camera_from_world,
                    double covariance[36]);

// The same, not yet inverted and as if errors were as large as the evidence owns to.
void pnp_information(const struct pnp_tag *tags, int count, const struct pnp_point *points, int point_count, double fx,
                     double fy, const struct shutter_motion *motion, const struct pose *camera_from_world,
                     double information[36]);

// Makes what the evidence says of the camera's speed what is expected of it.
void pnp_update_velocity_prior(const struct pnp_tag *tags, int count, const struct pnp_point *points, int point_count,
                               double fx, double fy, struct shutter_motion *motion,
                               const struct pose *camera_from_world);

// Reprojection error of one tag; 1e9 behind the camera or from its back.
double pnp_tag_rms(const struct pnp_tag *tag, const struct shutter_motion *motion, const struct pose *camera_from_world,
                   double fx, double fy);

// The robust cost of one tag, corners (with extra_px) and depth.
double pnp_tag_cost(const struct pnp_tag *tag, const struct pose *camera_from_world, double extra_px, double fx,
                    double fy);

// Reprojection error of a point in its standard deviations; 1e9 behind the camera.
double pnp_point_error(const struct pnp_point *p, const struct shutter_motion *motion,
                       const struct pose *camera_from_world, double fx, double fy);
