#include "capture/tracking/tracker_backward.h"

#include "capture/tracking/occluded_shin.h"
#include "capture/tracking/tracker_internal.h"

#include <string.h>

#define SAME_PERSON_M 0.5 // between the roots of one person in two passes; chosen by hand

void tracker_begin_backward(struct tracker *tracker, const struct body_shape *shape)
{
    tracker->backward = true;
    tracker->shape.mean = *shape;
    tracker->has_velocity = false;
    tracker->lost_since_ns = 0;
    tracker->flip_log_odds = 0;
}

void tracker_follow(struct tracker *tracker, const struct body_pose *pose)
{
    if (tracker->following && v3_distance(tracker->pose.root, pose->root) < SAME_PERSON_M)
        return;
    tracker_drop_person(tracker);
    tracker->following = true;
    tracker->pose = tracker->previous_pose = *pose;
    tracker->person_mean = 0;
    pose_filter_start(&tracker->filter, &tracker->shape.mean, pose);
}

const struct body_points *tracker_points(const struct tracker *tracker)
{
    return tracker->has_points ? &tracker->next_points : NULL;
}

void tracker_add_prior(struct tracker *tracker, const struct body_pose *pose)
{
    tracker->prior_pose = *pose;
    tracker->has_prior = true;
}

const struct body_pose *tracker_pose(const struct tracker *tracker) { return &tracker->filter.pose; }

const struct body_shape *tracker_shape(const struct tracker *tracker) { return &tracker->shape.mean; }

int tracker_static_object_frames(const struct tracker *tracker) { return tracker->static_object_frames; }

int tracker_detection_count(const struct tracker *tracker) { return tracker->detection_count; }

// With the wide kernel: points that are left unexplained have to count. Without the network's joints, which were told
// this pass's sides.
static struct fit_task evaluation_task(const struct tracker *tracker)
{
    struct fit_task task = {.point_stride = 1,
                            .evidence = tracker->evidence,
                            .points = tracker->points.count ? &tracker->points : NULL,
                            .shape = tracker->shape,
                            .kernel_m = SEARCH_KERNEL_M};
    task.have_floor = segmenter_floor(tracker->segmenter, &task.up, &task.floor_m);
    return task;
}

struct pose_log_odds tracker_log_odds(struct tracker *tracker, const struct body_pose *other)
{
    struct fit_task task = evaluation_task(tracker);
    return pose_compare(&task, &tracker->pose, other, tracker->scratch);
}

double tracker_shin_alternative(struct tracker *tracker, int leg, struct body_pose *out)
{
    struct fit_task task = evaluation_task(tracker);
    struct body_pose found;
    double gain = shin_alternative_log_odds(&task, leg, tracker->scratch, &found);
    *out = tracker->filter.pose;
    if (gain > 0)
        limb_copy(leg, &found, out);
    return gain;
}
