// What is told of a pose: steady where the body stands still, as fast as the
// body where it moves, and never jumping.
//
// Every picture's fit trembles, by millimetres near the sensor and more farther off. How
// much, is measured as it goes, joint by joint. What is told goes towards a fit by a
// share that follows from how far off that is against the trembling: within it, little, so that
// many fits are averaged; well beyond it, all the way at once. The past counts, the future does not.
#pragma once
#include "capture/body/body_model.h"

struct pose_filter {
    struct body_pose pose;           // as told last
    struct vec3 joint[JOINT_COUNT];  // the same, metres
    struct vec3 fit[2][JOINT_COUNT]; // of the last frame and the one before
    int fits;                        // so many there were, at most 1000
    double jitter_m2[JOINT_COUNT];   // of the fits, variance in all three directions together
    struct vec3 speed[JOINT_COUNT];  // of the fits, mean, m/s
};

void pose_filter_start(struct pose_filter *s, const struct body_shape *shape, const struct body_pose *pose);
// The next frame's fit, `dt_s` later; s->pose is then what to tell.
void pose_filter_update(struct pose_filter *s, const struct body_shape *shape, const struct body_pose *pose,
                        double dt_s);
