// Lays the person's likeness on what one frame saw of it: joints are a few
// centimetres wrong, depth and the person's outline are not. Every bone may move
// and turn a little; parts that meet stay together, and what was not seen stays
// where the joints say. Pure.
#pragma once
#include "reenact/skeleton/joint_noise.h"
#include "reenact/avatar/tsdf.h"

// What turns the joints' posture into the better one, in each bone's rest axes.
struct adjustment {
    struct pose bone[BONE_COUNT]; // posture = joints' posture * adjustment
};
struct adjustment adjustment_none(void);
struct posture posture_adjusted(const struct posture *posture, const struct adjustment *adjustment);
struct adjustment adjustment_mix(const struct adjustment *a, const struct adjustment *b, double t);

// What is known of a frame before it is looked at.
struct align_from {
    struct posture joints;           // that the frame's skeleton gives
    struct bone_errors joint_errors; // how far that may be wrong
    struct adjustment start;         // where to begin, for example the frame's before
    bool turned; // it has head and legs turned as colours have them (axial_rotation.h), and so they stay
};
// Of the volume's rest pose. unsure: how wrong bones may still be; NULL: nobody asks. The sight's labels are used and
// made better.
struct adjustment align(const struct volume *volume, struct sight *sight, const struct align_from *from,
                        struct bone_errors *unsure);

bool turned_by_colors(int bone); // round: depth alone does not tell how it is turned about itself
