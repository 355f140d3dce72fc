#include "capture/tracking/tracker.h"
#include "base/portable_math.h"

#include "capture/tracking/tracker_features.h"
#include "capture/body/joint_posterior.h"
#include "base/clock.h"

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
static struct body_pose extrapolate(const struct tracker *t, int64_t time_ns)
{
    struct body_pose pose = t->pose;
    double past = (double)(t->time_ns - t->previous_ns), ahead = (double)(time_ns - t->time_ns);
    if (!t->has_velocity || past <= 0 || ahead <= 0 || ahead > EXTRAPOLATE_MAX_NS)
        return pose;
    double rate = VELOCITY_RATE * fmin(ahead / past, VELOCITY_STEPS_MAX);
    pose.root = v3_add(t->pose.root, v3_scale(v3_sub(t->pose.root, t->previous_pose.root), rate));
    for (int s = 0; s < SEG_COUNT; s++) {
        struct vec3 rotation =
            quat_to_rotation_vector(quat_multiply(t->pose.rotation[s], quat_conjugate(t->previous_pose.rotation[s])));
        pose.rotation[s] =
            quat_unit(quat_multiply(quat_from_rotation_vector(v3_scale(rotation, rate)), t->pose.rotation[s]));
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
static int predict_spheres(struct tracker *t, const struct body_pose *expected,
                           struct bounding_sphere spheres[SPHERES_MAX])
{
    struct body_build build;
    int count = 0;
    if (t->following) {
        body_forward_kinematics(&t->shape.mean, expected, &build);
        count = add_spheres(&build, spheres, 0);
        if (t->has_prior) {
            body_forward_kinematics(&t->shape.mean, &t->prior_pose, &build);
            count = add_spheres(&build, spheres, count);
        }
    }
    t->has_prior = false;
    return count;
}

bool tracker_floor(const struct tracker *t, struct vec3 *up, double *height_m)
{
    return segmenter_floor(t->segmenter, up, height_m);
}

void tracker_look_for_second_person(struct tracker *t) { t->second_wanted = true; }

bool tracker_sees_second_person(const struct tracker *t) { return t->second_seen; }

// Before the background is updated, which relabels the segmentation's cells.
static void look_for_second_person(struct tracker *t, const uint16_t *depth)
{
    if (t->second_wanted)
        t->second_seen = segmenter_second_person(t->segmenter, depth, t->second_mask) == OK;
    t->second_wanted = false;
}

bool tracker_shows_joint(const struct tracker *t, enum joint j) { return t->visible_probes[j] >= VISIBLE_PROBES_MIN; }

// How much the frame shows of joint j, at `p` in the depth camera, and the time since one did.
static void look_for_joint(struct tracker *t, enum joint j, struct vec3 p, double size_m, double dt_s)
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
    const int visible = evidence_visible_count(t->evidence, p, radius[j] * size_m, &outside);
    const bool seen = visible >= VISIBLE_PROBES_MIN;
    t->visible_probes[j] = visible;
    struct joint_sight *sight = &t->sight[j];
    sight->seen_ever |= visible > 0;
    sight->hidden_s = seen ? 0 : sight->hidden_s + dt_s;
    sight->out_of_image_s = outside ? sight->out_of_image_s + dt_s : 0;
}

// Joints in the colour camera, and how well each is known.
static void fill_skeleton(struct tracker *t, const struct tracked_frame *frame, struct skeleton *out)
{
    const struct fit_result *fit = &t->scratch->best;
    const struct quat color_from_depth = t->calibration.color_from_depth.rotation;
    const double size_m = portable_exp(fit->shape.log[SHAPE_SCALE]) * BODY_AVERAGE_HEIGHT_M;
    struct body_build build;
    body_forward_kinematics(&fit->shape, &t->filter.pose, &build);
    struct covariance3 posterior[JOINT_COUNT];
    if (fit->has_information && find_joint_posteriors(&fit->build, &fit->information, posterior))
        memcpy(t->posterior, posterior, sizeof posterior); // else as in the frame before
    for (int j = 0; j < JOINT_COUNT; j++)
        look_for_joint(t, (enum joint)j, build.joint[j], size_m, frame->dt_s);
    tracker_find_features(t, frame, t->features);
    for (int j = 0; j < JOINT_COUNT; j++) {
        const struct vec3 p = build.joint[j];
        const bool shown = tracker_shows_joint(t, (enum joint)j);
        t->error[j] = joint_error_online((enum joint)j, shown, &t->features[j]);
        t->terms[j] = joint_uncertainty((enum joint)j, p, &t->posterior[j], &t->sight[j]);
        struct covariance3 c = joint_uncertainty_sum(&t->terms[j]);
        t->terms[j].scale = joint_error_factor(&t->error[j], &c);
        c = covariance3_scale(&c, t->terms[j].scale);
        c = covariance3_rotate(color_from_depth, &c);
        joint_set_covariance(out, (enum joint)j, &c);
        out->joint[j] = pose_apply(t->calibration.color_from_depth, p);
        out->confidence[j] = confidence_of(joint_sigma_m(out, (enum joint)j), t->error[j].is_seen);
    }
}

// The person's prediction for this frame, and the time since the last one.
static void predict(struct tracker *t, struct tracked_frame *frame)
{
    const int64_t time_ns = frame->time_ns;
    if (t->following && (time_ns <= t->time_ns ||
                         (t->lost_since_ns && (double)(time_ns - t->lost_since_ns) > t->options.patience_s * 1e9))) {
        if (time_ns > t->time_ns)
            tracker_drop_person(t);
        t->has_velocity = false;
    }
    frame->dt_s =
        t->following && time_ns > t->time_ns ? fmin(GAP_MAX_S, (double)(time_ns - t->time_ns) * 1e-9) : FRAME_S;
    frame->task = (struct fit_task){.point_stride = 1,
                                    .evidence = t->evidence,
                                    .expected = t->following ? extrapolate(t, time_ns) : t->pose,
                                    .shape = t->shape};
}

// Segments the person near the prediction and reads the evidence.
static enum status observe(struct tracker *t, struct tracked_frame *frame)
{
    struct bounding_sphere spheres[SPHERES_MAX];
    int sphere_count = predict_spheres(t, &frame->task.expected, spheres);
    enum status status = t->following ? segmenter_next(t->segmenter, frame->depth, spheres, sphere_count, t->mask)
                                      : tracker_segment_new_person(t, frame->depth);
    tracker_add_elapsed(t, &t->times.segment);
    if (status < 0)
        return status;
    frame->task.have_floor = segmenter_floor(t->segmenter, &frame->task.up, &frame->task.floor_m);
    frame->has_evidence = status == OK && evidence_read(t->evidence, frame->depth, t->mask, t->options.points);
    if (frame->has_evidence)
        tracker_take_points(t, &frame->task);
    tracker_add_elapsed(t, &t->times.evidence);
    return OK;
}

// No person is visible in this frame.
static void commit_empty(struct tracker *t, const struct tracked_frame *frame)
{
    if (t->following && !t->lost_since_ns)
        t->lost_since_ns = frame->time_ns;
    else if (!t->following && t->empty_frames++ % LEARN_EVERY == 0) // everything is background
        segmenter_update_background(t->segmenter);
    t->has_velocity = false;
}

// Takes over the frame's fit: motion, filter, background model.
static void commit(struct tracker *t, const struct tracked_frame *frame)
{
    t->lost_since_ns = 0;
    t->previous_pose = t->pose;
    t->previous_ns = t->time_ns;
    t->pose = t->scratch->best.pose;
    for (int k = 0; k < LIMB_COUNT; k++) // a relocated limb has no velocity
        if (t->limb_relocated[k])
            limb_copy(k, &t->pose, &t->previous_pose);
    t->has_velocity = !frame->detected && !t->flipped && frame->time_ns > t->time_ns;
    if (frame->detected || !t->has_velocity)
        pose_filter_start(&t->filter, &t->scratch->best.shape, &t->pose);
    else
        pose_filter_update(&t->filter, &t->scratch->best.shape, &t->pose, frame->dt_s);
    t->time_ns = frame->time_ns;
    tracker_add_elapsed(t, &t->times.fit);
    if (frame->detected || t->frames % LEARN_EVERY == 0)
        segmenter_update_background(t->segmenter);
    tracker_add_elapsed(t, &t->times.segment);
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
