// Two cameras fixed to each other, calibrated from pairs of pictures of a printed board of circles.
//
// Method: each camera by itself from homographies (Zhang 2000) and Levenberg-Marquardt; then the pose between the two
// on which the pairs agree (stereo_rig.h); then all of it together. Each residual is the centroid of a whole disc's
// image (seven-point quadrature with the projection's area weights), because the image of a circle's centre is not the
// centroid of its image (Heikkila 2000). Boards may be cut off: which of the lattice's equal places a camera saw
// follows from the other camera. Pure but for memory; any thread may call.
//
// By hand, because OpenCV 4.6 takes the image of a centre for the centroid of a disc, and is told which circle is
// which. On 400 drawn sets of pairs (tests/capture/test_stereo_sets 200 of seeds 11 and 12) OpenCV, told that, is right
// as often (always), with a mean error of the focal lengths of 0.118 % against 0.097 % here. Its stereoCalibrate gives
// no covariance, and says nothing of pairs shuffled, exchanged or of two instants (stereo_calibration.c).
#pragma once
#include "base/lens.h"
#include "base/linear_algebra.h"

// ---------------------------------------------------------------- stereo circles

// Dark circles of a printed board in a grey image: their centres to a few hundredths of a pixel and their places in the
// board's lattice. The board may be cut off by the image's edge; a circle that touches the edge is left out.
//
// Method: pixels darker than their surroundings (box mean of an integral image), connected components, ellipses by
// second moments, centroids weighted by darkness; the lattice grows from a circle with four regular neighbours. Pure;
// any thread may call.

struct circle {
    struct pixel at; // centroid of the image of the disc, pixels; not the image of its centre
    double area_px;  // pixels^2
    int column, row; // lattice: (row's axis) lies clockwise of (column's axis) in the image; the origin is arbitrary
};

enum { STEREO_MAX_CIRCLES = 1024 };

// gray: width * height bytes. Writes the largest lattice found, at most STEREO_MAX_CIRCLES circles, lattice
// coordinates from 0 on; *count is their number, 0 for none. ERR_MEMORY.
MUST_CHECK enum status stereo_circles_find(const uint8_t *gray, int width, int height, struct circle *out, int *count);

// ---------------------------------------------------------------- stereo calibration

struct stereo_board {
    int columns, rows;
    double pitch_m; // between the centres of neighbours
};

struct stereo_rig {
    struct lens left, right;
    struct pose left_from_right;
    // What the calibration's error does to a point that it locates 1 m straight ahead, left camera's axes, m^2. At z
    // metres it is z^2 of that across and z^4 along the line of sight. 0: not known.
    struct covariance3 error_at_1m;
};

// What the two cameras saw of the board at one instant, by stereo_circles_find; count 0: nothing.
struct stereo_view {
    const struct circle *circles[2]; // left, right
    int count[2];
    const char *name; // of both pictures, for sentences; NULL: the number of the pair
};

// How well one camera's lens explains what it saw.
struct stereo_fit {
    int circles;           // used
    double outliers;       // the share that was left out
    double rms_px, max_px; // reprojection error: root of the mean squared distance, largest distance; of those used
    double focal_sigma;    // relative, the larger of fx and fy; INFINITY: they cannot be told from these pictures
};

struct stereo_report {
    int views;                   // pairs used for the pose between the cameras
    int boards[2];               // pictures used, left, right
    int circles[2];              // circles used
    double rms_px[2], max_px[2]; // reprojection error: root of the mean squared distance, largest distance
    double baseline_m, baseline_sigma_m;
    double focal_sigma; // relative, the largest of both cameras' fx and fy
    int left_out;       // pairs whose two pictures do not belong together
    char warning[256];  // a sentence; "" where all is well
};

enum { STEREO_MIN_VIEWS = 4, STEREO_MAX_PAIRS = 512 };

// width, height: of all pictures. ERR_INPUT with a sentence that names the likely cause: too few boards, boards that
// stand still or are turned too little, a lens that does not fit, pictures that do not belong together; ERR_SOLVER;
// ERR_MEMORY. On error nothing is written.
MUST_CHECK enum status stereo_calibrate(const struct stereo_board *board, const struct stereo_view *views, int count,
                                        int width, int height, struct stereo_rig *rig, struct stereo_report *report);

// The lens of the left camera alone. Errors: as above.
MUST_CHECK enum status stereo_calibrate_one(const struct stereo_board *board, const struct stereo_view *views,
                                            int count, int width, int height, struct lens *lens,
                                            struct stereo_fit *fit);
