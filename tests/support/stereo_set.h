// Made-up sets of pairs for stereo calibration: a rig and what its cameras see of a board of circles, as
// stereo_circles_find gives it (centroids of whole discs, lattices with an arbitrary origin and quarter turn), without
// pictures. Lenses, baselines, boards, distances, tilts, noise and cut-off boards are drawn at random.
#pragma once
#include "capture/calibration/stereo_calibration.h"

enum { STEREO_SET_MOST_PAIRS = 20, STEREO_SET_MOST_CIRCLES = 130 };

struct stereo_set {
    struct stereo_rig rig; // the truth
    struct stereo_board board;
    int pairs, width, height;
    double noise_px; // standard deviation of each coordinate of a centroid
    double tilt_rad; // the board is turned by up to so much about its two axes
    struct stereo_view views[STEREO_SET_MOST_PAIRS];
    struct circle circles[STEREO_SET_MOST_PAIRS][2][STEREO_SET_MOST_CIRCLES];
    // The true place on the board of each circle: what a calibration by other means needs to be told.
    struct {
        int column, row;
    } place[STEREO_SET_MOST_PAIRS][2][STEREO_SET_MOST_CIRCLES];
};

// 8 to 20 pairs; at least half of them show the whole board to both cameras.
void stereo_set_make(struct stereo_set *set, uint64_t seed, int index);
