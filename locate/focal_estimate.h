// Whether a camera's focal length is what its calibration says, from the tags and points of images: near and far ones
// fit one pose together only with the right one. Newton's method on the pose solver's robust cost as a function of
// log(focal length), the pose refined at each value; the curvature is the information. Images are combined as
// independent normal measurements. Pure.
#pragma once
#include "locate/pose_solver.h"

// The estimate of log(true focal length / that of the calibration) from one or more images.
struct focal_estimate {
    double sum, information; // mean = sum / information, variance = 1 / information
    int frames;
};

// Adds an image; problem: of its pose, the first FOCAL_MAX_POINTS points are used, depth is not. Nothing changes where
// the image leaves the focal length undetermined, as when all lies in one plane parallel to the image.
enum { FOCAL_MAX_POINTS = 400 };
void focal_estimate_add(struct focal_estimate *estimate, const struct pose_problem *problem,
                        const struct pose *camera_from_world);

// The mean of the estimate combined with a prior of mean `before` and standard deviation *sigma, in the same unit.
// *sigma becomes that of the result.
double focal_estimate_posterior(const struct focal_estimate *estimate, double before, double *sigma);

// The calibration has been changed by `by` (logarithm): makes the estimate relative to the new one, and less certain,
// since images measured far from the right focal length are biased towards the one in use.
void focal_estimate_shift(struct focal_estimate *estimate, double by);

// True: the focal length is wrong, by more than noise and a map's own errors explain.
// *scale: the true one over the calibration's; 1 where nothing is known.
bool focal_estimate_is_wrong(const struct focal_estimate *estimate, double *scale);
