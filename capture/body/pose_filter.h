// Causal pose filter: the online estimate, smooth while the body stands still and without lag while it moves.
//
// Every frame's fit has jitter, of millimetres near the sensor and more far from it. Its variance is measured online,
// joint by joint, from the second differences of the fits. The gain of trunk and limbs follows from the innovation
// against that noise and from the speed: an innovation within the noise is averaged over many fits, one well beyond it
// is followed immediately (an exponential filter with adaptive gain). Joint speed is bounded. Noise
// and speed are averaged over fixed times, so that the frame rate hardly matters. Pure; camera axes, metres.
#pragma once
#include "capture/body/body_model.h"

struct pose_filter {
    struct body_pose pose;           // filtered
    struct vec3 joint[JOINT_COUNT];  // its joints
    struct vec3 fit[2][JOINT_COUNT]; // joints as fitted in the last frame and the one before
    int fits;                        // number so far, at most 1000
    double jitter_m2[JOINT_COUNT];   // variance of the fits' noise, all three directions together
    struct vec3 speed[JOINT_COUNT];  // mean of the fits', m/s
};

void pose_filter_start(struct pose_filter *filter, const struct body_shape *shape, const struct body_pose *pose);
// Takes the next frame's fit, `dt_s` > 0 later; filter->pose is then the filtered pose.
void pose_filter_update(struct pose_filter *filter, const struct body_shape *shape, const struct body_pose *pose,
                        double dt_s);
