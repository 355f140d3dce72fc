// A lower leg that the other leg hides, but for a toe.
#pragma once
#include "capture/tracking/limb_hypotheses.h"

// What a picture has against where a lower leg is for sticking out beside the person there, as a logarithm of odds,
// beyond what a fit's energy counts; 0 in a skirt. leg: of the limbs, 2 or 3.
double shin_outside_log_odds(const struct fit_task *task, int leg, const struct body_build *build);

// Where a lower leg sticks out beside the person, turns it about its knee, in the picture, to where
// that and everything else has least against it; its foot may go on pointing where it is seen.
// scratch->best holds the fit of this picture; scratch->trial is overwritten.
// Returns by how much less there is against it, as a logarithm of odds; 0: it is where it should
// be, or hidden by a skirt. *out is the whole pose, only with more than 0.
double shin_alternative_log_odds(const struct fit_task *task, int leg, struct fit_scratch *scratch,
                                 struct body_pose *out);
