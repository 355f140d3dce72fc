// Two-bone inverse kinematics in closed form (law of cosines): bends a limb so that its end reaches a target. Pure.
#pragma once
#include "capture/body/body_model.h"

// Rotates `segment` so that it runs along `direction` (camera axes), by the shortest rotation.
void body_aim_segment(const struct body_shape *shape, struct body_pose *pose, enum segment segment,
                      struct vec3 direction);

// Rotates the segment `upper` (an upper arm or a thigh) and the next so that the third one's origin, the wrist or the
// ankle, comes to `target`, or as near as the limb reaches, and the middle joint points to `pole`, a direction. Camera
// axes. Both by the shortest rotation from where they are. A target or pole that is not finite leaves the limb as it
// is.
void two_bone_ik(const struct body_shape *shape, struct body_pose *pose, enum segment upper, struct vec3 target,
                 struct vec3 pole);
