// Whether a body that was fitted to a component of a depth image can be a person. Pure; camera axes, metres.
#pragma once
#include "capture/body/body_fit.h"

// Whether what was fitted can be a person: furniture leaves points off the body, takes a body of impossible size, is
// flat, or looks like a part of a body that the image's edge cuts off.
bool is_like_person(const struct depth_evidence *evidence, const struct fit_result *fit);
