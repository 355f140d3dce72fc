// The files of stereo calibration: a folder of pairs with board.json, and a rig's rig.json.
//
// board.json: {"columns": 10, "rows": 7, "pitch_m": 0.02, "pattern": "circles"}. rig.json: {"left": {"K": 3 x 3 rows,
// "distortion": [k1, k2, p1, p2, k3]}, "right": {...}, "left_from_right": 4 x 4 rows, "width": 640, "height": 480,
// "error_at_1_m": [xx, xy, xz, yy, yz, zz]};
// without width and height: 640 x 480, or what the pictures have.
#pragma once
#include "capture/calibration/stereo_calibration.h"
#include "capture/calibration/stereo_pairs.h"

// Finds the circles in all pairs of `folder` (left/NAME and right/NAME beside board.json) and calibrates. *pairs: how
// many there are, at most 512. ERR_MISSING, ERR_IO, ERR_INPUT, ERR_CORRUPT, ERR_MEMORY, ERR_SOLVER.
MUST_CHECK enum status stereo_calibrate_folder(const char *folder, struct stereo_rig *rig, struct stereo_report *report,
                                               int *pairs);

// ERR_INPUT: not a rig, or its cameras are more than 100 m apart. ERR_MISSING, ERR_IO, ERR_MEMORY.
MUST_CHECK enum status stereo_rig_read(const char *path, struct stereo_rig *rig);

// The text of rig.json; the caller frees it; NULL: no memory.
char *stereo_rig_print(const struct stereo_rig *rig);
