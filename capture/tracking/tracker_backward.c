#include "capture/tracking/tracker_backward.h"

#include "capture/tracking/occluded_shin.h"
#include "capture/tracking/tracker_internal.h"

#include <string.h>

void tracker_begin_backward(struct tracker *t, const struct body_shape *shape)
{
    t->backward = true;
    t->shape.mean = *shape;
    t->has_velocity = false;
    t->lost_since_ns = 0;
    t->flip_log_odds = t->leg_swap_log_odds = 0;
    memset(t->limb_log_odds, 0, sizeof t->limb_log_odds);
}

const struct body_points *tracker_points(const struct tracker *t) { return t->has_points ? &t->next_points : NULL; }

void tracker_add_prior(struct tracker *t, const struct body_pose *pose)
{
    t->prior_pose = *pose;
    t->has_prior = true;
}

const struct body_pose *tracker_pose(const struct tracker *t) { return &t->filter.pose; }

const struct body_shape *tracker_shape(const struct tracker *t) { return &t->shape.mean; }

int tracker_static_object_frames(const struct tracker *t) { return t->static_object_frames; }

int tracker_detection_count(const struct tracker *t) { return t->detection_count; }

// With the wide kernel of the limb search: points that are left unexplained have to count.
static struct fit_task evaluation_task(const struct tracker *t)
{
    struct fit_task task = {.point_stride = 1,
                            .evidence = t->evidence,
                            .points = t->points.count ? &t->points : NULL,
                            .shape = t->shape,
                            .kernel_m = SEARCH_KERNEL_M};
    task.have_floor = segmenter_floor(t->segmenter, &task.up, &task.floor_m);
    return task;
}

struct pose_log_odds tracker_log_odds(struct tracker *t, const struct body_pose *other)
{
    struct fit_task task = evaluation_task(t);
    return pose_compare(&task, &t->pose, other, t->scratch);
}

double tracker_shin_alternative(struct tracker *t, int leg, struct body_pose *out)
{
    struct fit_task task = evaluation_task(t);
    struct body_pose found;
    double gain = shin_alternative_log_odds(&task, leg, t->scratch, &found);
    *out = t->filter.pose;
    if (gain > 0)
        limb_copy(leg, &found, out);
    return gain;
}
