// A rolling shutter: the rows of a picture are read one after the other, from the first to
// the last within lens.readout_s, while the camera moves on. A picture's time, and the pose
// found for it, is that of its middle row; what another row shows was seen from where the
// camera was then, if it kept its speed. With points and tags in many rows that speed can be
// read off the picture itself; what was known of it before has its say, too. Pure.
#pragma once
#include "base/lens.h"

// How the camera moves while the picture is read: turn (rad/s), then shift (m/s), both in the
// camera's own axes.
struct shutter_motion {
    double speed[6];
    // What is known of it without this picture, and how surely: inverse covariance, row-major.
    double expected[6], information[36];
};

// As a hand may move a camera of which nothing is known: 1 rad/s and 1 m/s, standard deviations.
struct shutter_motion shutter_motion_unknown(void);
// covariance: 6 x 6, positive definite; of `speed`. What is not finite or no camera's speed is not known.
struct shutter_motion shutter_motion_prior(const double speed[6], const double covariance[36]);

// When a row is read, seconds after the middle one. 0 where all rows are read at once.
double shutter_row_time(const struct lens *lens, double row);

// Where a point is for the camera at `time_s`, that is at `p` for it when the middle row is read (camera
// axes both). motion NULL: at p.
struct vec3 shutter_apply_motion(const struct shutter_motion *motion, double time_s, struct vec3 p);

// Where that point appears: in the row that is read when it is there. motion NULL: lens_project.
struct pixel shutter_project(const struct lens *lens, const struct shutter_motion *motion, struct vec3 p);
