// Alternative poses that explain a depth image as well: a limb elsewhere, the body facing the other way, legs
// exchanged. Candidates come from unexplained points by two-bone IK; each is refined by a few iterations of body_fit
// and judged by its energy, so that gains are log-odds. Pure; camera axes, metres.
#pragma once
#include "capture/body/body_fit.h"

// Fit results are large; the caller provides the memory. In all functions `best` holds this frame's fit.
struct fit_scratch {
    struct fit_result best, trial, other;
    double other_rate; // of pose_restart
};

// The robust kernel with which poses are compared: wide, so that points that are left unexplained count. Chosen by
// hand.
#define SEARCH_KERNEL_M 0.12

// Tries other places for limbs that leave points unexplained or stand in free space, and keeps the likeliest, for up to
// two limbs. Returns how many limbs moved.
int limb_search(const struct fit_task *task, struct fit_scratch *scratch);

// Fits one limb elsewhere into scratch->trial: to points that the rest of the body does not explain, whether this limb
// explained them so far or, a little worse, the trunk. Returns the energy gained, negative where the other place has
// more energy or there is none.
double limb_alternative_log_odds(const struct fit_task *task, int limb, struct fit_scratch *scratch);

// Fits the body that faces the other way into scratch->trial. Returns the energy gained, negative where it has more.
double flipped_log_odds(const struct fit_task *task, struct fit_scratch *scratch);

// The same for the body with its feet exchanged, as in legs_swapped_pose.
double legs_swapped_log_odds(const struct fit_task *task, struct fit_scratch *scratch);

struct body_pose legs_swapped_pose(const struct fit_result *best);

// Distance that a limb's middle joint or its end moved, whichever is more.
double limb_moved_m(int limb, const struct body_build *from, const struct body_build *to);
// Copies a limb's rotations against their parents.
void limb_copy(int limb, const struct body_pose *from, struct body_pose *to);
// Puts a limb of `to` where `from` has it in camera axes, as far as it reaches from its own trunk: a trunk a little
// beside the other must not carry the limb with it.
void limb_transfer(int limb, const struct body_shape *shape, const struct body_build *from, struct body_pose *to);
