// Constant-velocity Kalman filter of a camera's pose: each measured pose is weighed against the prediction. The process
// noise is white acceleration along the camera's own axes (a hand-held camera keeps its velocity but for small jerks),
// so a camera that walks steadily round a person is tracked without lag, and one that stands still comes to rest. The
// errors are on the manifold: world_from_camera <- world_from_camera exp(d) (error-state filter). Pure.
#pragma once
#include "base/geometry.h"

// Order of the state: rotation (radians), translation (metres), angular velocity (rad/s), linear velocity (m/s), each
// x, y, z, all in camera axes.
enum { POSE_KALMAN_STATE = 12 };

struct pose_kalman {
    struct pose world_from_camera;
    double velocity[6]; // angular, then linear
    double covariance[POSE_KALMAN_STATE][POSE_KALMAN_STATE];
};

// Starts at a pose, at rest as far as known. covariance: 6 x 6 as in locate/locator.h, row-major.
void pose_kalman_start(struct pose_kalman *k, struct pose world_from_camera, const double covariance[36]);

// Predicts `seconds` > 0 ahead.
void pose_kalman_predict(struct pose_kalman *k, double seconds);

// Updates by an independently measured pose. Returns its squared Mahalanobis distance from the prediction (six degrees
// of freedom: 6 in the mean); above `most` (or NaN) nothing changes.
double pose_kalman_update(struct pose_kalman *k, struct pose world_from_camera, const double covariance[36],
                          double most);
