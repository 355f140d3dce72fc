#include "capture/tracking/tracker.h"

#include "base/clock.h"
#include "base/portable_math.h"
#include "capture/body/joint_posterior.h"
#include "capture/tracking/tracker_features.h"

#include <string.h>

#define FRAME_S            (1.0 / 30) // assumed before the second frame
#define GAP_MAX_S          1.0        // a longer gap counts as this
#define EXTRAPOLATE_MAX_NS 2e8        // beyond this the velocity says nothing about the pose
#define VELOCITY_RATE      0.8        // of the velocity: limbs reverse more often than they accelerate; chosen by hand
#define VELOCITY_STEPS_MAX 3          // of the last step, at most so many are extrapolated

enum {
    SPHERES_PER_SOLID = 4,
    SPHERES_MAX = 2 * SPHERES_PER_SOLID * SOLID_COUNT, // of the prediction and of the other pass
    VISIBLE_PROBES_MIN = 3,                            // of EVIDENCE_PROBES
};

// The pose at constant velocity, damped.
static struct body_pose extrapolate(const struct tracker *tracker, int64_t time_ns)
{
    struct body_pose pose = tracker->pose;
    double past = (double)(tracker->time_ns - tracker->previous_ns), ahead = (double)(time_ns - tracker->time_ns);
    if (!tracker->has_velocity || past <= 0 || ahead <= 0 || ahead > EXTRAPOLATE_MAX_NS)
        return pose;
    double rate = VELOCITY_RATE * fmin(ahead / past, VELOCITY_STEPS_MAX);
    pose.root = v3_add(tracker->pose.root, v3_scale(v3_sub(tracker->pose.root, tracker->previous_pose.root), rate));
    for (int s = 0; s < SEG_COUNT; s++) {
        struct vec3 rotation = quat_to_rotation_vector(
            quat_multiply(tracker->pose.rotation[s], quat_conjugate(tracker->previous_pose.rotation[s])));
        pose.rotation[s] =
            quat_unit(quat_multiply(quat_from_rotation_vector(v3_scale(rotation, rate)), tracker->pose.rotation[s]));
    }
    return pose;
}

// Appends the spheres that cover a body; returns the new count.
static int add_spheres(const struct body_build *build, struct bounding_sphere spheres[SPHERES_MAX], int count)
{
    for (int i = 0; i < build->solids; i++) {
        const struct body_solid *s = &build->solid[i];
        for (int k = 0; k < SPHERES_PER_SOLID; k++) {
            double t = k / (SPHERES_PER_SOLID - 1.0);
            spheres[count++] = (struct bounding_sphere){v3_mix(s->a, s->b, t), solid_radius(s, t) + s->width_a +
                                                                                   (s->width_b - s->width_a) * t};
        }
    }
    return count;
}

// Where the person is expected: by the prediction and, for one frame, by the prior of the other pass.
static int predict_spheres(struct tracker *tracker, const struct body_pose *expected,
                           struct bounding_sphere spheres[SPHERES_MAX])
{
    struct body_build build;
    int count = 0;
    if (tracker->following) {
        body_forward_kinematics(&tracker->shape.mean, expected, &build);
        count = add_spheres(&build, spheres, 0);
        if (tracker->has_prior) {
            body_forward_kinematics(&tracker->shape.mean, &tracker->prior_pose, &build);
            count = add_spheres(&build, spheres, count);
        }
    }
    tracker->has_prior = false;
    return count;
}

bool tracker_floor(const struct tracker *tracker, struct vec3 *up, double *height_m)
{
    return segmenter_floor(tracker->segmenter, up, height_m);
}

void tracker_look_for_second_person(struct tracker *tracker) { tracker->second_wanted = true; }

bool tracker_sees_second_person(const struct tracker *tracker) { return tracker->second_seen; }

// Before the background is updated, which relabels the segmentation's cells.
static void look_for_second_person(struct tracker *tracker, const uint16_t *depth)
{
    if (tracker->second_wanted)
        tracker->second_seen = segmenter_second_person(tracker->segmenter, depth, tracker->second_mask) == OK;
    tracker->second_wanted = false;
}

bool tracker_shows_joint(const struct tracker *tracker, enum joint joint)
{
    return tracker->visible_probes[joint] >= VISIBLE_PROBES_MIN;
}

// How much the frame shows of joint j, at `p` in the depth camera, and the time since one did.
static void look_for_joint(struct tracker *tracker, enum joint joint, struct vec3 p, double size_m, double dt_s)
{
    static const double radius[JOINT_COUNT] = {
        // of body height: half the thickness of the body at the joint
        [JOINT_HEAD] = 0.05,         [JOINT_NECK] = 0.04,        [JOINT_LEFT_SHOULDER] = 0.032,
        [JOINT_LEFT_ELBOW] = 0.024,  [JOINT_LEFT_HAND] = 0.017,  [JOINT_RIGHT_SHOULDER] = 0.032,
        [JOINT_RIGHT_ELBOW] = 0.024, [JOINT_RIGHT_HAND] = 0.017, [JOINT_TORSO] = 0.058,
        [JOINT_WAIST] = 0.058,       [JOINT_LEFT_HIP] = 0.055,   [JOINT_LEFT_KNEE] = 0.034,
        [JOINT_LEFT_FOOT] = 0.024,   [JOINT_RIGHT_HIP] = 0.055,  [JOINT_RIGHT_KNEE] = 0.034,
        [JOINT_RIGHT_FOOT] = 0.024,
    };
    bool outside;
    const int visible = evidence_visible_count(tracker->evidence, p, radius[joint] * size_m, &outside);
    const bool seen = visible >= VISIBLE_PROBES_MIN;
    tracker->visible_probes[joint] = visible;
    struct joint_sight *sight = &tracker->sight[joint];
    sight->seen_ever |= visible > 0;
    sight->hidden_s = seen ? 0 : sight->hidden_s + dt_s;
    sight->out_of_image_s = outside ? sight->out_of_image_s + dt_s : 0;
}

// Joints in the colour camera, and how well each is known.
static void fill_skeleton(struct tracker *tracker, const struct tracked_frame *frame, struct skeleton *out)
{
    const struct fit_result *fit = &tracker->scratch->best;
    const struct quat color_from_depth = tracker->calibration.color_from_depth.rotation;
    const double size_m = portable_exp(fit->shape.log[SHAPE_SCALE]) * BODY_AVERAGE_HEIGHT_M;
    struct body_build build;
    body_forward_kinematics(&fit->shape, &tracker->filter.pose, &build);
    struct covariance3 posterior[JOINT_COUNT];
    if (fit->has_information && find_joint_posteriors(&fit->build, &fit->information, posterior))
        memcpy(tracker->posterior, posterior, sizeof posterior); // else as in the frame before
    for (int j = 0; j < JOINT_COUNT; j++)
        look_for_joint(tracker, (enum joint)j, build.joint[j], size_m, frame->dt_s);
    tracker_find_features(tracker, frame, tracker->features);
    for (int j = 0; j < JOINT_COUNT; j++) {
        const struct vec3 p = build.joint[j];
        const bool shown = tracker_shows_joint(tracker, (enum joint)j);
        tracker->error[j] = joint_error_online((enum joint)j, shown, &tracker->features[j]);
        tracker->terms[j] = joint_uncertainty((enum joint)j, p, &tracker->posterior[j], &tracker->sight[j]);
        struct covariance3 c = joint_uncertainty_sum(&tracker->terms[j]);
        tracker->terms[j].scale = joint_error_factor(&tracker->error[j], &c);
        c = covariance3_scale(&c, tracker->terms[j].scale);
        c = covariance3_rotate(color_from_depth, &c);
        joint_set_covariance(out, (enum joint)j, &c);
        out->joint[j] = pose_apply(tracker->calibration.color_from_depth, p);
        out->confidence[j] = confidence_of(joint_sigma_m(out, (enum joint)j), tracker->error[j].is_seen);
    }
}

// The person's prediction for this frame, and the time since the last one.
static void predict(struct tracker *tracker, struct tracked_frame *frame)
{
    const int64_t time_ns = frame->time_ns;
    if (tracker->following &&
        (time_ns <= tracker->time_ns ||
         (tracker->lost_since_ns && (double)(time_ns - tracker->lost_since_ns) > tracker->options.patience_s * 1e9))) {
        if (time_ns > tracker->time_ns)
            tracker_drop_person(tracker);
        tracker->has_velocity = false;
    }
    frame->dt_s = tracker->following && time_ns > tracker->time_ns
                      ? fmin(GAP_MAX_S, (double)(time_ns - tracker->time_ns) * 1e-9)
                      : FRAME_S;
    frame->task = (struct fit_task){.point_stride = 1,
                                    .evidence = tracker->evidence,
                                    .expected = tracker->following ? extrapolate(tracker, time_ns) : tracker->pose,
                                    .shape = tracker->shape};
}

// Segments the person near the prediction and reads the evidence.
static enum status observe(struct tracker *tracker, struct tracked_frame *frame)
{
    struct bounding_sphere spheres[SPHERES_MAX];
    int sphere_count = predict_spheres(tracker, &frame->task.expected, spheres);
    enum status status = tracker->following
                             ? segmenter_next(tracker->segmenter, frame->depth, spheres, sphere_count, tracker->mask)
                             : tracker_segment_new_person(tracker, frame->depth);
    tracker_add_elapsed(tracker, &tracker->times.segment);
    if (status < 0)
        return status;
    frame->task.have_floor = segmenter_floor(tracker->segmenter, &frame->task.up, &frame->task.floor_m);
    frame->has_evidence =
        status == OK && evidence_read(tracker->evidence, frame->depth, tracker->mask, tracker->options.points);
    if (frame->has_evidence) {
        tracker_find_joints(tracker, &frame->task);
        tracker_take_points(tracker, &frame->task);
    }
    tracker_add_elapsed(tracker, &tracker->times.evidence);
    return OK;
}

// No person is visible in this frame.
static void commit_empty(struct tracker *tracker, const struct tracked_frame *frame)
{
    if (tracker->following && !tracker->lost_since_ns)
        tracker->lost_since_ns = frame->time_ns;
    else if (!tracker->following && tracker->empty_frames++ % LEARN_EVERY == 0) // everything is background
        segmenter_update_background(tracker->segmenter);
    tracker->has_velocity = false;
}

// Takes over the frame's fit: motion, filter, background model.
static void commit(struct tracker *tracker, const struct tracked_frame *frame)
{
    tracker->lost_since_ns = 0;
    tracker->previous_pose = tracker->pose;
    tracker->previous_ns = tracker->time_ns;
    tracker->pose = tracker->scratch->best.pose;
    for (int k = 0; k < LIMB_COUNT; k++) // a relocated limb has no velocity
        if (tracker->limb_relocated[k])
            limb_copy(k, &tracker->pose, &tracker->previous_pose);
    tracker->has_velocity = !frame->detected && !tracker->flipped && frame->time_ns > tracker->time_ns;
    if (frame->detected || !tracker->has_velocity)
        pose_filter_start(&tracker->filter, &tracker->scratch->best.shape, &tracker->pose);
    else
        pose_filter_update(&tracker->filter, &tracker->scratch->best.shape, &tracker->pose, frame->dt_s);
    tracker->time_ns = frame->time_ns;
    tracker_add_elapsed(tracker, &tracker->times.fit);
    if (frame->detected || tracker->frames % LEARN_EVERY == 0)
        segmenter_update_background(tracker->segmenter);
    tracker_add_elapsed(tracker, &tracker->times.segment);
}

enum status tracker_next(struct tracker *t, int64_t time_ns, const uint16_t *depth, struct skeleton *out, uint8_t *mask)
{
    struct tracked_frame frame = {.time_ns = t->backward ? -time_ns : time_ns, .depth = depth};
    size_t pixels = (size_t)t->calibration.depth.width * (size_t)t->calibration.depth.height;
    memset(out, 0, sizeof *out);
    if (mask)
        memset(mask, 0, pixels);
    tracker_begin_points(t);
    t->times = (struct tracker_times){0};
    t->mark_ns = clock_cpu_ns();
    predict(t, &frame);
    enum status status = observe(t, &frame);
    if (status < 0)
        return status;
    if (!tracker_decide(t, &frame)) {
        t->second_seen = false;
        commit_empty(t, &frame);
        return NOTHING;
    }
    look_for_second_person(t, depth);
    commit(t, &frame);
    fill_skeleton(t, &frame, out);
    if (mask)
        memcpy(mask, t->mask, pixels);
    return OK;
}
