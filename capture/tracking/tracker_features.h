// What the last frame says about how wrong each joint may be (joint_error.h).
#pragma once
#include "capture/tracking/joint_error.h"
#include "capture/tracking/tracker_internal.h"

// After the frame is committed and its joints were looked for. Carries the running mean of the energy on.
void tracker_find_features(struct tracker *tracker, const struct tracked_frame *frame,
                           struct joint_features out[JOINT_COUNT]);
