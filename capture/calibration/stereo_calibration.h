// Two cameras fixed to each other, calibrated from pairs of pictures of a printed board of circles.
//
// Method: each camera by itself from homographies (Zhang 2000) and Levenberg-Marquardt; then the pose between the two;
// then all of it together. Each residual is the centroid of a whole disc's image (seven-point quadrature with the
// projection's area weights), because the image of a circle's centre is not the centroid of its image (Heikkila 2000).
// Boards may be cut off: which of the lattice's equal places a camera saw follows from the other camera.
// Pure but for memory; any thread may call.
#pragma once
#include "capture/calibration/stereo_circles.h"

struct stereo_board {
    int columns, rows;
    double pitch_m; // between the centres of neighbours
};

struct stereo_rig {
    struct lens left, right;
    struct pose left_from_right;
};

// What the two cameras saw of the board at one instant, by stereo_circles_find; count 0: nothing.
struct stereo_view {
    const struct circle *circles[2]; // left, right
    int count[2];
};

struct stereo_report {
    int views;                   // pairs used for the pose between the cameras
    int boards[2];               // pictures used, left, right
    int circles[2];              // circles used
    double rms_px[2], max_px[2]; // reprojection error: root of the mean squared distance, largest distance
    double baseline_m, baseline_sigma_m;
    double focal_sigma; // relative, the largest of both cameras' fx and fy
};

enum { STEREO_LEAST_VIEWS = 4 };

// width, height: of all pictures. ERR_INPUT with a sentence: too few boards, or all from one side; ERR_SOLVER;
// ERR_MEMORY. On error nothing is written.
MUST_CHECK enum status stereo_calibrate(const struct stereo_board *board, const struct stereo_view *views, int count,
                                        int width, int height, struct stereo_rig *rig, struct stereo_report *report);
