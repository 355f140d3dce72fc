// Opens, closes and resets a tracker, and accounts for its time.
#include "base/clock.h"
#include "capture/tracking/tracker_internal.h"

#include <limits.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

struct tracker_options tracker_default_options(void)
{
    return (struct tracker_options){.points = 600, .iterations = 5, .learn_s = 10, .patience_s = 0.7};
}

enum status tracker_open(struct tracker **out, const struct calibration *calibration,
                         const struct tracker_options *options)
{
    *out = NULL;
    struct tracker_options o = options ? *options : tracker_default_options();
    if (o.points < 100 || o.points > EVIDENCE_POINTS_MAX || o.iterations < 1 || o.iterations > 30 ||
        !(o.learn_s >= 0) || !(o.patience_s >= 0))
        return fail(ERR_INPUT, "tracking: points (%d) must be 100 to %d, iterations (%d) 1 to 30, times not negative",
                    o.points, EVIDENCE_POINTS_MAX, o.iterations);
    enum status status = lens_check(&calibration->depth, "depth");
    if (status != OK)
        return status;
    struct tracker *t = calloc(1, sizeof *t);
    if (!t)
        return fail(ERR_MEMORY, "not enough memory to track a person");
    t->options = o;
    t->calibration = *calibration;
    t->scratch = calloc(1, sizeof *t->scratch);
    t->mask = calloc((size_t)calibration->depth.width, (size_t)calibration->depth.height);
    t->second_mask = calloc((size_t)calibration->depth.width, (size_t)calibration->depth.height);
    status = t->scratch && t->mask && t->second_mask ? OK : fail(ERR_MEMORY, "not enough memory to track a person");
    if (status == OK)
        status = segmenter_open(&t->segmenter, &calibration->depth);
    if (status == OK)
        status = evidence_open(&t->evidence, &calibration->depth);
    if (status == OK)
        status = body_network_open(&t->network);
    if (status != OK) {
        tracker_close(&t);
        return status;
    }
    t->frames_since_image = t->frames_since_points = INT_MAX / 2; // no colour so far
    *out = t;
    return OK;
}

void tracker_close(struct tracker **tracker)
{
    if (!*tracker)
        return;
    if ((*tracker)->segmenter)
        segmenter_close(&(*tracker)->segmenter);
    if ((*tracker)->evidence)
        evidence_close(&(*tracker)->evidence);
    if ((*tracker)->network)
        body_network_close(&(*tracker)->network);
    free((*tracker)->scratch);
    free((*tracker)->mask);
    free((*tracker)->second_mask);
    free(*tracker);
    *tracker = NULL;
}

void tracker_set_background(struct tracker *tracker, const uint16_t *depth)
{
    segmenter_set_background(tracker->segmenter, depth);
}

void tracker_set_floor(struct tracker *tracker, struct vec3 up, double height_m)
{
    segmenter_set_floor(tracker->segmenter, up, height_m);
}

const struct joint_uncertainty_terms *tracker_uncertainty_terms(const struct tracker *tracker)
{
    return tracker->terms;
}

void tracker_set_body_points(struct tracker *tracker, const struct body_points *points)
{
    tracker->has_next_points = points && tracker->calibration.color.width > 0;
    if (tracker->has_next_points)
        tracker->next_points = *points;
}

struct skeleton tracker_found_joints(const struct tracker *tracker)
{
    struct skeleton out = {0};
    for (int j = 0; j < JOINT_COUNT; j++) {
        const double variance = tracker->untold.sigma_m[j] * tracker->untold.sigma_m[j];
        if (!isfinite(variance))
            continue;
        const struct covariance3 c = {.xx = variance, .yy = variance, .zz = variance};
        out.joint[j] = pose_apply(tracker->calibration.color_from_depth, tracker->untold.joint[j]);
        joint_set_covariance(&out, (enum joint)j, &c);
        out.confidence[j] = confidence_of(sqrt(variance), true);
    }
    return out;
}

const struct joint_features *tracker_joint_features(const struct tracker *tracker) { return tracker->features; }

const struct joint_error *tracker_joint_errors(const struct tracker *tracker) { return tracker->error; }

struct tracker_times tracker_last_times(const struct tracker *tracker) { return tracker->times; }

void tracker_add_elapsed(struct tracker *tracker, int64_t *step)
{
    int64_t now_ns = clock_cpu_ns();
    *step += now_ns - tracker->mark_ns;
    tracker->mark_ns = now_ns;
}

void tracker_drop_person(struct tracker *tracker)
{
    tracker->following = tracker->has_velocity = false;
    tracker->poor_frames = 0;
    tracker->flip_log_odds = 0;
    memset(tracker->limb_relocated, 0, sizeof tracker->limb_relocated);
    memset(tracker->since_relocated_s, 0, sizeof tracker->since_relocated_s);
    tracker->lost_since_ns = 0;
    memset(tracker->sight, 0, sizeof tracker->sight);
    segmenter_drop_person(tracker->segmenter);
}

void tracker_reset(struct tracker *tracker)
{
    tracker_drop_person(tracker);
    tracker->backward = tracker->has_next_points = false;
    tracker->confirmed = tracker->elsewhere = false;
    tracker->unconfirmed_images = tracker->pointed_frames = 0;
    tracker->frames = tracker->empty_frames = tracker->refused_wait = 0;
    tracker->frames_since_image = tracker->frames_since_points = INT_MAX / 2;
    segmenter_reset(tracker->segmenter);
}
