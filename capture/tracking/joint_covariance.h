// The covariance of a tracked joint's position, put together from terms that can be calibrated one by one.
//
//     covariance = scale (fit + floor + hidden + absent)
//
// fit     what the frame's evidence and the prediction leave open (joint_posterior.h)
// floor   what no evidence of one frame removes: the sensor's bias, cloth, and where the model has the joint in the
//         body; more along the camera's ray, where only a surface is seen, than across it
// hidden  grows while the joint is not seen: a random walk that the body's reach bounds (Ornstein-Uhlenbeck),
//         m2 (1 - exp(-rate t / m2)) after t seconds
// absent  of a joint outside the image, or never seen: nothing but the usual pose says where it is
// scale   what else the frame says for or against the pose, calibrated (joint_error.h)
//
// The terms are taken as independent; their constants are chosen by hand. Depth camera's axes, metres. Pure.
#pragma once
#include "capture/body/body_model.h"

// What the tracker knows of a joint beside the fit.
struct joint_sight {
    bool seen_ever;
    double hidden_s;       // since it was last seen; 0: it is seen
    double out_of_image_s; // since it left the image; 0: it is within
};

struct joint_uncertainty_terms {
    struct covariance3 fit, floor;
    double hidden_m2, absent_m2; // variances per axis
    double scale;                // of their sum; 1: as they are
};

struct joint_uncertainty_terms joint_uncertainty(enum joint joint, struct vec3 position, const struct covariance3 *fit,
                                                 const struct joint_sight *sight);
struct covariance3 joint_uncertainty_sum(const struct joint_uncertainty_terms *terms);

// Of the point (1 - share) a + share b between two estimates of one joint: both covariances, mixed as the points are,
// which bounds their mean's whatever the correlation, and 2 share (1 - share) of the squared disagreement: a half at
// the midpoint, which is the variance of either where they err independently.
struct covariance3 joint_merge_covariance(const struct covariance3 *a, const struct covariance3 *b,
                                          struct vec3 disagreement, double share);
