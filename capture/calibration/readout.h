// The read-out time of a rolling shutter, from a camera that is swung left and right before a tag. Rows are exposed one
// after the other, so that a tag which moves through the picture is sheared; the shear grows with the speed.
//
// Method: least squares over the frames of one swing. A corner in row y of H is seen (y / (H - 1) - 1/2) readout_s
// after the middle row, and has moved by the tag's speed times that: top and bottom edge are displaced against each
// other by speed * readout_s * (height / (H - 1)). Perspective displaces them too, by what depends on where the tag is
// and not on how fast it moves; it is estimated along. Pure.
#pragma once
#include "base/lens.h"

enum { READOUT_MOST_FRAMES = 600, READOUT_LEAST_FRAMES = 30 };

struct readout_frame {
    double time_s;
    struct pixel
        corner[4]; // lens's distortion undone; as tag_detection: bottom left, bottom right, top right, top left
    int32_t id;
};

struct readout {
    struct lens lens;
    struct readout_frame frames[READOUT_MOST_FRAMES];
    int count;
};

// A frame with a tag, corners in pixels of the image; of several tags give the largest, always the same one.
void readout_add(struct readout *r, double time_s, int32_t id, const struct pixel corner[4]);

struct readout_report {
    int frames;
    double fastest_px_per_s;
    double rms_px;  // what is left of the shear
    double sigma_s; // standard deviation
    double bend_px; // the largest shear that was seen because of the read-out
};
// ERR_INPUT with the reason: too few frames, swung too slowly, only one way, not fitting. *readout_s from 0.
MUST_CHECK enum status readout_solve(const struct readout *r, double *readout_s, struct readout_report *report);
