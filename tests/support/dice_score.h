// How wrong the tracked skeletons of random films are, over all frames or those of one cause. Pure.
#pragma once
#include "tests/support/dice_film.h"

// Where the truth's body model and ours differ by a constant: the mean error of each joint over all films, in the axes
// of the true trunk or pelvis (body_axes.h), over joints that are visible, claimed and less than DICE_WRONG_M
// off. What is left without it ("less") is how the joint moves.
struct dice_rig {
    struct vec3 constant[JOINT_COUNT];
};
struct dice_rig dice_rig_of(const struct dice_film *films, int count, enum dice_mode mode);

#define DICE_WITHIN_M  0.10
#define DICE_WRONG_M   0.15
#define DICE_WITHIN_95 7.815 // squared Mahalanobis distance: chi-square of three degrees of freedom

// Which frames count; has NULL: all.
struct dice_group {
    bool (*has)(const struct dice_film *film, const struct dice_frame *frame, int value);
    int value;
};

// Exchanged sides, by frame. A pair's error is the sum over its joints with each side at its own, or at the other's
// true position; the sides are swapped where the second sum is less than half the first, all joints are claimed, and
// its sides lie apart: the mean distance between the true left and right joints is above 15 cm.
enum dice_swap {
    DICE_SWAP_ARMS, // elbows and hands
    DICE_SWAP_LEGS, // knees and feet
    DICE_SWAP_BODY, // shoulders and hips: the body faces the other way
    DICE_SWAPS
};
bool dice_is_swapped(const struct skeleton *got, const struct skeleton *truth, enum dice_swap swap);

// Of one joint in one frame.
struct dice_joint {
    struct vec3 off_m, less_off_m; // tracked minus true, camera axes; the same without the rig's constant
    double error_m, less_m;        // their lengths
    double mahalanobis2;           // of less_off_m, by the joint's covariance
    float confidence;              // 0: unknown; the rest is then of no use, or 0 where there is no person
};
struct dice_joint dice_joint_of(const struct dice_frame *frame, enum dice_mode mode, enum joint j,
                                const struct dice_rig *rig);

// Shares in percent; NaN where nothing counts. Frames count in which at least half of the joints can be seen at all
// (dice_can_be_seen); but `ghosts`.
struct dice_measure {
    int films, frames;
    double lost;           // frames without a person
    double ghosts;         // frames with a person among those in which no joint can be seen
    double followed_other; // frames with a passer-by in which the skeleton is nearer to them than to the actor
    // A film's mean over the claimed joints (confidence above 0) that can be seen at all; over films the mean and the
    // geometric mean; and the mean without the rig's constant.
    double mean_mm, geometric_mm, less_mm;
    // Mean absolute error of the angles at elbows, shoulders (to the trunk's side), hips (likewise) and knees whose
    // three joints are claimed and can be seen at all.
    double angle_degrees;
    // Claimed and less than 10 cm off, of those that can be seen at all, of those hidden by the own body, of all.
    double within_seen, within_hidden, within_all;
    double swapped[DICE_SWAPS], swapped_any; // of frames with a person
    double sure_wrong;                       // more than 15 cm off, of joints with confidence 1
    double guessed_wrong;                    // the same of those with a confidence between 0 and 1
    double sure, guessed, unknown;           // joints by confidence, in frames with a person
    // Inside the 95 % ellipsoid of the joint's covariance, without the rig's constant: of joints with confidence 1, and
    // of those with one between 0 and 1.
    double sure_inside, guessed_inside;
};
struct dice_measure dice_measure_of(const struct dice_film *films, int count, enum dice_mode mode,
                                    const struct dice_rig *rig, struct dice_group group);

// A frame has a person when any joint is claimed.
bool dice_has_person(const struct skeleton *s);
