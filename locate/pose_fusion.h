// Fuses the frame-to-frame pose of a tracked camera with the map's pose of it.
//
// The frame-to-frame pose is precise to a millimetre but drifts. The map's pose, from the tags and landmarks in view,
// has larger errors that do not drift and are correlated from image to image, as long as the same tags and landmarks
// are in view: seeing them a second time adds no information. Therefore the error of the map's pose is part of the
// state. A tag that comes into view or leaves it does not make the pose jump.
//
// Model: a Kalman filter with state (c, m), the errors of the tracked pose and of the map's pose, with a 12 x 12
// covariance. Prediction: c gains the drift; m' = A m + w with A = P I_shared, where P is the covariance of the map's
// pose now and I_shared that part of its information that was also in the last image; w makes the covariance of m'
// equal to P (coloured measurement noise by state augmentation, as in Bar-Shalom, Li & Kirubarajan 2001). Measurement:
// the difference of the two poses, offset = c + m + noise.
//
// Errors are small motions T <- exp(d) T of camera_from_world, so in camera axes. Order of the 6-vectors, as in
// locate/locator.h: rotation (radians), translation (metres). 6 x 6 matrices are row-major. Pure.
#pragma once
#include "base/geometry.h"
#include "base/status.h"

// ---------------------------------------------------------------- pose kalman

// Constant-velocity Kalman filter of a camera's pose: each measured pose is weighed against the prediction. The process
// noise is white acceleration along the camera's own axes (a hand-held camera keeps its velocity but for small jerks),
// so a camera that walks steadily round a person is tracked without lag, and one that stands still comes to rest. The
// errors are on the manifold: world_from_camera <- world_from_camera exp(d) (error-state filter). Pure.

// Order of the state: rotation (radians), translation (metres), angular velocity (rad/s), linear velocity (m/s), each
// x, y, z, all in camera axes.
enum { POSE_KALMAN_STATE = 12 };

struct pose_kalman {
    struct pose world_from_camera;
    double velocity[6]; // angular, then linear
    double covariance[POSE_KALMAN_STATE][POSE_KALMAN_STATE];
};

// Starts at a pose, at rest as far as known. covariance: 6 x 6 as in locate/locator.h, row-major.
void pose_kalman_start(struct pose_kalman *kalman, struct pose world_from_camera, const double covariance[36]);

// Predicts `seconds` > 0 ahead.
void pose_kalman_predict(struct pose_kalman *kalman, double seconds);

// Updates by an independently measured pose. Returns its squared Mahalanobis distance from the prediction (six degrees
// of freedom: 6 in the mean); above `max` (or NaN) nothing changes.
double pose_kalman_update(struct pose_kalman *kalman, struct pose world_from_camera, const double covariance[36],
                          double max);

// ---------------------------------------------------------------- pose fusion

struct pose_fusion {
    double covariance[12][12]; // of (camera_error, map_error)
    double camera_error[6];    // expected error of the tracked pose that is not yet corrected
    double map_error[6];       // expected error of the map's pose
    double map_covariance[36]; // of the map's pose in the last image, by itself
};

// What one image contributes.
struct pose_measurement {
    double drift[36];           // covariance that the tracked pose gained since the last image
    double map_covariance[36];  // of the map's pose, by what is in view now
    double map_information[36]; // that part of its information that was also in view in the last image
    double noise[36];           // covariance of what is independent from image to image
    double offset[6];           // from the tracked pose to the map's
};

// Starts with the tracked pose at the map's pose.
void pose_fusion_start(struct pose_fusion *fusion, const double map_covariance[36], const double noise[36]);

// by: the motion by which the caller must now correct the tracked pose. A correction is spread over several images, so
// that no jump is visible. False: the covariances are not positive definite (or not finite); nothing changed.
bool pose_fusion_update(struct pose_fusion *a, const struct pose_measurement *measurement, double by[6]);

// The covariance of the corrected pose about the truth, including the expected error that is left.
void pose_fusion_covariance(const struct pose_fusion *fusion, double covariance[36]);
