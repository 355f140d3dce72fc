// Articulated ICP: registers the avatar to one depth frame. Every bone may move and rotate; adjacent bones stay
// together at their joints; what the frame does not show stays where the joints have it.
//
// Method: Gauss-Newton with Geman-McClure weights, eight iterations, on one sum of squares without unit (each residual
// divided by its standard deviation):
//   depth       point to TSDF, along its gradient (as point-to-plane ICP);
//   silhouette  viewing rays along the silhouette touch the shape (deformation.h);
//   links       the two sides of a joint are as far apart as the skeleton has them;
//   priors      the joints' transforms, within joint_errors; the start's; axial rotation from colours, if given.
// Unknowns, six to a bone: translation x, y, z (metres), then rotation vector x, y, z (radians), both in the colour
// camera's axes, about the bone's middle. The normal equations (96 x 96) are solved by Cholesky decomposition.
//
// No threads, no memory of its own but 110 KiB of stack; cannot fail; deterministic.
#pragma once
#include "reenact/avatar/tsdf.h"
#include "reenact/skeleton/skeleton_track.h"

// Corrects the joints' transforms, in each bone's bind-pose axes.
struct bone_corrections {
    struct pose bone[BONE_COUNT]; // transforms = joints' transforms * corrections
};
struct bone_corrections bone_corrections_identity(void);
struct bone_transforms bone_corrections_apply(const struct bone_transforms *transforms,
                                              const struct bone_corrections *corrections);
// Interpolates: t = 0: a, 1: b.
struct bone_corrections bone_corrections_mix(const struct bone_corrections *a, const struct bone_corrections *b,
                                             double t);

// What is known of a frame before it is registered.
struct icp_input {
    struct bone_transforms joints;   // from the frame's skeleton
    struct joint_noise joint_errors; // standard deviations of these
    struct bone_corrections start;   // initial value, for example the previous frame's
    bool axial_fixed; // start has the axial rotations that colours gave (axial_rotation.h), which are kept; half of the
                      // iterations suffice then
};
// The depth frame is relabelled by the result on the way. uncertainty: standard deviations of each bone's translation
// and rotation, from the inverse normal equations; may be NULL.
struct bone_corrections articulated_icp(const struct tsdf *tsdf, struct depth_frame *depth_frame,
                                        const struct icp_input *from, struct joint_noise *uncertainty);

// Whether a bone is so round that depth does not tell its axial rotation and colours are used.
bool rotation_from_colors(int bone);
