// What is known of a pose before any picture: how far joints turn, and that a
// body goes on moving as it did. Adds to the normal equations of body_fit:
// h is FIT_COUNT x FIT_COUNT, row-major, lower triangle; both may be NULL.
#pragma once
#include "capture/body/body_fit.h"

// Limits and the rest pose. Returns the energy.
double body_prior_joint_limits(const struct body_shape *shape, const struct body_pose *pose, double *h, double *g);

// The pose expected from the motion; sigma widens what is allowed.
double body_prior_motion(const struct body_pose *pose, const struct body_pose *expected, double sigma, double *h,
                         double *g);
