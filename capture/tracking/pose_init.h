// Initialises a person's pose from a single frame. Rough measures of the points give height and place; standing poses
// of eight directions are fitted roughly (and with a raised leg where none fits), the best of each direction is
// refined, and the one with the least energy and prior wins. With points of the colour image, the pose that they show
// is tried as well (point_pose.h). Pure; camera axes, metres.
#pragma once
#include "capture/tracking/limb_hypotheses.h"

// Fills scratch->best and sets task->shape to the person's size. Uses task's evidence and floor; up must be set. False:
// no pose explains the points; scratch and task->shape are then of no use.
bool pose_init_search(struct fit_task *task, struct fit_scratch *scratch);

// The same for a person who is followed already: true when the new pose explains the frame so much better that the
// followed one was wrong. Else scratch->best is the followed one again, evaluated, and *task is unchanged.
// feet_appeared: until now the image's lower edge cropped them.
bool pose_reinit(struct fit_task *task, const struct body_pose *followed, bool feet_appeared,
                 struct fit_scratch *scratch);

// Fits one of the starts, another for each `turn`, to a person who is followed already: true when it explains the frame
// so much better that the followed pose and shape were wrong; scratch->best and task->shape are then the new ones. Else
// as pose_reinit. scratch->other_rate: the start's energy, roughly fitted, over that of the followed pose; 0: none was
// tried, or it led to the same pose.
bool pose_restart(struct fit_task *task, const struct body_pose *followed, int turn, struct fit_scratch *scratch);

// The share of the points within `within_m` of the body.
double explained_share(const struct depth_evidence *evidence, const struct fit_result *result, double within_m);
