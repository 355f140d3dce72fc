// Finds a person's pose in a single frame: what the network has in the depth image, told that the person's left is on
// the one side and on the other, standing there both ways round and, where there are points of the colour image, what
// these suggest (point_pose.h), are fitted; the one with the least energy and prior wins. Pure; camera axes, metres.
#pragma once
#include "capture/body/body_fit.h"

// Fits from a pose that is only about right into scratch->trial, first with a wide kernel; the shape stays task's. Its
// energy is that of SEARCH_KERNEL_M.
void pose_init_fit(const struct fit_task *task, const struct body_pose *pose, struct fit_scratch *scratch);

// Fills scratch->best and sets task->shape to the person's size. Uses task's evidence, joints and floor; up must be
// set. told: the joints of both sides. False: no pose explains the points; scratch and task->shape are then of no use.
bool pose_init_search(struct fit_task *task, const struct joint_evidence told[2], struct fit_scratch *scratch);

// The same for a person who is followed already, in scratch->best's pose: true when the new pose explains the frame so
// much better that the followed one was wrong. Else scratch->best is the followed one again, evaluated, and *task is
// unchanged. feet_appeared: until now the image's lower edge cropped them.
bool pose_reinit(struct fit_task *task, const struct joint_evidence told[2], bool feet_appeared,
                 struct fit_scratch *scratch);

// The share of the points within `within_m` of the body.
double explained_share(const struct depth_evidence *evidence, const struct fit_result *result, double within_m);
