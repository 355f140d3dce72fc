// The plain recognition of things that paper 001 (2.3) describes, kept as a yardstick: grey, edges, binary, scaled
// down, then matched over rotations (and sizes, which the paper keeps fixed), coarse to fine or exhaustively.
//
// The score of a placement is 2 |T and I| / (|T| + |I|), T the template's edge pixels and I the image's in its window
// (Dice 1945). Counting is in integers, 16 bytes at a time (vector extensions: SSE2, NEON), so that the result is the
// same everywhere. Pure; any thread may call.
#pragma once
#include "base/lens.h"

struct gray_picture {
    const uint8_t *gray; // width * height
    int width, height;
};

struct plain_options {
    double least_scale, most_scale, scale_step; // image pixels for one of the picture; the step is a factor
    double angle_step;                          // radians
    bool coarse_to_fine;                        // false: all placements at half the coarse reduction, the plain method
};
struct plain_options plain_default_options(void); // 0.2 to 1.2 by 1.2; 10 degrees; coarse to fine

struct plain_match {
    struct pixel middle; // of the picture, in the image
    double angle;        // radians, clockwise
    double scale, score;
};

// The best placement. ERR_MEMORY; NOTHING: the picture has no edges.
MUST_CHECK enum status plain_match_find(const struct gray_picture *picture, const struct gray_picture *image,
                                        const struct plain_options *options, struct plain_match *out);

// The number of set bytes (0 or 1) in both rows; the scalar form of what plain_match_find counts with, for tests:
// equal.
int plain_count_both(const uint8_t *a, const uint8_t *b, int n);
int plain_count_both_scalar(const uint8_t *a, const uint8_t *b, int n);
