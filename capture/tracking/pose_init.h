// Finding a person's pose with nothing to go by but one picture.
#pragma once
#include "capture/tracking/limb_hypotheses.h"

// Fills room->best and moves task->shape to the person's size. task's evidence
// and floor are in use; up must be set. False: no pose explains the points.
bool start_search(struct fit_task *task, struct fit_room *room);

// The same beside a body that is followed already: true when what is found anew explains the picture so much better
// that the followed one was wrong. Else room->best is that one again, judged, and the task as it was. feet_came: until
// now the picture's lower edge cut them off.
bool start_over(struct fit_task *task, const struct body_pose *followed, bool feet_came, struct fit_room *room);

// The share of the points within `within_m` of the body.
double explained_share(const struct body_evidence *e, const struct fit_result *r, double within_m);
