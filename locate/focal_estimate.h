// Whether a camera's focal length is what its calibration says, from the tags and points
// of a picture: near ones and far ones fit together only with the right one. Pure.
#pragma once
#include "locate/pose_solver.h"

// What one or more pictures say of log(true focal length / that of the calibration).
struct focal_estimate {
    double sum, information; // mean = sum / information, variance = 1 / information
    int frames;
};

// Adds what a picture says; depth is not asked. motion: of a rolling shutter, or NULL. points: at most
// FOCAL_MAX_POINTS are used. Nothing changes where the picture leaves the focal length open: all of one plane,
// head-on.
enum { FOCAL_MAX_POINTS = 400 };
void focal_estimate_add(struct focal_estimate *f, const struct pnp_tag *tags, int count, const struct pnp_point *points,
                        int point_count, double fx, double fy, const struct shutter_motion *motion,
                        const struct pose *camera_from_world);

// What the pictures say together with what was known before, log(focal length / that of the calibration) =
// `before`, give or take `sigma`. *sigma becomes how unsure the answer is.
double focal_estimate_posterior(const struct focal_estimate *f, double before, double *sigma);

// The calibration has been changed by `by` (as above): what was said of the old one, of the new one. Not to be
// trusted to the last: how the pictures answer depends on how far off they are asked.
void focal_estimate_shift(struct focal_estimate *f, double by);

// True: the focal length is wrong, by more than noise and a map's own errors explain.
// *scale: the true one over the calibration's; 1 where nothing is known.
bool focal_estimate_is_wrong(const struct focal_estimate *f, double *scale);
