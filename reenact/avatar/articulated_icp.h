// Lays the person's avatar on what one frame saw of it: joints are a few
// centimetres wrong, depth and the person's outline are not. Every bone may move
// and turn a little; parts that meet stay together, and what was not seen stays
// where the joints say. Pure.
#pragma once
#include "reenact/skeleton/joint_noise.h"
#include "reenact/avatar/tsdf.h"

// What turns the joints' transforms into the better one, in each bone's bind-pose axes.
struct bone_corrections {
    struct pose bone[BONE_COUNT]; // transforms = joints' transforms * corrections
};
struct bone_corrections bone_corrections_identity(void);
struct bone_transforms bone_corrections_apply(const struct bone_transforms *transforms,
                                              const struct bone_corrections *corrections);
struct bone_corrections bone_corrections_mix(const struct bone_corrections *a, const struct bone_corrections *b,
                                             double t);

// What is known of a frame before it is looked at.
struct icp_input {
    struct bone_transforms joints;   // that the frame's skeleton gives
    struct joint_noise joint_errors; // how far that may be wrong
    struct bone_corrections start;   // where to begin, for example the frame's before
    bool axial_fixed; // it has head and legs turned as colours have them (axial_rotation.h), and so they stay
};
// Of the tsdf's bind pose. uncertainty: how wrong bones may still be; NULL: nobody asks. The depth_frame's labels are
// used and made better.
struct bone_corrections articulated_icp(const struct tsdf *tsdf, struct depth_frame *depth_frame,
                                        const struct icp_input *from, struct joint_noise *uncertainty);

bool rotation_from_colors(int bone); // round: depth alone does not tell how it is turned about itself
