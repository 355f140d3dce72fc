// How far a camera that is followed may have drifted, and what a look at the map says
// against it. From picture to picture, what is followed says to a millimetre how the
// camera moved, but errors add up. Where the map has the camera is off by more, does not
// drift, and is off by much the same from one picture to the next, as long as the same tags
// and points are in sight: the second look at them says nothing new. So the error of the
// map's pose is carried along beside that of the camera's, and only as far as what is in
// sight changes is the camera moved towards where the map has it. A tag that comes
// into sight or leaves it does not make the pose jump. Pure.
#pragma once
#include "base/status.h"

// Errors are small motions as in locator.h's covariance: six numbers, matrices row-major.
struct pose_fusion {
    double covariance[12][12]; // of the camera's error, then of the map's
    double camera_error[6];    // expected: what is known of it and not yet corrected
    double map_error[6];       // the same of the map's
    double map_covariance[36]; // of the map's pose in the last picture, by itself
};

// What one picture says.
struct pose_measurement {
    double drift[36];           // by how much more the followed pose errs than in the last picture
    double map_covariance[36];  // of the map's pose, by what is in sight now
    double map_information[36]; // the part of its information that was in sight in the last picture too
    double noise[36];           // of this picture alone
    double offset[6];           // from the followed pose to the map's
};

// At the map's pose.
void pose_fusion_start(struct pose_fusion *a, const double map_covariance[36], const double noise[36]);

// by: the small motion to be made now. A correction is spread over a few pictures, so that nobody
// sees the camera jump. False: the numbers allow none, nothing changed.
bool pose_fusion_update(struct pose_fusion *a, const struct pose_measurement *measurement, double by[6]);

// Of the pose after that, with what is known to be left of its error.
void pose_fusion_covariance(const struct pose_fusion *a, double covariance[36]);
