// Tag corners to a few hundredths of a pixel: the tag's whole pattern, blurred as
// the lens blurs it, is fitted to the picture (8 numbers of a homography, blur,
// black, white and its slope), so that every edge of the tag has its say, not
// only the rim.
//
// It is done on linear light: edges found in gamma-encoded values move into the
// black, and a tag 25 pixels wide comes out 2 % small. It is done on the ideal
// picture behind the lens's distortion, where edges are straight.
#pragma once
#include "platform/tag_detector.h"

struct tag_refiner; // scratch memory; belongs to one thread

// Copies `lens`. ERR_MEMORY.
MUST_CHECK enum status tag_refiner_open(struct tag_refiner **out, const struct lens *lens);
void tag_refiner_close(struct tag_refiner **r); // NULL is fine; sets *r = NULL

// A tag in a picture.
struct tag_observation {
    int32_t id;
    struct vec3 ray[4];       // the corners on the plane z = 1, distortion undone; order of place.h
    double information[8][8]; // inverse covariance of (fx ray.x, fy ray.y), corner by corner; 1 / pixel^2
    double correlation;       // squared correlation of picture and pattern, 0..1
    double time_s[4];         // when each corner's row was read, as shutter_row_time
};

// rgb: of the lens's size. corner: a first idea, within about half a cell of the
// tag; pixels as the picture has them, distorted. False, *out untouched: the
// pattern is not there, or only a sliver of it.
bool tag_refine(struct tag_refiner *r, const uint8_t *rgb, int32_t id, const struct tag_pattern *pattern,
                const struct pixel corner[4], struct tag_observation *out);

// The same from at most so many of the tag's pixels, for one whose corners are known to a
// pixel: a tenth of the time, corners half as sure.
bool tag_refine_sampled(struct tag_refiner *r, const uint8_t *rgb, int32_t id, const struct tag_pattern *pattern,
                        const struct pixel corner[4], int most_pixels, struct tag_observation *out);

// BT.601 luma, for the tag finder.
void gray_from_rgb(const uint8_t *rgb, size_t pixels, uint8_t *gray);
