// The least squares of stereo_calibration.h: lenses, the pose between the cameras and the boards' poses together.
#pragma once
#include "capture/calibration/stereo_calibration.h"

struct disc_sighting {
    int camera, board; // camera 0: left, 1: right
    double x_m, y_m;   // the disc's centre on the board
    struct pixel at;   // measured centroid
    bool outlier;      // left out
};

struct stereo_bundle {
    struct lens lens[2];
    struct pose camera_from_left[2]; // the first is the identity and stays
    struct pose *left_from_board;    // boards
    int boards;
    struct disc_sighting *seen;
    int count;
    double radius_m; // of a disc
};

enum { BUNDLE_LENS = 8, BUNDLE_POSE = 6, BUNDLE_SHARED = 2 * BUNDLE_LENS + BUNDLE_POSE };

// The centroid of the disc's image. False: it is behind the camera.
bool stereo_predict(const struct stereo_bundle *bundle, const struct disc_sighting *sighting, struct pixel *out);

// The sum over the sightings of Huber's function of their distances, pixels^2; 1e30 with one behind its camera.
double stereo_bundle_cost(const struct stereo_bundle *bundle);

// One of the BUNDLE_SHARED unknowns moved by `step`.
void stereo_bundle_move(struct stereo_bundle *bundle, int unknown, double step);

// Levenberg-Marquardt with Huber weights until it stops improving, leaving out gross outliers once:
// base/least_squares.h over all unknowns, dense, for a calibration has some dozens of boards. `covariance`, where not
// NULL: BUNDLE_SHARED^2 doubles in the order fx, fy, cx, cy, k1, k2, p1, p2 of left and of right, turn and shift of
// camera_from_left[1]; scaled by the residuals' variance. ERR_MEMORY, ERR_SOLVER.
MUST_CHECK enum status stereo_bundle_solve(struct stereo_bundle *bundle, double *covariance);
