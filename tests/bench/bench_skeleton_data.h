// Input of the stage "skeleton": depth, grey and some colour images with true joints.
#pragma once
#include "base/lens.h"
#include "recording/skeleton.h"

enum { SKELETON_LOOK_EVERY = 3 }; // body points are looked for in every third image, as recorder.c does

struct skeleton_frame {
    int64_t time_ns;
    uint16_t *depth;
    uint8_t *gray;
    uint8_t *color;        // RGB, of every SKELETON_LOOK_EVERY-th frame; NULL of the others
    struct skeleton truth; // camera axes
};

struct skeleton_data {
    struct calibration calibration;
    struct skeleton_frame *frame;
    int count;
};

// folder NULL: renders `filmed` frames of the small world. Else a folder with its truth in truth/ or ../truth:
// joints_truth.csv in world axes and sensor_truth.txt. At most 300 frames are read. On error *data is empty.
MUST_CHECK enum status skeleton_data_open(struct skeleton_data *data, const char *folder, int filmed);
void skeleton_data_close(struct skeleton_data *data);
