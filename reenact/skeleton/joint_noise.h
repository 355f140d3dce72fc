// Standard deviation of the bones' poses as joints give them, estimated from a take: frames are registered to the model
// (articulated ICP) with a weak prior on the joints, and the root mean square of the corrections estimates the joints'
// error. Pure.
#pragma once
#include "reenact/skeleton/bind_pose.h"

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
