// The lens of one camera from pictures of a printed board, of circles or of chequers: as stereo_calibration.h
// calibrates one of a pair, and by hand for its reasons; OpenCV's findCirclesGrid wants the whole board, too. Of
// circles a part is enough; of chequers all inner corners have to be in sight. Pure but for memory.
#pragma once
#include "capture/calibration/stereo_calibration.h"

enum { LENS_LEAST_VIEWS = 6, LENS_MOST_VIEWS = 40 };

struct lens_calibration {
    struct stereo_board board; // of chequers: its inner corners
    bool chequers;
    int width, height;
    struct circle *circles; // of all views, one after the other; corners are circles without an area
    int first[LENS_MOST_VIEWS + 1];
    int views, frames;
};

// Of circles; set `chequers` afterwards for a board of these.
void lens_calibration_start(struct lens_calibration *c, const struct stereo_board *board, int width, int height);
void lens_calibration_free(struct lens_calibration *c);

// One picture, RGB. *used: it shows the board, and differs from the last one used by a thirtieth of the picture's
// width. ERR_MEMORY, ERR_SOLVER.
MUST_CHECK enum status lens_calibration_add(struct lens_calibration *c, const uint8_t *rgb, bool *used);

struct lens_report {
    int views, circles;
    double rms_px, max_px;
    double focal_sigma;    // relative, of fx and fy
    double sigma_mm_per_m; // what it does to a length of a metre, seen frontally
};
// ERR_INPUT with the reason; ERR_SOLVER, ERR_MEMORY. *lens: readout_s and focal_sigma 0, as of a measured lens.
MUST_CHECK enum status lens_calibration_solve(const struct lens_calibration *c, struct lens *lens,
                                              struct lens_report *report);
