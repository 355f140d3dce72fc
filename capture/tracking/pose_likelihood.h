// Two poses that a picture may mean, weighed limb by limb.
#pragma once
#include "capture/tracking/limb_hypotheses.h"

// What a picture has against another pose and against the one that was fitted to it: differences of energies as in
// body_fit.h, the lower the likelier. Of limbs that are in the same place either choice has as much against it.
struct pose_log_odds {
    double pair[LIMB_COUNT / 2][2][2]; // arms, legs; [left][right], 1: as the other pose has it. [0][0] is 0
    double whole_body;                 // with all of it as the other pose has it
};

// The task's evidence, floor, shape and reach are used; scratch->trial and scratch->other are overwritten.
struct pose_log_odds pose_compare(const struct fit_task *task, const struct body_pose *own,
                                  const struct body_pose *other, struct fit_scratch *scratch);
