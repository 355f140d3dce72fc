// Finds 33 points of one person's body in a colour image, with pre-trained networks: BlazePose (Bazarevsky et al.
// 2020), as the npm package @mediapipe/pose ships it (Apache-2.0; tools/models fetches and checks it). A detector finds
// the person in the whole image; a second network finds the points in a rotated square about them; the next image's
// square comes from these points, so that the detector runs only at the start and after a loss.
//
// The points are evidence, not truth: 7.7 px off in the mean of an actor 250 px tall, with visibility above 0.9 now
// and then where left and right are swapped, and invented where the body leaves the image. Deterministic: the same
// images in the same order give the same bits on every machine.
#pragma once
#include "base/geometry.h"

enum pose_point_name {
    POSE_NOSE,
    POSE_LEFT_EYE_INNER,
    POSE_LEFT_EYE,
    POSE_LEFT_EYE_OUTER,
    POSE_RIGHT_EYE_INNER,
    POSE_RIGHT_EYE,
    POSE_RIGHT_EYE_OUTER,
    POSE_LEFT_EAR,
    POSE_RIGHT_EAR,
    POSE_MOUTH_LEFT,
    POSE_MOUTH_RIGHT,
    POSE_LEFT_SHOULDER,
    POSE_RIGHT_SHOULDER,
    POSE_LEFT_ELBOW,
    POSE_RIGHT_ELBOW,
    POSE_LEFT_WRIST,
    POSE_RIGHT_WRIST,
    POSE_LEFT_PINKY,
    POSE_RIGHT_PINKY,
    POSE_LEFT_INDEX,
    POSE_RIGHT_INDEX,
    POSE_LEFT_THUMB,
    POSE_RIGHT_THUMB,
    POSE_LEFT_HIP,
    POSE_RIGHT_HIP,
    POSE_LEFT_KNEE,
    POSE_RIGHT_KNEE,
    POSE_LEFT_ANKLE,
    POSE_RIGHT_ANKLE,
    POSE_LEFT_HEEL,
    POSE_RIGHT_HEEL,
    POSE_LEFT_TOE,
    POSE_RIGHT_TOE,
    POSE_POINTS
};

struct pose_point {
    double x_px, y_px; // the centre of the top-left pixel is (0, 0); may lie outside the image
    double z_px;       // towards the camera negative, from the hips' middle, in about the same scale
    double visibility; // 0..1: not hidden
    double presence;   // 0..1: inside the image
};

struct pose_points {
    double score; // 0..1: that the square holds a person
    struct pose_point point[POSE_POINTS];
};

struct pose_network;

// LITE was 7.7 px off in the mean on such an actor; FULL has about twice the multiply-adds.
enum pose_network_size { POSE_NETWORK_LITE, POSE_NETWORK_FULL };

// folder: where the networks' files lie; NULL: where reenact-capture models --fetch puts them. ERR_MISSING: they are
// not there, with a sentence that says how to get them; ERR_FORMAT, ERR_IO, ERR_MEMORY. A process with LITE open peaked
// at 106 MiB, with FULL at 134 MiB. One thread at a time.
MUST_CHECK enum status pose_network_open(struct pose_network **out, const char *folder, enum pose_network_size size);
void pose_network_close(struct pose_network **network); // NULL is fine; sets *network = NULL

// The points of the person in the next image; rgb: width x height, 3 bytes a pixel. NOTHING: no person was found.
MUST_CHECK enum status pose_network_find(struct pose_network *network, const uint8_t *rgb, int width, int height,
                                         struct pose_points *out);

// The next image has nothing to do with the last: the detector looks at all of it.
void pose_network_restart(struct pose_network *network);
