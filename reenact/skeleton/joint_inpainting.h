// Fills joints that the tracker lost for a moment. The bone from a known joint to the lost one is kept as a vector in
// the upper torso's local frame (bone_frame.h) and interpolated linearly in time, direction and length apart, between
// the last frame before and the first after that know the bone; where only one side knows it, it is held. Method: our
// own. Pure; deterministic. take_skeletons.h computes it once for a take.
#pragma once
#include "recording/recording.h"

// No joint is inpainted farther than this from a frame that knows it. Chosen by hand.
#define INPAINT_MAX_GAP_NS 2000000000

// The frame's joints, in its colour camera's axes; inpainted ones have confidence 0.5 and a covariance that
// grows with the time to the frames that know them. Where the frame has no skeleton, or its upper torso is unknown, as
// recorded.
struct skeleton inpaint_skeleton(const struct take *take, int64_t frame);
