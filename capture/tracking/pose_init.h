// Finding a person's pose with nothing to go by but one picture.
#pragma once
#include "capture/tracking/limb_hypotheses.h"

// Fills scratch->best and moves task->shape to the person's size. task's evidence
// and floor are in use; up must be set. False: no pose explains the points.
bool pose_init_search(struct fit_task *task, struct fit_scratch *scratch);

// The same beside a body that is followed already: true when what is found anew explains the picture so much better
// that the followed one was wrong. Else scratch->best is that one again, judged, and the task as it was. feet_came:
// until now the picture's lower edge cut them off.
bool pose_reinit(struct fit_task *task, const struct body_pose *followed, bool feet_came, struct fit_scratch *scratch);

// The share of the points within `within_m` of the body.
double explained_share(const struct depth_evidence *e, const struct fit_result *r, double within_m);
