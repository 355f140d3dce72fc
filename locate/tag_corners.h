// Tag corners to a few hundredths of a pixel: an image model of the tag's whole pattern (locate/tag_model.h:
// homography, blur, black, white and its gradient) is fitted to the pixels by Levenberg-Marquardt
// (base/least_squares.h), so that every edge of the tag contributes, not only the rim.
//
// The fit is in linear light: edges found in gamma-encoded values move into the black, and a tag 25 pixels wide is
// measured 2 % too small. It is in ideal coordinates without the lens's distortion, where edges are straight.
//
// Deterministic; one handle belongs to one thread. It holds 8 bytes a pixel of the image and about 320 KiB.
#pragma once
#include "platform/vision/tag_detector.h"

struct tag_refiner;

// Copies `lens`. ERR_MEMORY: *out is NULL.
MUST_CHECK enum status tag_refiner_open(struct tag_refiner **out, const struct lens *lens);
void tag_refiner_close(struct tag_refiner **refiner); // NULL is fine; sets *refiner = NULL

// A tag in an image.
struct tag_observation {
    int32_t id;
    struct vec3 ray[4];       // the corners on the plane z = 1, distortion undone; order of place.h
    double information[8][8]; // inverse covariance of (fx ray.x, fy ray.y), corner by corner; 1 / pixel^2
    double correlation;       // squared correlation of image and pattern, 0 .. 1
    double time_s[4];         // when each corner's row was read, as shutter_row_time
};

// rgb: of the lens's size, 8 bits, sRGB. corner: approximate, within about half a cell of the tag; pixels of the image,
// distorted. False, *out untouched: the pattern is not there, or too little of it.
bool tag_refine(struct tag_refiner *refiner, const uint8_t *rgb, int32_t id, const struct tag_pattern *pattern,
                const struct pixel corner[4], struct tag_observation *out);

// A tag that should be in the image.
struct tag_candidate {
    int32_t id;
    const struct tag_pattern *pattern; // borrowed
    struct pixel corner[4];
};

// The same from about so many of the tag's pixels at most, for a tag whose corners are known to a pixel: a tenth of the
// time, twice the standard deviation.
bool tag_refine_sampled(struct tag_refiner *refiner, const uint8_t *rgb, const struct tag_candidate *candidate,
                        int max_pixels, struct tag_observation *out);

// BT.601 luma of 8-bit RGB, for the tag detector and features.
void gray_from_rgb(const uint8_t *rgb, size_t pixels, uint8_t *gray);
// The picture turned over left to right, in place. gray: width * height bytes.
void gray_mirror(uint8_t *gray, int width, int height);
