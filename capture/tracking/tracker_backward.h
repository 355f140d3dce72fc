// The backward pass over tracked frames: what skeleton_smoother.c needs of the tracker beyond tracker.h. Depth camera's
// axes, metres. Log-odds as in pose_likelihood.h.
#pragma once
#include "capture/tracking/pose_likelihood.h"
#include "capture/tracking/tracker.h"

// The points that were set for the last frame; NULL: none. Valid until the next frame's are set.
const struct body_points *tracker_points(const struct tracker *tracker);

// From here on frames come in falling order of time, the last one first, with their own times, and show a person of
// this shape, which is no longer learned; the learned background stays. May be called again where an earlier person
// comes. Until tracker_reset.
void tracker_begin_backward(struct tracker *tracker, const struct body_shape *shape);

// The next frame shows the person in about this pose: tracking goes on from it, unless the tracker follows this person
// already; another one that it follows is dropped.
void tracker_follow(struct tracker *tracker, const struct body_pose *pose);

// The pose that the forward pass estimated for the next frame: what is close to it is segmented as the person too, so
// that a limb which one pass has lost is not cut off.
void tracker_add_prior(struct tracker *tracker, const struct body_pose *pose);

// Of the last tracker_next that was OK.
const struct body_pose *tracker_pose(const struct tracker *tracker); // filtered: the online estimate
const struct body_shape *tracker_shape(const struct tracker *tracker);
int tracker_detection_count(const struct tracker *tracker); // how often a person was detected from scratch so far

// How many frames right before the last tracker_next turned out in it to show a static object and not a person.
int tracker_static_object_frames(const struct tracker *tracker);

// The last frame's log-odds of another pose against the fitted one.
struct pose_log_odds tracker_log_odds(struct tracker *tracker, const struct body_pose *other);

// The log-odds of the likeliest other place of a lower leg (2 left, 3 right), as in occluded_shin.h; *out is the online
// estimate but for that leg. 0: no other place is likelier.
double tracker_shin_alternative(struct tracker *tracker, int leg, struct body_pose *out);
