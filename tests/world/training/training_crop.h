// The square about a person that a body network looks at, cut out of a training image. Internal to tests/world.
#pragma once
#include "tests/world/training/training_image.h"

enum { CROP_CELLS = 96 };

// Little-endian, back to back, as training-images --crops writes it.
struct training_crop {
    uint16_t depth[CROP_CELLS * CROP_CELLS]; // mm; 0: no reading, or outside of the image
    uint8_t part[CROP_CELLS * CROP_CELLS];   // as training_image's
    float joint[JOINT_COUNT][4];             // camera axes, metres, and confidence as training_image's
    float left_px, top_px, cell_px; // cell (i, j)'s middle: pixel left_px + cell_px * (i + 0.5) - 0.5, and so on
    float fx, fy, cx, cy;
    float middle_m; // what counts as depth 0: the median of the person's readings; without a person, their lower third
    float facing_rad, cut, hidden;
    uint8_t person, sensor, posture, unused;
};

// tools/train_body reads it so, without padding.
static_assert(sizeof(struct training_crop) == 3 * CROP_CELLS * CROP_CELLS + 4 * (4 * JOINT_COUNT + 11) + 4, "a record");

// About what is seen of the person, or most of it, 1.04 to 1.3 times as large and up to 6 % aside; without a person
// about any place, as large as a person would be there. Some squares are about furniture, beside a person or not.
// False: too little of the person is seen to be learnt from, but it is in the picture; or nothing was read there.
bool training_crop_make(const struct training_scene *scene, const struct training_image *image,
                        struct training_crop *out);
