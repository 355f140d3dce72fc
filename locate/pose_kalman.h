// A camera's pose and how it moves, with what is known of both: each new pose is
// weighed against where the motion so far leads. A camera in a hand keeps its speed
// along its own axes but for small jerks, so one that walks steadily round a person is
// followed without lag, and one that stands still comes to rest. Pure.
#pragma once
#include "base/geometry.h"

enum { POSE_KALMAN_STATE = 12 }; // turn, shift; turn and shift each second: all in the camera's axes

struct pose_kalman {
    struct pose world_from_camera;
    double speed[6];                                         // turn (rad/s), then shift (m/s)
    double covariance[POSE_KALMAN_STATE][POSE_KALMAN_STATE]; // of small errors of the above
};

// Starts at a pose, at rest as far as known. covariance: 6 x 6 as in locator.h, row-major.
void pose_kalman_start(struct pose_kalman *k, struct pose world_from_camera, const double covariance[36]);

// Moves on by `seconds` > 0.
void pose_kalman_predict(struct pose_kalman *k, double seconds);

// Takes in a pose that was measured independently. Returns its squared distance from
// the expected one in standard deviations (six numbers: 6 in the mean); above `most` (or NaN)
// nothing changes.
double pose_kalman_update(struct pose_kalman *k, struct pose world_from_camera, const double covariance[36],
                          double most);
