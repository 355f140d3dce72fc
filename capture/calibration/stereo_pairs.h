// Which pairs of pictures show one board at one instant, and the pose between the cameras on which they agree.
//
// Method: each pair that shows the whole board to both cameras proposes the pose between them, once for each of the
// board's equal quarter turns; the proposal under which the most other pairs' circles lie where they were seen wins
// (Fischler and Bolles 1981, with all proposals instead of random ones). Pure; any thread may call.
#pragma once
#include "capture/calibration/stereo_calibration.h"

struct stereo_pairs {
    const struct stereo_board *board;
    const struct stereo_view *views; // count
    int count;
    struct lens lens[2];                     // each calibrated by itself
    const bool *seen[2];                     // of each view: its board has a pose
    const struct pose *camera_from_board[2]; // of each view that is seen; the board's axes are those of its own lattice
};

// What takes the right camera's lattice of view `right` to the left one's of view `left`, given the pose between the
// cameras: one of the lattice's own motions.
struct pose stereo_pairs_motion(const struct stereo_pairs *pairs, int left, int right, struct pose right_from_left);

// *right_from_left, and for each view whether its two pictures belong together under it. *agreeing: how many do, of
// *comparable that both cameras saw. ERR_INPUT with a sentence: no pair shows the whole board to both cameras, or most
// pairs do not belong together.
MUST_CHECK enum status stereo_pairs_agree(const struct stereo_pairs *pairs, struct pose *right_from_left, bool *belongs,
                                          int *agreeing, int *comparable);
