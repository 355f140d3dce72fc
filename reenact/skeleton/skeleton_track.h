// A take's movement as skeletons in the world, at any time of it. Pure; borrows
// the take, which must outlive it.
#pragma once
#include "capture/recording/recording.h"

struct skeleton_track;

// Frames whose pose was not measured are left out; where none was, because the
// take has no place, the world is the camera's own, turned so that z is up.
// ERR_INPUT: no frame of the take has a skeleton, or a known joint is not finite. ERR_MEMORY.
MUST_CHECK enum status skeleton_track_open(struct skeleton_track **out, const struct take *take);
void skeleton_track_close(struct skeleton_track **m);

struct track_sample {
    int64_t frame;                 // the recorded frame nearest in time
    struct skeleton skeleton;      // world axes
    struct pose world_from_camera; // of the colour camera at `frame`
};

// time_ns: since the take's first frame. smooth: joints between the frames before
// and after, linearly, with limbs that were lost for a moment (reenact/skeleton/joint_inpainting.h); else
// as recorded in the nearest frame (the earlier one on a tie). NOTHING: more than half a second from any skeleton.
MUST_CHECK enum status skeleton_track_at(const struct skeleton_track *m, int64_t time_ns, bool smooth,
                                         struct track_sample *out);
