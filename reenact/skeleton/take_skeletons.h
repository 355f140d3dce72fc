// The skeletons of a take with inpainted joints (joint_inpainting.h), computed once when the take is opened for
// watching and shared by all who read them: skeleton_track, depth_frame and frame_layer. Immutable after opening, so
// any number of threads may read it.
//
// Memory: 8 bytes a frame and 640 bytes for each frame that has an inpainted joint; others use the take's own index.
#pragma once
#include "recording/recording.h"

struct take_skeletons;

// Borrows the take, which must outlive it. ERR_MEMORY; *out is then NULL.
MUST_CHECK enum status take_skeletons_open(struct take_skeletons **out, const struct take *take);
void take_skeletons_close(struct take_skeletons **s); // NULL is fine; sets *s = NULL

// Joints of one frame in its colour camera's axes, as inpaint_skeleton gives them. Valid until take_skeletons_close.
const struct skeleton *take_skeletons_at(const struct take_skeletons *s, int64_t frame);
