// The pictures of a sweep, kept until their poses are known, so that things can be looked for in them afterwards.
//
// Memory: at most SWEEP_PICTURES_MOST pictures: the JPEG of each, and its depth at half the resolution (0.15 MB at
// 640 x 480). Of a long sweep every second, fourth … is kept, counted from the first, as the mapper does.
#pragma once
#include "objects/thing_depth.h"
#include "platform/sensors/source.h"

enum { SWEEP_PICTURES_MOST = 240 };

struct sweep_picture {
    int64_t time_ns;
    uint8_t *jpeg;
    size_t jpeg_bytes;
    uint16_t *depth;  // of sweep_pictures.depth_lens; NULL: none
    double sharpness; // share of the image's contrast that is between neighbouring pixels
};

struct sweep_pictures {
    struct calibration calibration; // of the source
    struct lens depth_lens;         // of the pictures' depth; width 0: there is none
    struct sweep_picture pictures[SWEEP_PICTURES_MOST];
    int count;
    int64_t seen, stride; // frames with colour; of which every stride'th is kept
};

void sweep_pictures_start(struct sweep_pictures *s, const struct calibration *calibration);
void sweep_pictures_free(struct sweep_pictures *s); // zeroed is fine

// Copies what it needs. ERR_MEMORY.
MUST_CHECK enum status sweep_pictures_add(struct sweep_pictures *s, const struct frame *frame);

// Sharp enough to look for things: not blurred by motion, against the sharpest of the pictures just before and after.
bool sweep_picture_is_sharp(const struct sweep_pictures *s, int picture);
