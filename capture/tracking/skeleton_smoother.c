#include "capture/tracking/skeleton_smoother.h"

#include "base/portable_math.h"
#include "capture/tracking/smoother_internal.h"
#include "capture/tracking/tracker_backward.h"

#include <stdlib.h>
#include <string.h>

// Chosen by hand; docs/results.md measures the outcome.
#define GAP_NS        200000000 // frames further apart than this are not one motion
#define AGREE_M       0.06      // two estimates of a limb about this far apart are half averaged
#define WINDOW_NS     500000000 // jitter is averaged over this time to both sides
#define LINE_M        0.010     // off the line between two frames; more is motion
#define SPEED_MAX_M_S 6.5       // of a thrown punch, as in pose_filter.c
enum {
    SMOOTHING_ITERATIONS = 2, // the second finds the lines between smoothed points
    SPEED_ITERATIONS = 60,
    REPAIR_ITERATIONS = 40 // bounding speeds changes lengths and vice versa: alternated until they agree
};

struct smoother {
    struct calibration calibration;
    struct smoother_frame *frame;
    int64_t count, capacity;
    struct body_points *points; // of the frames that have some
    int points_count, points_capacity;
    size_t bytes_max;         // of `frame` and `points`; 0: no limit
    struct body_shape *shape; // of each person, as learned in the end
    int people;
    struct smoother_floor floor; // as the tracker had it at last
    bool in_backward_pass;
    int backward_person; // whose shape the backward pass has
};

enum status smoother_open(struct smoother **out, const struct calibration *calibration)
{
    if (!(*out = calloc(1, sizeof **out)))
        return fail(ERR_MEMORY, "not enough memory to smooth a take");
    (*out)->calibration = *calibration;
    return OK;
}

void smoother_close(struct smoother **smoother)
{
    if (!*smoother)
        return;
    free((*smoother)->frame);
    free((*smoother)->points);
    free((*smoother)->shape);
    free(*smoother);
    *smoother = NULL;
}

void smoother_limit_memory(struct smoother *smoother, size_t bytes_max) { smoother->bytes_max = bytes_max; }

// ------------------------------------------------------------- forward and backward pass

static enum status check_limit(const struct smoother *smoother, int64_t frames, int points)
{
    const size_t bytes = (size_t)frames * sizeof *smoother->frame + (size_t)points * sizeof *smoother->points;
    if (smoother->bytes_max && bytes > smoother->bytes_max)
        return fail(ERR_MEMORY, "smoothing needs more than the %zu bytes allowed", smoother->bytes_max);
    return OK;
}

static enum status reserve_points(struct smoother *smoother)
{
    if (smoother->points_count < smoother->points_capacity)
        return OK;
    const int capacity = smoother->points_capacity ? 2 * smoother->points_capacity : 64;
    enum status status = check_limit(smoother, smoother->capacity, capacity);
    if (status != OK)
        return status;
    struct body_points *grown = realloc(smoother->points, (size_t)capacity * sizeof *grown);
    if (!grown)
        return fail(ERR_MEMORY, "not enough memory to smooth a take");
    smoother->points = grown;
    smoother->points_capacity = capacity;
    return OK;
}

static enum status reserve(struct smoother *smoother, int people)
{
    if (smoother->count == smoother->capacity) {
        int64_t capacity = smoother->capacity ? 2 * smoother->capacity : 256;
        enum status status = check_limit(smoother, capacity, smoother->points_capacity);
        if (status != OK)
            return status;
        struct smoother_frame *grown = realloc(smoother->frame, (size_t)capacity * sizeof *grown);
        if (!grown)
            return fail(ERR_MEMORY, "not enough memory to smooth a take");
        smoother->frame = grown;
        smoother->capacity = capacity;
    }
    if (people > smoother->people) {
        struct body_shape *grown = realloc(smoother->shape, (size_t)people * sizeof *grown);
        if (!grown)
            return fail(ERR_MEMORY, "not enough memory to smooth a take");
        memset(grown + smoother->people, 0, (size_t)(people - smoother->people) * sizeof *grown);
        smoother->shape = grown;
        smoother->people = people;
    }
    return OK;
}

enum status smoother_set_points(struct smoother *s, int64_t index, const struct body_points *points)
{
    assert(index >= 0 && index < s->count);
    struct smoother_frame *m = &s->frame[index];
    if (m->points < 0) {
        enum status status = reserve_points(s);
        if (status != OK)
            return status;
        m->points = s->points_count++;
    }
    s->points[m->points] = *points;
    return OK;
}

// What a pass estimates for a frame, and how sure it is.
static void keep_estimate(const struct smoother *smoother, const struct tracker *tracker, const struct skeleton *is,
                          enum estimate pass, struct smoother_frame *frame)
{
    frame->estimate[pass] = skeleton_transform(pose_inverse(smoother->calibration.color_from_depth), is);
    for (int j = 0; j < JOINT_COUNT; j++) {
        struct joint_uncertainty_terms terms = tracker_uncertainty_terms(tracker)[j];
        terms.scale = 1;
        const struct covariance3 c = joint_uncertainty_sum(&terms);
        joint_set_covariance(&frame->estimate[pass], (enum joint)j, &c);
        frame->error[pass][j] = tracker_joint_errors(tracker)[j];
        frame->shown[pass][j] = tracker_shows_joint(tracker, (enum joint)j);
    }
}

enum status smoother_push(struct smoother *s, const struct tracker *t, int64_t time_ns, const struct skeleton *online)
{
    assert(!s->count || time_ns > s->frame[s->count - 1].time_ns);
    const struct body_points *points = tracker_points(t);
    enum status status = reserve(s, tracker_detection_count(t));
    if (status == OK && points)
        status = reserve_points(s);
    if (status != OK)
        return status;
    for (int k = 1; k <= tracker_static_object_frames(t) && k <= s->count; k++)
        s->frame[s->count - k].person = -1;
    struct smoother_frame *m = &s->frame[s->count++];
    *m = (struct smoother_frame){.time_ns = time_ns, .person = -1, .points = -1};
    if (points)
        status = smoother_set_points(s, s->count - 1, points);
    if (!online)
        return status;
    m->person = tracker_detection_count(t) - 1;
    m->pose = *tracker_pose(t);
    keep_estimate(s, t, online, FORWARD, m);
    s->shape[m->person] = *tracker_shape(t);
    return OK;
}

// Where this frame alone has legs that the backward pass may have wrong.
static void add_leg_alternatives(struct smoother_frame *frame, struct tracker *tracker)
{
    frame->estimate[ALTERNATIVE] = frame->estimate[BACKWARD];
    for (int k = 0; k < LIMB_COUNT; k++) {
        struct body_pose pose;
        struct body_build build;
        frame->alternative_odds[k] = k < FIRST_LEG ? 0 : tracker_shin_alternative(tracker, k, &pose);
        if (!(frame->alternative_odds[k] > 0))
            continue;
        body_forward_kinematics(tracker_shape(tracker), &pose, &build);
        frame->estimate[ALTERNATIVE].joint[body_limbs[k].bend] = build.joint[body_limbs[k].bend];
        frame->estimate[ALTERNATIVE].joint[body_limbs[k].tip] = build.joint[body_limbs[k].tip];
    }
}

enum status smoother_backward(struct smoother *s, struct tracker *t, int64_t index, const uint16_t *depth)
{
    assert(index >= 0 && index < s->count);
    struct smoother_frame *m = &s->frame[index];
    struct skeleton backward;
    if (m->person < 0)
        return OK;
    if (!s->in_backward_pass || m->person != s->backward_person) {
        tracker_begin_backward(t, &s->shape[m->person]);
        s->backward_person = m->person;
    }
    s->in_backward_pass = true;
    tracker_follow(t, &m->pose);
    tracker_add_prior(t, &m->pose);
    tracker_set_body_points(t, m->points < 0 ? NULL : &s->points[m->points]);
    enum status status = tracker_next(t, m->time_ns, depth, &backward, NULL);
    s->floor.known = tracker_floor(t, &s->floor.up, &s->floor.height_m);
    if (status < 0)
        return status;
    if (status != OK)
        return OK;
    m->has_backward = true;
    keep_estimate(s, t, &backward, BACKWARD, m);
    m->odds = tracker_log_odds(t, &m->pose);
    add_leg_alternatives(m, t);
    return OK;
}

// ------------------------------------------------------------- merging

// The point between the forward and the backward estimate of a joint, and its covariance.
static struct vec3 mixed_joint(const struct smoother_frame *frame, enum joint joint, double backward_share,
                               struct covariance3 *covariance)
{
    const struct skeleton *forward = &frame->estimate[FORWARD], *backward = &frame->estimate[BACKWARD];
    const struct covariance3 a = joint_covariance(forward, joint), b = joint_covariance(backward, joint);
    *covariance = joint_merge_covariance(&a, &b, v3_sub(forward->joint[joint], backward->joint[joint]), backward_share);
    return v3_mix(forward->joint[joint], backward->joint[joint], backward_share);
}

// The passes face opposite ways and one is taken: each joint may be where the other has it.
static void doubt_facing(struct smoother_frame *frame)
{
    for (int j = 0; j < JOINT_COUNT; j++) {
        struct vec3 off = v3_sub(frame->estimate[FORWARD].joint[j], frame->estimate[BACKWARD].joint[j]);
        struct covariance3 c = joint_covariance(&frame->result, (enum joint)j), spread = covariance3_outer(off);
        spread = covariance3_scale(&spread, frame->facing_doubt);
        c = covariance3_add(&c, &spread);
        joint_set_covariance(&frame->result, (enum joint)j, &c);
    }
}

// The midpoint of both passes where they face the same way.
static void merge_estimates(struct smoother_frame *frame)
{
    frame->result = frame->estimate[frame->has_backward && smoother_facing_differs(frame) ? frame->facing : FORWARD];
    if (frame->has_backward && smoother_facing_differs(frame))
        doubt_facing(frame);
    if (!frame->has_backward || smoother_facing_differs(frame))
        return;
    for (int j = 0; j < JOINT_COUNT; j++) {
        struct covariance3 c;
        frame->result.joint[j] = mixed_joint(frame, (enum joint)j, 0.5, &c);
        joint_set_covariance(&frame->result, (enum joint)j, &c);
    }
}

// A limb's joint if `source` is right about the limb; the other pass counts too, as far as it agrees.
static struct vec3 merged_joint(const struct smoother_frame *frame, int k, enum estimate source, enum joint joint,
                                struct covariance3 *covariance)
{
    *covariance = joint_covariance(&frame->estimate[ALTERNATIVE], joint);
    if (source == ALTERNATIVE)
        return frame->estimate[ALTERNATIVE].joint[joint];
    double off = smoother_limb_distance(&frame->estimate[FORWARD], &frame->estimate[BACKWARD], k) / AGREE_M,
           other = 0.5 * portable_exp(-off * off);
    return mixed_joint(frame, joint, source == BACKWARD ? 1 - other : other, covariance);
}

// The posterior mean of a limb's joint over all choices, and its covariance: the mean of the choices' covariances and
// the spread of the choices about the mean.
static void merge_joint(struct smoother_frame *frame, int k, enum joint joint, const double posterior[STATES])
{
    struct vec3 point[STATES], mean = {0, 0, 0};
    struct covariance3 covariance = {0};
    for (int s = 0; s < STATES; s++) {
        struct covariance3 c;
        point[s] = merged_joint(frame, k, k % 2 ? right_estimate(s) : left_estimate(s), joint, &c);
        mean = v3_add(mean, v3_scale(point[s], posterior[s]));
        c = covariance3_scale(&c, posterior[s]);
        covariance = covariance3_add(&covariance, &c);
    }
    double open_m2 = 0;
    for (int s = 0; s < STATES; s++) {
        struct covariance3 spread = covariance3_outer(v3_sub(point[s], mean));
        spread = covariance3_scale(&spread, posterior[s]);
        covariance = covariance3_add(&covariance, &spread);
        open_m2 += covariance3_trace(&spread);
    }
    frame->open_m[joint] = (float)sqrt(open_m2);
    frame->result.joint[joint] = mean;
    joint_set_covariance(&frame->result, joint, &covariance);
}

// The posterior mean over all choices: of an unseen limb, the least wrong point.
static void merge_pair(struct smoother_frame *frame, int first, const double posterior[STATES])
{
    if (!frame->has_backward || smoother_facing_differs(frame))
        return;
    for (int k = first; k < first + 2; k++) {
        merge_joint(frame, k, body_limbs[k].bend, posterior);
        merge_joint(frame, k, body_limbs[k].tip, posterior);
    }
}

// ------------------------------------------------------------- smoothing

// Each point becomes the mean of itself and of the lines between a frame before and one after it, from the nearest on,
// as long as they pass near it: jitter is averaged, straight motion is kept, and where the path bends the lines soon
// miss.
static void smooth(const struct smoother_frame *frame, int64_t count, const struct vec3 *is, struct vec3 *out)
{
    for (int64_t i = 0; i < count; i++) {
        double weight = 1, sum = 1;
        struct vec3 mean = is[i];
        for (int64_t k = 1; k <= i && i + k < count && weight > 1e-3; k++) {
            int64_t before = frame[i].time_ns - frame[i - k].time_ns, after = frame[i + k].time_ns - frame[i].time_ns;
            if (before > WINDOW_NS || after > WINDOW_NS)
                break;
            struct vec3 line = v3_mix(is[i - k], is[i + k], (double)before / (double)(before + after));
            double off = v3_distance(line, is[i]) / LINE_M;
            weight = fmin(weight, portable_exp(-off * off));
            mean = v3_add(mean, v3_scale(line, 2 * weight)); // of two frames
            sum += 2 * weight;
        }
        out[i] = v3_scale(mean, 1 / sum);
    }
}

// Bounds a joint's speed where the estimate switches: the jump is spread over frames before and after.
static void limit_speed(struct smoother_frame *frame, int64_t count, enum joint joint)
{
    bool fast = true;
    for (int round = 0; fast && round < SPEED_ITERATIONS; round++) {
        fast = false;
        for (int64_t i = 1; i < count; i++) {
            struct vec3 *is = &frame[i].result.joint[joint], *was = &frame[i - 1].result.joint[joint];
            double far = v3_distance(*is, *was),
                   max = SPEED_MAX_M_S * (double)(frame[i].time_ns - frame[i - 1].time_ns) * 1e-9;
            if (far <= 1.001 * max)
                continue;
            struct vec3 back = v3_scale(v3_sub(*was, *is), 0.5 * (far - max) / far);
            *is = v3_add(*is, back);
            *was = v3_sub(*was, back);
            fast = true;
        }
    }
}

static void smooth_joints(struct smoother_frame *frame, int64_t count, struct vec3 *is, struct vec3 *smoothed)
{
    for (int j = 0; j < JOINT_COUNT; j++) {
        for (int64_t i = 0; i < count; i++)
            is[i] = frame[i].result.joint[j];
        for (int round = 0; round < SMOOTHING_ITERATIONS; round++) {
            smooth(frame, count, is, smoothed);
            memcpy(is, smoothed, (size_t)count * sizeof *is);
        }
        for (int64_t i = 0; i < count; i++)
            frame[i].result.joint[j] = is[i];
    }
}

// Means of points shorten bones: restores the person's bone lengths.
static void restore_lengths(struct smoother_frame *frame, const struct body_build *build)
{
    struct vec3 *joint = frame->result.joint;
    for (int k = 0; k < LIMB_COUNT; k++) {
        const enum joint chain[3] = {body_limbs[k].root, body_limbs[k].bend, body_limbs[k].tip};
        for (int i = 1; i < 3; i++) {
            double length = v3_distance(build->joint[chain[i]], build->joint[chain[i - 1]]);
            struct vec3 along = v3_unit(v3_sub(joint[chain[i]], joint[chain[i - 1]]));
            joint[chain[i]] = v3_add(joint[chain[i - 1]], v3_scale(along, length));
        }
    }
}

// The end of a run of consecutive frames of one person.
static int64_t segment_end(const struct smoother *smoother, int64_t first)
{
    int64_t end = first + 1;
    while (end < smoother->count && smoother->frame[end].person == smoother->frame[first].person &&
           smoother->frame[end].time_ns - smoother->frame[end - 1].time_ns <= GAP_NS)
        end++;
    return end;
}

struct smoother_scratch {
    double (*posterior)[STATES];
    struct vec3 *is, *smoothed;
};

static void smooth_segment(struct smoother *smoother, struct smoother_frame *frame, int64_t count,
                           const struct smoother_scratch *scratch)
{
    const struct body_shape *shape = &smoother->shape[frame->person];
    struct body_build build;
    for (int64_t i = 0; i < count; i++) {
        body_forward_kinematics(shape, &frame[i].pose, &build);
        memcpy(frame[i].estimate[FORWARD].joint, build.joint, sizeof build.joint);
    }
    smoother_find_posterior(frame, count, TRUNK, scratch->posterior);
    for (int64_t i = 0; i < count; i++) {
        const double *posterior = scratch->posterior[i];
        const double forward = posterior[state_of(FORWARD, FORWARD)],
                     backward = posterior[state_of(BACKWARD, BACKWARD)];
        frame[i].facing = backward > forward ? BACKWARD : FORWARD;
        frame[i].facing_doubt = fmin(forward, backward);
        merge_estimates(&frame[i]);
    }
    for (int first = 0; first < LIMB_COUNT; first += 2) {
        smoother_find_posterior(frame, count, first, scratch->posterior);
        for (int64_t i = 0; i < count; i++)
            merge_pair(&frame[i], first, scratch->posterior[i]);
    }
    smooth_joints(frame, count, scratch->is, scratch->smoothed);
    for (int round = 0; round < REPAIR_ITERATIONS; round++) {
        for (int j = 0; j < JOINT_COUNT; j++)
            limit_speed(frame, count, (enum joint)j);
        for (int64_t i = 0; i < count; i++)
            restore_lengths(&frame[i], &build);
    }
    smoother_keep_contacts(frame, count, &smoother->floor, scratch->is, scratch->smoothed);
    smoother_decide_confidence(frame, count);
    for (int64_t i = 0; i < count; i++) {
        frame[i].result = skeleton_transform(smoother->calibration.color_from_depth, &frame[i].result);
    }
}

enum status smoother_solve(struct smoother *s)
{
    size_t count = (size_t)s->count + 1;
    struct smoother_scratch scratch = {calloc(count, sizeof *scratch.posterior), calloc(count, sizeof *scratch.is),
                                       calloc(count, sizeof *scratch.smoothed)};
    bool enough = scratch.posterior && scratch.is && scratch.smoothed;
    for (int64_t first = 0, end; enough && first < s->count; first = end) {
        end = segment_end(s, first);
        if (s->frame[first].person >= 0)
            smooth_segment(s, &s->frame[first], end - first, &scratch);
    }
    free(scratch.posterior);
    free(scratch.is);
    free(scratch.smoothed);
    return enough ? OK : fail(ERR_MEMORY, "not enough memory to smooth a take");
}

const struct skeleton *smoother_skeleton(const struct smoother *smoother, int64_t index)
{
    assert(index >= 0 && index < smoother->count);
    return smoother->frame[index].person >= 0 ? &smoother->frame[index].result : NULL;
}

void smoother_joint_features(const struct smoother *smoother, int64_t index, struct smoothed_features out[JOINT_COUNT],
                             float widening[JOINT_COUNT])
{
    assert(index >= 0 && index < smoother->count);
    smoother_find_features(&smoother->frame[index], out);
    memcpy(widening, smoother->frame[index].widening, sizeof smoother->frame[index].widening);
}
