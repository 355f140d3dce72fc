// Looking back over frames that were tracked: what skeleton_smoother.c needs of the tracker beyond tracker.h.
#pragma once
#include "capture/tracking/tracker.h"
#include "capture/tracking/pose_likelihood.h"

// From here on frames come in falling order of time, the last one first, with their own times, and
// show a person of this shape, which is learned no more; what was learned of the room stays. May be
// called again where an earlier person comes. Until tracker_reset.
void tracker_begin_backward(struct tracker *t, const struct body_shape *shape);

// Where the other way had the person in the frame that comes next: what is close to it there is
// the person, too, so that a limb which one way has lost is not cut off with what the other sees of it.
void tracker_add_prior(struct tracker *t, const struct body_pose *pose);

// Of the last tracker_next that was OK; depth camera's axes.
const struct body_pose *tracker_pose(const struct tracker *t); // as told
const struct body_shape *tracker_shape(const struct tracker *t);
int tracker_detection_count(const struct tracker *t); // so often somebody was found anew, so far

// In the last tracker_next it turned out that so many frames right before it showed furniture, not a person; 0: none
// did.
int tracker_static_object_frames(const struct tracker *t);

// This picture's word on another pose beside the one that was fitted to it.
struct pose_log_odds tracker_log_odds(struct tracker *t, const struct body_pose *other);

// Where a lower leg (2 left, 3 right) is likelier than where it was told to be, as in occluded_shin.h: the logarithm of
// the odds, and *out is what was told but for that leg. 0: nowhere.
double tracker_shin_alternative(struct tracker *t, int leg, struct body_pose *out);
