// A take's skeletons in the world, interpolated at any time of it. Immutable after opening, so any number of threads
// may read it. World axes: z up; the place's world, or without a place the camera's, rotated so that z is up for a
// camera held level.
//
// Memory: 4 bytes for each frame with a skeleton (it was 968: the skeletons themselves lie in the take's index and in
// take_skeletons, and are moved into the world when they are asked for).
#pragma once
#include "reenact/skeleton/take_skeletons.h"

struct skeleton_track;

// Borrows the take and its skeletons, which must outlive it. Frames without a measured camera pose are left out if
// any frame has one. ERR_INPUT: no frame of the take has a skeleton, or a known joint is not finite. ERR_MEMORY. On
// failure *out is NULL.
MUST_CHECK enum status skeleton_track_open(struct skeleton_track **out, const struct take *take,
                                           const struct take_skeletons *skeletons);
void skeleton_track_close(struct skeleton_track **m); // NULL is fine; sets *m = NULL

struct track_sample {
    int64_t frame;                 // the recorded frame nearest in time
    struct skeleton skeleton;      // world axes, metres
    struct pose world_from_camera; // of the colour camera at `frame`
};

// time_ns: since the take's first frame. smooth: joints are interpolated linearly between the frames before and after,
// inpainted joints (joint_inpainting.h) included, and their covariances with them; else they are as recorded in the
// nearest frame (the earlier one on a tie). NOTHING: more than half a second from any skeleton; *out is then unchanged.
MUST_CHECK enum status skeleton_track_at(const struct skeleton_track *m, int64_t time_ns, bool smooth,
                                         struct track_sample *out);
