// The same calibration by OpenCV (calibrateCamera of each camera, then stereoCalibrate of all together), which shares
// nothing with capture/calibration. It is told the true place of each circle, which a user's board does not say.
#pragma once
#include "tests/support/stereo_set.h"

#ifdef __cplusplus
extern "C" {
#endif

struct opencv_rig {
    struct lens lens[2];          // left, right
    double right_from_left[3][4]; // rotation and translation
    double rms_px;                // of both cameras together
};

// ERR_SOLVER: OpenCV refused.
MUST_CHECK enum status stereo_by_opencv(const struct stereo_set *set, struct opencv_rig *rig);

#ifdef __cplusplus
}
#endif
