// What is told of a pose: steady where the body stands still, as fast as the
// body where it moves, and never jumping.
//
// Every picture's fit trembles by millimetres; while a limb stays within that, it
// is held and moves only slowly to the mean of the fits. As soon as the fits drift
// away together, or move, it follows them, the more the faster. The past counts,
// the future does not.
#pragma once
#include "capture/body_model.h"

struct body_steady {
    struct body_pose pose;          // as told last
    struct vec3 fit[JOINT_COUNT];   // of the last frame; x is NaN before the second
    struct vec3 drift[JOINT_COUNT]; // how far the fits of the last frames were from what was told, mean
    struct vec3 speed[JOINT_COUNT]; // of the fits, mean, m/s
};

void body_steady_start(struct body_steady *s, const struct body_pose *pose);
// The next frame's fit, `passed_s` later; s->pose is then what to tell.
void body_steady_next(struct body_steady *s, const struct body_shape *shape, const struct body_pose *pose,
                      double passed_s);
