// A lower leg that the other leg occludes but for its toe: where the shin sticks out of the silhouette, it is rotated
// about its knee to where it does not. Pure; camera axes, metres.
#pragma once
#include "capture/body/body_fit.h"

// Log-odds against a lower leg's place for sticking out of the silhouette (silhouette_cost.h), beyond what the fit's
// energy counts; 0 in a skirt. leg: of the limbs, 2 or 3.
double shin_outside_log_odds(const struct fit_task *task, int leg, const struct body_build *build);

// Where a lower leg sticks out, searches rotations about its knee, in the image plane, for the least energy and
// shin_outside_log_odds; its foot may keep pointing where it is seen. scratch->best holds this frame's fit;
// scratch->trial is overwritten. Returns the log-odds gained, with the number of candidates as prior; 0: the leg stays,
// or is hidden by a skirt. *out is the whole pose, only with more than 0.
double shin_alternative_log_odds(const struct fit_task *task, int leg, struct fit_scratch *scratch,
                                 struct body_pose *out);
