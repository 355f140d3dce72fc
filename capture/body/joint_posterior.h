// How well a fit knows the joints: the covariance of their positions that follows from the information matrix of the
// pose (Gauss-Newton posterior, the Laplace approximation: covariance = J H^-1 J', J the derivative of a joint by the
// pose). The shape is taken as known. H counts points by patches (body_fit.c) and holds the priors of the pose and its
// motion, so it says what this frame and the prediction allow, not how wrong the model is. Camera axes, metres. Pure.
#pragma once
#include "capture/body/body_fit.h"

// build: of the pose at which `information` was read. What nothing determines has a standard deviation of some 30 m or
// radians. False: the information is not positive semidefinite; `out` is then undefined.
MUST_CHECK bool find_joint_posteriors(const struct body_build *build, const struct pose_information *information,
                                      struct covariance3 out[JOINT_COUNT]);
