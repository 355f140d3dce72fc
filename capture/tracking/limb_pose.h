// Moves limbs from one pose of a body to another. Pure; camera axes, metres.
#pragma once
#include "capture/body/body_model.h"

// Distance that a limb's middle joint or its end moved, whichever is more.
double limb_moved_m(int limb, const struct body_build *from, const struct body_build *to);
// Copies a limb's rotations against their parents.
void limb_copy(int limb, const struct body_pose *from, struct body_pose *to);
// Puts a limb of `to` where `from` has it in camera axes, as far as it reaches from its own trunk: a trunk a little
// beside the other must not carry the limb with it.
void limb_transfer(int limb, const struct body_shape *shape, const struct body_build *from, struct body_pose *to);
