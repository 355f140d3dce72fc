// The pose between a sensor's colour and depth cameras, from discs that both show: black discs that stand some
// centimetres off a white board. In colour they are dark, in depth they are nearer than the board.
//
// Method: paper "Free-viewpoint Mobile Robot Teleoperation Interface" (Okura et al.), section 3.2: the 3D centroid of a
// marker by depth corresponds to its centre in the colour image, and the pose follows from the perspective-n-point
// problem over all views; here both centres are found without a hand, and the problem is solved by
// Levenberg-Marquardt (base/least_squares.h) with Huber weights. The discs' places on the board need not be known, only
// their lattice. Pure but for memory.
#pragma once
#include "base/lens.h"

struct disc_board {
    int columns, rows; // default 4, 3
    double radius_m;   // of a disc; default 0.04
    double standoff_m; // of the discs from the board; default 0.05
};
struct disc_board disc_board_default(void);

struct color_depth_point {
    struct vec3 depth_axes; // metres
    struct pixel color;
};

struct color_depth {
    struct calibration calibration; // the lenses; color_from_depth is where the search starts
    struct disc_board board;
    struct color_depth_point *points;
    int count, capacity;
    int frames, views;               // given, and with the whole board in both images
    int no_color, no_depth, too_far; // frames without the board in colour; in colour only; with discs too small
    double nearest_m, farthest_m;    // of the discs
};

enum color_depth_seen { DISCS_BOTH, DISCS_NOT_IN_COLOR, DISCS_NOT_IN_DEPTH, DISCS_TOO_FAR };

// ERR_INPUT: a lens is missing. Copies.
MUST_CHECK enum status color_depth_start(struct color_depth *color_depth, const struct calibration *calibration,
                                         const struct disc_board *board);
void color_depth_free(struct color_depth *depth);

// One frame: RGB and millimetres. ERR_MEMORY.
MUST_CHECK enum status color_depth_add(struct color_depth *color_depth, const uint8_t *rgb, const uint16_t *depth,
                                       enum color_depth_seen *seen);

struct color_depth_report {
    int views, points;
    double rms_px, rms_mm;      // reprojection, and what that is at the discs' mean depth
    double sigma_mm, sigma_deg; // of the pose, by its covariance: the largest of its three axes
    double shift_mm, turn_deg;  // from where the search started
};
enum { COLOR_DEPTH_MIN_VIEWS = 6 };

// ERR_INPUT with the reason: too few views, the board too far away, colour and depth that do not belong together, views
// that do not fix the pose. ERR_SOLVER. *color_from_depth is written on OK only.
MUST_CHECK enum status color_depth_solve(const struct color_depth *color_depth, struct pose *color_from_depth,
                                         struct color_depth_report *report);
