// Bending a limb so that it ends where it shall.
#pragma once
#include "capture/body/body_model.h"

// Turns `segment` so that it runs along `direction` (camera axes), with as little twist as can be.
void body_aim_segment(const struct body_shape *shape, struct body_pose *pose, enum segment segment,
                      struct vec3 direction);

// Turns the segment `upper` (an upper arm or a thigh) and the next so that the third one's
// origin, the wrist or the ankle, comes to `target`, or as near as the limb reaches, and the
// middle joint bulges to `pole`, a direction. Camera axes. Both turn with as little twist as
// can be from where they are.
void two_bone_ik(const struct body_shape *shape, struct body_pose *pose, enum segment upper, struct vec3 target,
                 struct vec3 pole);
