// How wrong bones may be. What a take's joints are worth is measured: frames are laid on the shape with little trust in
// them, and how far bones come to lie from where the joints have them says how far these err. Pure.
#pragma once
#include "reenact/skeleton/bind_pose.h"

// Of each bone, root mean squares: its middle, metres along any axis, and how it is turned, radians about any.
struct bone_errors {
    double m[BONE_COUNT], rad[BONE_COUNT];
};

// As skeleton trackers err, before anything is known of this take's.
struct bone_errors joint_errors_at_first(void);

// What the frames have said so far; zeroed at first.
struct bone_errors_sum {
    double m2[BONE_COUNT], rad2[BONE_COUNT];
    int frames;
};
// adjusted: of each bone, from where the joints have it to where it came to lie, its rest axes. unsure: how wrong that
// may still be, which is much for a bone that the frame does not show.
void joint_errors_add(struct bone_errors_sum *sum, const struct rest *rest, const struct pose adjusted[BONE_COUNT],
                      const struct bone_errors *unsure);
// No more than at first, and never nothing.
struct bone_errors joint_errors_of(const struct bone_errors_sum *sum);
