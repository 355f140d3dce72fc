// Rolling shutter: the rows of an image are exposed one after the other, first to last within lens.readout_s, while the
// camera moves. An image's time, and the pose estimated for it, are those of its middle row; what another row shows was
// seen from where the camera was then, at constant velocity. With points and tags in many rows the velocity can be
// estimated together with the pose; a prior of it takes part. Pure.
#pragma once
#include "base/lens.h"

// The camera's velocity while the image is read. Order of the 6-vectors: angular (rad/s), then linear (m/s), both in
// the camera's own axes.
struct shutter_motion {
    double velocity[6];
    // The prior without this image: mean and inverse covariance, row-major.
    double expected[6], information[36];
};

// The prior of a hand-held camera of which nothing is known: 0, standard deviations 1 rad/s and 1 m/s.
struct shutter_motion shutter_motion_unknown(void);
// covariance: 6 x 6, positive definite; of `velocity`. Numbers that are not finite or too fast for a hand-held camera
// give shutter_motion_unknown.
struct shutter_motion shutter_motion_prior(const double velocity[6], const double covariance[36]);

// When a row is read, seconds after the middle one. 0 without a rolling shutter.
double shutter_row_time(const struct lens *lens, double row);

// Where a point is in camera axes at `time_s` that is at `p` when the middle row is read. motion NULL: p.
struct vec3 shutter_apply_motion(const struct shutter_motion *motion, double time_s, struct vec3 p);

// Where that point appears: in the row that is read when it is there. motion NULL: lens_project.
struct pixel shutter_project(const struct lens *lens, const struct shutter_motion *motion, struct vec3 p);
