// Compares two poses of one frame, limb by limb. Both are judged after a fit with the same shape. Pure.
#pragma once
#include "capture/body/body_fit.h"
#include "capture/tracking/limb_pose.h"

// Energies (body_fit.h) of mixtures of two poses minus that of the frame's own pose: log-odds against them, the lower
// the likelier. Limbs that both poses have in the same place make no difference.
struct pose_log_odds {
    double pair[LIMB_COUNT / 2][2][2]; // arms, legs; [left][right], 1: as the other pose has it. [0][0] is 0
    double whole_body;                 // all of it as the other pose has it
};

// Uses the task's evidence, floor, shape and kernel; overwrites scratch->trial and scratch->other.
struct pose_log_odds pose_compare(const struct fit_task *task, const struct body_pose *own,
                                  const struct body_pose *other, struct fit_scratch *scratch);
