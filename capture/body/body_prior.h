// Priors of a pose before any image: joint limits, the usual pose, and smooth motion. Gaussian, in radians and metres;
// energies as in body_fit.h. Each adds to the normal equations of body_fit: h is FIT_COUNT x FIT_COUNT, row-major,
// lower triangle, g the right-hand side; both may be NULL. Pure.
#pragma once
#include "capture/body/body_fit.h"

// Joint limits and the neutral pose. Returns the energy.
double body_prior_joint_limits(const struct body_shape *shape, const struct body_pose *pose, double *h, double *g);

// The predicted pose; sigma scales its standard deviations. Returns the energy.
double body_prior_motion(const struct body_pose *pose, const struct body_pose *expected, double sigma, double *h,
                         double *g);
