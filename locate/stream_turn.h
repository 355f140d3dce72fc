// Whether one of a sensor's two streams is mirrored or upside down against the other: what stands before something else
// has an edge in colour where depth has a step, and in a picture that is turned it has not.
//
// Method: across each step of the depth image, taken as it is and in the three other ways, the colour image's gradient
// is compared with those beside it. Its rank among them is one half on average where depth and colour have nothing to
// do with each other, and more where they show the same. Both streams turned alike cannot be told from none, and which
// of the two is turned cannot be told either.
#pragma once
#include "base/lens.h"

enum depth_turn { DEPTH_STRAIGHT, DEPTH_MIRRORED, DEPTH_FLIPPED, DEPTH_TURNED, DEPTH_TURNS }; // flipped: top to bottom

// Which of the two pictures is turned; of a calibration whose depth is registered it makes no difference.
enum stream_picture { STREAM_DEPTH, STREAM_COLOR, STREAM_PICTURES };

// What was seen so far; zero-initialised: nothing.
struct stream_turn {
    // Of colour's gradients at depth's steps if that picture were turned so: each image's mean, 0 to 1, summed.
    double rank[STREAM_PICTURES][DEPTH_TURNS];
    int images; // that have steps enough
};

// One frame of a sensor with both lenses. ERR_MEMORY.
MUST_CHECK enum status stream_turn_add(struct stream_turn *stream_turn, const struct calibration *calibration,
                                       const uint8_t *color, const uint16_t *depth);

// How depth is turned against colour. DEPTH_STRAIGHT also where that is not clear.
enum depth_turn stream_turn_judge(const struct stream_turn *stream_turn);

// "mirrored", "upside down", "upside down and mirrored".
const char *depth_turn_text(enum depth_turn turn);
