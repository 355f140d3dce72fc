// How wrong bones may be. What a take's joints are worth is measured: frames are laid on the shape with little trust in
// them, and how far bones come to lie from where the joints have them says how far these err. Pure.
#pragma once
#include "reenact/skeleton/bind_pose.h"

// Of each bone, root mean squares: its middle, metres along any axis, and how it is turned, radians about any.
struct joint_noise {
    double m[BONE_COUNT], rad[BONE_COUNT];
};

// As skeleton trackers err, before anything is known of this take's.
struct joint_noise joint_noise_prior(void);

// What the frames have said so far; zeroed at first.
struct joint_noise_sum {
    double m2[BONE_COUNT], rad2[BONE_COUNT];
    int frames;
};
// correction: of each bone, from where the joints have it to where it came to lie, its bind-pose axes. uncertainty: how
// wrong that may still be, which is much for a bone that the frame does not show.
void joint_noise_add(struct joint_noise_sum *sum, const struct bind_pose *bind,
                     const struct pose correction[BONE_COUNT], const struct joint_noise *uncertainty);
// No more than at first, and never nothing.
struct joint_noise joint_noise_estimate(const struct joint_noise_sum *sum);
