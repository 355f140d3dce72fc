// Opens, closes and resets a tracker, and accounts for its time.
#include "capture/tracking/tracker_internal.h"

#include "base/clock.h"

#include <limits.h>
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
    if (status != OK) {
        tracker_close(&t);
        return status;
    }
    t->frames_since_image = t->frames_since_points = INT_MAX / 2; // no colour so far
    *out = t;
    return OK;
}

void tracker_close(struct tracker **t)
{
    if (!*t)
        return;
    if ((*t)->segmenter)
        segmenter_close(&(*t)->segmenter);
    if ((*t)->evidence)
        evidence_close(&(*t)->evidence);
    free((*t)->scratch);
    free((*t)->mask);
    free((*t)->second_mask);
    free(*t);
    *t = NULL;
}

void tracker_set_background(struct tracker *t, const uint16_t *depth) { segmenter_set_background(t->segmenter, depth); }

void tracker_set_floor(struct tracker *t, struct vec3 up, double height_m)
{
    segmenter_set_floor(t->segmenter, up, height_m);
}

const struct joint_uncertainty_terms *tracker_uncertainty_terms(const struct tracker *t) { return t->terms; }

void tracker_set_body_points(struct tracker *t, const struct body_points *points)
{
    t->has_next_points = points && t->calibration.color.width > 0;
    if (t->has_next_points)
        t->next_points = *points;
}

const struct joint_features *tracker_joint_features(const struct tracker *t) { return t->features; }

const struct joint_error *tracker_joint_errors(const struct tracker *t) { return t->error; }

struct tracker_times tracker_last_times(const struct tracker *t) { return t->times; }

void tracker_add_elapsed(struct tracker *t, int64_t *step)
{
    int64_t now_ns = clock_cpu_ns();
    *step += now_ns - t->mark_ns;
    t->mark_ns = now_ns;
}

void tracker_drop_person(struct tracker *t)
{
    t->following = t->has_velocity = false;
    t->poor_frames = 0;
    t->flip_log_odds = t->leg_swap_log_odds = 0;
    memset(t->limb_log_odds, 0, sizeof t->limb_log_odds);
    memset(t->limb_relocated, 0, sizeof t->limb_relocated);
    memset(t->since_relocated_s, 0, sizeof t->since_relocated_s);
    t->lost_since_ns = 0;
    memset(t->sight, 0, sizeof t->sight);
    segmenter_drop_person(t->segmenter);
}

void tracker_reset(struct tracker *t)
{
    tracker_drop_person(t);
    t->backward = t->has_next_points = false;
    t->confirmed = t->elsewhere = false;
    t->unconfirmed_images = t->pointed_frames = 0;
    t->frames = t->empty_frames = t->refused_wait = t->restart_wait = t->restart_turn = 0;
    t->frames_since_image = t->frames_since_points = INT_MAX / 2;
    segmenter_reset(t->segmenter);
}
