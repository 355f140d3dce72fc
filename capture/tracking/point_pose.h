// A body's pose from the points of one colour image and the depth behind them, without any pose before: where a first
// frame shows a body in mid-motion. Rough: to be fitted. Pure; depth camera's axes, metres.
#pragma once
#include "capture/body/body_fit.h"

// The trunk from shoulders and hips, once with the left and once with the right shoulder nearer to the camera, for
// their distance is known and only its share across the view is seen; then the limbs along their rays. Returns the
// number of poses, 0 where the trunk's points are not all visible.
enum { POINT_POSES = 2 };
int point_poses(const struct fit_task *task, struct body_pose out[POINT_POSES]);
