// Whether an avatar that was read from a file can be drawn: every number that something is looked up by is in range,
// and every other one is finite and one that a person's model can have. Not its TSDF, which tsdf_store.h checks. Pure.
#pragma once
#include "reenact/avatar/avatar.h"

bool avatar_is_sound(const struct avatar *avatar, const struct take *take); // of that take
