// The usual alternatives for recognising a thing by a picture: OpenCV's ORB with a homography by RANSAC, and its
// matchTemplate over rotations and sizes. Grey images.
#pragma once
#include "tests/bench/plain_matching.h"

#ifdef __cplusplus
extern "C" {
#endif

// The picture's middle in the image. NOTHING: fewer than `least` inliers.
enum status orb_peer_find(const struct gray_picture *picture, const struct gray_picture *image, int least,
                          struct pixel *middle);

// In images of a quarter of the size. *score: normalised correlation.
enum status template_peer_find(const struct gray_picture *picture, const struct gray_picture *image,
                               const struct plain_options *options, struct pixel *middle, double *score);

#ifdef __cplusplus
}
#endif
