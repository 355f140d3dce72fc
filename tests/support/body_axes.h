// The axes of the part of a body that a joint belongs to: where a body model puts its joints within the body is
// constant in these.
#pragma once
#include "recording/skeleton.h"

// `v` in the axes of the true trunk or pelvis, whichever joint `j` hangs on: x to the person's left, y down, z forward.
struct vec3 in_body_axes(const struct skeleton *truth, enum joint j, struct vec3 v);
// The reverse: a vector in those axes, in the axes of the skeleton.
struct vec3 from_body_axes(const struct skeleton *truth, enum joint j, struct vec3 v);
