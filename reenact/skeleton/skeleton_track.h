// A take's skeletons in the world, interpolated at any time of it. Immutable after opening, so any number of threads
// may read it. World axes: z up; the place's world, or without a place the camera's, rotated so that z is up for a
// camera held level.
//
// Memory: 4 bytes for each frame with a skeleton (it was 968: the skeletons themselves lie in the take's index and in
// take_skeletons, and are moved into the world when they are asked for).
#pragma once
#include "recording/recording.h"
#include "reenact/skeleton/bind_pose.h"

// ---------------------------------------------------------------- joint noise

// Standard deviation of the bones' poses as joints give them, estimated from a take: frames are registered to the model
// (articulated ICP) with a weak prior on the joints, and the root mean square of the corrections estimates the joints'
// error. Pure.

// Of each bone: root mean square error per axis of its midpoint, metres, and of its rotation vector, radians.
struct joint_noise {
    double m[BONE_COUNT], rad[BONE_COUNT];
};

// Prior, before frames of this take were registered: typical of skeleton trackers, chosen by hand.
struct joint_noise joint_noise_prior(void);

// Sums over frames; initially zeroed.
struct joint_noise_sum {
    double m2[BONE_COUNT], rad2[BONE_COUNT];
    int frames;
};
// correction: of each bone, from its joint pose to its registered pose, bind-pose axes. uncertainty: standard deviation
// of the registration, large for a bone that the frame does not show; its square is added.
void joint_noise_add(struct joint_noise_sum *sum, const struct bind_pose *bind,
                     const struct pose correction[BONE_COUNT], const struct joint_noise *uncertainty);
// Root mean squares, at most the prior and at least 3 mm and 0.03 rad; the prior after no frame.
struct joint_noise joint_noise_estimate(const struct joint_noise_sum *sum);

// ---------------------------------------------------------------- joint inpainting

// Fills joints that the tracker lost for a moment. The bone from a known joint to the lost one is kept as a vector in
// the upper torso's local frame (bind_pose.h) and interpolated linearly in time, direction and length apart, between
// the last frame before and the first after that know the bone; where only one side knows it, it is held. Method: our
// own. Pure; deterministic. take_skeletons_open computes it once for a take.

// No joint is inpainted farther than this from a frame that knows it. Chosen by hand.
#define INPAINT_MAX_GAP_NS 2000000000

// The frame's joints, in its colour camera's axes; inpainted ones have confidence 0.5 and a covariance that
// grows with the time to the frames that know them. Where the frame has no skeleton, or its upper torso is unknown, as
// recorded.
struct skeleton inpaint_skeleton(const struct take *take, int64_t frame);

// ---------------------------------------------------------------- take skeletons

// The skeletons of a take with inpainted joints, computed once when the take is opened for
// watching and shared by all who read them: skeleton_track, depth_frame and frame_layer. Immutable after opening, so
// any number of threads may read it.
//
// Memory: 8 bytes a frame and 640 bytes for each frame that has an inpainted joint; others use the take's own index.

struct take_skeletons;

// Borrows the take, which must outlive it. ERR_MEMORY; *out is then NULL.
MUST_CHECK enum status take_skeletons_open(struct take_skeletons **out, const struct take *take);
void take_skeletons_close(struct take_skeletons **s); // NULL is fine; sets *s = NULL

// Joints of one frame in its colour camera's axes, as inpaint_skeleton gives them. Valid until take_skeletons_close.
const struct skeleton *take_skeletons_at(const struct take_skeletons *skeletons, int64_t frame);

// ---------------------------------------------------------------- skeleton track

struct skeleton_track;

// Borrows the take and its skeletons, which must outlive it. Frames without a measured camera pose are left out if
// any frame has one. ERR_INPUT: no frame of the take has a skeleton, or a known joint is not finite. ERR_MEMORY. On
// failure *out is NULL.
MUST_CHECK enum status skeleton_track_open(struct skeleton_track **out, const struct take *take,
                                           const struct take_skeletons *skeletons);
void skeleton_track_close(struct skeleton_track **track); // NULL is fine; sets *track = NULL

struct track_sample {
    int64_t frame;                 // the recorded frame nearest in time
    struct skeleton skeleton;      // world axes, metres
    struct pose world_from_camera; // of the colour camera at `frame`
};

// time_ns: since the take's first frame. smooth: joints are interpolated linearly between the frames before and after,
// inpainted joints included, and their covariances with them; else they are as recorded in the
// nearest frame (the earlier one on a tie). NOTHING: more than half a second from any skeleton; *out is then unchanged.
MUST_CHECK enum status skeleton_track_at(const struct skeleton_track *track, int64_t time_ns, bool smooth,
                                         struct track_sample *out);
