// The lens of one camera from pictures of a printed board, of circles or of chequers: as stereo_calibration.h
// calibrates one of a pair, and by hand for its reasons; OpenCV's findCirclesGrid wants the whole board, too. Of
// circles a part is enough; of chequers all inner corners have to be in sight. Pure but for memory.
#pragma once
#include "base/lens.h"
#include "capture/calibration/stereo_calibration.h"

// ---------------------------------------------------------------- readout

// The read-out time of a rolling shutter, from a camera that is swung left and right before a tag. Rows are exposed one
// after the other, so that a tag which moves through the picture is sheared; the shear grows with the speed.
//
// Method: least squares over the frames of one swing. A corner in row y of H is seen (y / (H - 1) - 1/2) readout_s
// after the middle row, and has moved by the tag's speed times that: top and bottom edge are displaced against each
// other by speed * readout_s * (height / (H - 1)). Perspective displaces them too, by what depends on where the tag is
// and not on how fast it moves; it is estimated along. Pure.

enum { READOUT_MAX_FRAMES = 600, READOUT_MIN_FRAMES = 30 };

struct readout_frame {
    double time_s;
    struct pixel
        corner[4]; // lens's distortion undone; as tag_detection: bottom left, bottom right, top right, top left
    int32_t id;
};

struct readout {
    struct lens lens;
    struct readout_frame frames[READOUT_MAX_FRAMES];
    int count;
};

// A frame with a tag, corners in pixels of the image; of several tags give the largest, always the same one.
void readout_add(struct readout *readout, double time_s, int32_t id, const struct pixel corner[4]);

struct readout_report {
    int frames;
    double fastest_px_per_s;
    double rms_px;  // what is left of the shear
    double sigma_s; // standard deviation
    double bend_px; // the largest shear that was seen because of the read-out
};
// ERR_INPUT with the reason: too few frames, swung too slowly, only one way, not fitting. *readout_s from 0.
MUST_CHECK enum status readout_solve(const struct readout *readout, double *readout_s, struct readout_report *report);

// ---------------------------------------------------------------- lens calibration

enum { LENS_MIN_VIEWS = 6, LENS_MAX_VIEWS = 40 };

struct lens_calibration {
    struct stereo_board board; // of chequers: its inner corners
    bool chequers;
    int width, height;
    struct circle *circles; // of all views, one after the other; corners are circles without an area
    int first[LENS_MAX_VIEWS + 1];
    int views, frames;
};

// Of circles; set `chequers` afterwards for a board of these.
void lens_calibration_start(struct lens_calibration *calibration, const struct stereo_board *board, int width,
                            int height);
void lens_calibration_free(struct lens_calibration *calibration);

// One picture, RGB. *used: it shows the board, and differs from the last one used by a thirtieth of the picture's
// width. ERR_MEMORY, ERR_SOLVER.
MUST_CHECK enum status lens_calibration_add(struct lens_calibration *calibration, const uint8_t *rgb, bool *used);

struct lens_report {
    int views, circles;
    double rms_px, max_px;
    double focal_sigma;    // relative, of fx and fy
    double sigma_mm_per_m; // what it does to a length of a metre, seen frontally
};
// ERR_INPUT with the reason; ERR_SOLVER, ERR_MEMORY. *lens: readout_s and focal_sigma 0, as of a measured lens.
MUST_CHECK enum status lens_calibration_solve(const struct lens_calibration *calibration, struct lens *lens,
                                              struct lens_report *report);
