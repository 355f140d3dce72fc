// Decides what a frame shows: fits the body, tries alternative poses, learns the shape, detects a person from scratch
// and rejects static objects.
#include "base/portable_math.h"
#include "capture/tracking/point_hypotheses.h"
#include "capture/tracking/pose_init.h"
#include "capture/tracking/tracker_internal.h"

#include <string.h>

// Frame counts, for 30 Hz.
enum {
    HEM_EVERY = 4,          // how often the hem is measured
    HEM_FRAMES_MIN = 8,     // measurements that decide whether there is one
    STATIC_FRAMES_MIN = 12, // updates of the background model, 0.8 s; people in recordings reached 3
    REFUSED_WAIT = 4,       // frames until a component that was no person is looked at again
    CANDIDATES = 3,         // parts of an image, beside the likeliest, that are asked whether they are a person
    POOR_FRAMES_MAX = 12,   // consecutive frames (0.4 s) with a poor fit, after which the person is lost
};

// That it is a person, by the network: less is none to be detected, and of one who is followed, in the mean of late.
// Below SURE_LOG_ODDS a body must fit well to be detected: furniture of a real kitchen has up to 4.3, people who are
// whole 4.2 and more, cut ones less.
#define PERSON_LOG_ODDS    1.0
#define SURE_LOG_ODDS      4.5
#define NO_PERSON_LOG_ODDS (-1.0)

// Shares of the points within a distance of the body.
#define NEAR_M              0.06
#define ROUGHLY_M           0.10
#define EXPLAINED_SHARE_MIN 0.97  // within NEAR_M, of a person: of furniture fewer are,
#define FIT_ENERGY_MAX      120.0 // or its fit has more energy: people's have 25 to 60 on rendered films
#define STATIC_SHAPE_MAX    10.0  // or has an unlikely shape: log-odds against it; of right people's 1 in 100 is above
#define GOOD_SHARE          0.985 // within NEAR_M: below, no shape is learned
#define POOR_SHARE          0.7   // within ROUGHLY_M: below, the frame is poor
#define LOST_SHARE          0.35  // within ROUGHLY_M: below, the person is lost immediately
#define LIMB_JUMP_M         0.08  // a limb that a search moves further than this was lost

// Fits: a coarse half of the iterations with a wide kernel, a fine half with a narrow one.
#define COARSE_KERNEL_M    0.12
#define FINE_KERNEL_M      0.06
#define EXPECTED_SIGMA_MAX 6 // after a gap
#define RELOCATED_SIGMA    2 // about an alternative pose of an arm
#define FLIPPED_SIGMA      4 // about the flipped body

// A person who faces the other way: log-odds that it takes, and how they come together over the frames (docs/results.md
// measures the outcome). Errors of successive images are alike: one counts as TURNED_RATE of an independent one.
#define FLIP_LOG_ODDS     3.0
#define FLIP_LOG_ODDS_MIN (-5.0)
#define FLIP_FRAME_MAX    1.2 // from one frame
#define FLIP_KEPT         0.98
#define TURNED_RATE       0.2
#define TURNED_COSINE_MAX 0.95
#define WALKING_LOG_ODDS  0.15 // of a frame, for walking ahead at WALKING_M_S or faster
#define WALKING_M_S       0.5

// How much is learned of the shape from a frame: a little always, more the more the pose differs from the last.
#define LEARN_RATE_MIN      0.002
#define LEARN_RATE_NEW_POSE 0.1
#define NEW_POSE_RADIANS    0.25 // root mean square over the segments
#define MUCH_LEARNED_RATE   0.05 // the pose is then the new reference

#define UPRIGHT_COSINE 0.95 // of the pelvis, to measure a hem: of a bent person it hangs elsewhere

// The weight of a frame for the shape: errors of frames in one pose are correlated (cloth, the model's coarseness); a
// new pose adds information.
static double novelty(const struct tracker *tracker, const struct body_pose *pose)
{
    double sum = 0;
    for (int s = 0; s < SEG_COUNT; s++) {
        struct vec3 rotation =
            quat_to_rotation_vector(quat_multiply(pose->rotation[s], quat_conjugate(tracker->shape_pose.rotation[s])));
        sum += v3_dot(rotation, rotation);
    }
    double angle = sqrt(sum / SEG_COUNT);
    return LEARN_RATE_MIN + LEARN_RATE_NEW_POSE * fmin(1, angle / NEW_POSE_RADIANS) * fmin(1, angle / NEW_POSE_RADIANS);
}

static void learn_shape(struct tracker *tracker, const struct fit_task *task, const struct fit_result *fit, double dt_s)
{
    tracker->shape.mean = fit->shape;
    for (int a = 0; a < SHAPE_COUNT; a++)
        for (int b = 0; b < SHAPE_COUNT; b++)
            tracker->shape.information[a][b] += task->learn_rate * fit->shape_information[a][b];
    tracker->learned_s += dt_s;
    if (task->learn_rate > MUCH_LEARNED_RATE)
        tracker->shape_pose = fit->pose;
}

// Log-odds that the person walks ahead and not backwards.
static double walking_log_odds(const struct tracker *tracker)
{
    struct vec3 ahead = body_axis(&tracker->scratch->best.build, SEG_PELVIS, 2);
    return (tracker->backward ? -WALKING_LOG_ODDS : WALKING_LOG_ODDS) *
           fmax(-1, fmin(1, -v3_dot(tracker->filter.speed[JOINT_WAIST], ahead) / WALKING_M_S));
}

// The person turned out to wear a skirt or a coat, or none: learns the shape again from scratch.
static void reset_clothing(struct tracker *tracker)
{
    double scale_log = tracker->shape.mean.log[SHAPE_SCALE];
    tracker->shape = shape_prior_default();
    tracker->shape.mean.log[SHAPE_SCALE] = scale_log;
    tracker->learned_s = 0;
}

// Measures the hem and puts it into the shape.
static void update_hem(struct tracker *tracker, const struct fit_task *task)
{
    const struct body_build *build = &tracker->scratch->best.build;
    double height = portable_exp(tracker->shape.mean.log[SHAPE_SCALE]) * BODY_AVERAGE_HEIGHT_M;
    struct vec3 spine = body_axis(build, SEG_PELVIS, 1);
    struct hem hem;
    if (v3_dot(spine, task->up) < UPRIGHT_COSINE || !hem_detect(task, height, &hem))
        return;
    hem_update(&tracker->hem, &hem, v3_dot(task->up, build->origin[SEG_PELVIS]) + task->floor_m);
    if (tracker->hem.count < HEM_FRAMES_MIN)
        return;
    bool wears = tracker->shape.mean.hem_m > 0,
         worn = hem_is_worn(tracker->hem.narrow, tracker->hem.wide_m, height, wears);
    if (worn != wears)
        reset_clothing(tracker);
    tracker->shape.mean.hem_m = worn ? tracker->hem.below_m : 0;
    tracker->shape.mean.hem_radius_m = worn ? 0.5 * tracker->hem.wide_m : 0;
}

// The coarse and the fine fit from the predicted pose.
static void fit_frame(struct tracker *tracker, struct fit_task *task, double dt_s)
{
    struct fit_result *best = &tracker->scratch->best;
    task->learn_shape = false;
    task->expected_sigma = fmin(EXPECTED_SIGMA_MAX, fmax(1, dt_s * 30)); // frames at 30 Hz
    int first = tracker->options.iterations / 2;
    task->iterations = first;
    task->kernel_m = COARSE_KERNEL_M;
    struct body_pose start = task->expected;
    if (first > 0) {
        task->pose_only = true;
        body_fit(task, &start, best);
        start = best->pose;
        task->pose_only = false;
    }
    task->iterations = tracker->options.iterations - first;
    task->kernel_m = FINE_KERNEL_M;
    task->learn_shape = tracker->learned_s < tracker->options.learn_s && !tracker->backward;
    task->learn_rate = novelty(tracker, &start);
    body_fit(task, &start, best);
    tracker_add_elapsed(tracker, &tracker->times.fit);
}

// Log-odds of this frame that the person faces the other way: what the network finds without a hint, which way the
// person walks, and where the colour image has points. The network's vector to the left is as long as it is sure: the
// cosine's mean, of which the log-odds are ln((1 - c) / (1 + c)).
static double turned_log_odds(const struct tracker *tracker, const struct fit_task *task)
{
    const struct fit_result *best = &tracker->scratch->best;
    const double cosine = fmax(-TURNED_COSINE_MAX, fmin(TURNED_COSINE_MAX, tracker->turned_cosine));
    double log_odds = walking_log_odds(tracker) + TURNED_RATE * portable_log((1 - cosine) / (1 + cosine));
    if (task->points) {
        const struct body_pose flipped = body_pose_flip_facing(&best->shape, &best->pose);
        struct body_build build;
        body_forward_kinematics(&best->shape, &flipped, &build);
        log_odds +=
            point_evidence_energy(task->points, &best->build, NULL) - point_evidence_energy(task->points, &build, NULL);
    }
    return log_odds;
}

// Fits the body the other way round, as it is and as the network has it, into scratch->trial, with evidence of
// `joints`.
static void fit_turned(struct fit_scratch *scratch, const struct fit_task *task, const struct joint_evidence *joints)
{
    const struct body_pose now = scratch->best.pose;
    struct fit_task other = *task;
    other.joints = joints;
    other.shape.mean = scratch->best.shape;
    other.kernel_m = SEARCH_KERNEL_M;
    const struct body_pose found = joint_evidence_pose(joints, &other.shape.mean, task->up),
                           flipped = body_pose_flip_facing(&other.shape.mean, &now);
    pose_init_fit(&other, &found, scratch);
    scratch->other = scratch->trial;
    pose_init_fit(&other, &flipped, scratch);
    if (scratch->other.energy < scratch->trial.energy)
        scratch->trial = scratch->other;
}

// True where that has come together over several frames: the body the other way round is then in scratch->trial.
static bool is_turned(struct tracker *tracker, struct fit_task *task)
{
    tracker->flip_log_odds = fmax(FLIP_LOG_ODDS_MIN, FLIP_KEPT * tracker->flip_log_odds +
                                                         fmin(FLIP_FRAME_MAX, turned_log_odds(tracker, task)));
    if (tracker->flip_log_odds < FLIP_LOG_ODDS || !task->joints)
        return false;
    tracker->flip_log_odds = 0;
    const struct joint_evidence joints =
        tracker->turned_cosine < 0 ? tracker->untold : joint_evidence_mirrored(&tracker->joints);
    fit_turned(tracker->scratch, task, &joints);
    tracker->joints = joints;
    return true;
}

// Tries what the network has elsewhere, and adopts what is likelier.
static void try_alternatives(struct tracker *tracker, struct fit_task *task)
{
    struct fit_result *best = &tracker->scratch->best;
    const struct body_build fitted = best->build;
    if (tracker_try_joints(tracker, task)) {
        const struct body_pose start = best->pose;
        task->shape.mean = best->shape;
        task->expected = start;
        task->expected_sigma = RELOCATED_SIGMA;
        body_fit(task, &start, best);
    }
    tracker->frames++;
    tracker->flipped = is_turned(tracker, task);
    if (tracker->flipped) {
        task->expected = tracker->scratch->trial.pose;
        task->expected_sigma = FLIPPED_SIGMA;
        body_fit(task, &task->expected, best);
    }
    tracker_add_elapsed(tracker, &tracker->times.search);
    for (int k = 0; k < LIMB_COUNT; k++)
        tracker->limb_relocated[k] = limb_moved_m(k, &fitted, &best->build) > LIMB_JUMP_M;
}

// Fits the body to this frame from the predicted pose. False: the person is lost.
static bool track_frame(struct tracker *tracker, struct fit_task *task, double dt_s)
{
    struct fit_result *best = &tracker->scratch->best;
    fit_frame(tracker, task, dt_s);
    try_alternatives(tracker, task);
    double explained = explained_share(tracker->evidence, best, ROUGHLY_M);
    tracker->poor_frames = explained < POOR_SHARE ? tracker->poor_frames + 1 : 0;
    const bool is_none = tracker->person_mean < NO_PERSON_LOG_ODDS;
    if (explained < LOST_SHARE || tracker->poor_frames > POOR_FRAMES_MAX || is_none)
        return false;
    if (task->learn_shape && explained_share(tracker->evidence, best, NEAR_M) > GOOD_SHARE)
        learn_shape(tracker, task, best, dt_s);
    else
        tracker->learned_s += dt_s;
    if (task->learn_shape && tracker->frames % HEM_EVERY == 0)
        update_hem(tracker, task);
    return true;
}

// Takes the pose and shape in scratch->best as those of a newly detected person.
static void adopt_fit(struct tracker *tracker, const struct fit_task *task)
{
    if (!tracker->backward) { // backward, the shape is known
        tracker->shape = task->shape;
        tracker->shape.mean = tracker->scratch->best.shape;
    }
    tracker->shape_pose = tracker->scratch->best.pose;
    tracker->learned_s = 0;
    tracker->hem = (struct hem_estimate){0};
    tracker->frames = 0;
}

// Of what may be a person, the likeliest first, the first one that is by the network: the evidence and its joints are
// then that one's. False: none is.
static bool find_likely_person(struct tracker *tracker, struct fit_task *task, const uint16_t *depth)
{
    for (int i = 0; tracker->person_log_odds < PERSON_LOG_ODDS; i++) {
        if (i == CANDIDATES || segmenter_next_candidate(tracker->segmenter, depth, tracker->mask) != OK ||
            !evidence_read(tracker->evidence, depth, tracker->mask, tracker->options.points))
            return false;
        tracker_find_joints(tracker, task);
        tracker_take_points(tracker, task);
    }
    return true;
}

// The body in scratch->best explains the points as a person's does.
static bool fits_well(const struct tracker *tracker)
{
    const struct fit_result *best = &tracker->scratch->best;
    return explained_share(tracker->evidence, best, NEAR_M) > EXPLAINED_SHARE_MIN && best->energy < FIT_ENERGY_MAX &&
           shape_log_odds(&best->shape) < STATIC_SHAPE_MAX;
}

// Detects a person from scratch. False: there is none.
static bool detect_person(struct tracker *tracker, struct fit_task *task, const uint16_t *depth)
{
    if (tracker->refused_wait > 0) {
        tracker->refused_wait--;
        return false;
    }
    struct joint_evidence told[2];
    bool found = find_likely_person(tracker, task, depth);
    if (found) {
        tracker_find_both_sides(tracker, told);
        found = pose_init_search(task, told, tracker->scratch) &&
                (tracker->person_log_odds > SURE_LOG_ODDS || fits_well(tracker));
    }
    tracker_add_elapsed(tracker, &tracker->times.search);
    if (!found) {
        tracker->refused_wait = REFUSED_WAIT;
        segmenter_drop_person(tracker->segmenter);
        return false;
    }
    tracker->detection_count++;
    tracker->cropped = evidence_cropped_edges(tracker->evidence);
    adopt_fit(tracker, task);
    return true;
}

// The followed person's pose and shape were wrong: those in scratch->best replace them.
static void replace_fit(struct tracker *tracker, const struct fit_task *task)
{
    adopt_fit(tracker, task);
    tracker->flipped = true; // a jump, no motion
    tracker->flip_log_odds = 0;
    memset(tracker->limb_relocated, 0, sizeof tracker->limb_relocated);
}

// Of a person cropped by the image's edge, or just entering, a leg may have been taken for the whole body, and tracking
// would keep that. When fewer edges crop the person, detects the person again from scratch.
static void reinitialise(struct tracker *tracker, struct fit_task *task)
{
    unsigned before = tracker->cropped, now = evidence_cropped_edges(tracker->evidence);
    if (tracker->backward || !task->joints || __builtin_popcount(now) >= __builtin_popcount(before))
        return;
    struct joint_evidence told[2];
    tracker->cropped = now;
    tracker_find_both_sides(tracker, told);
    if (pose_reinit(task, told, before & ~now & CROP_BOTTOM, tracker->scratch))
        replace_fit(tracker, task);
    tracker_add_elapsed(tracker, &tracker->times.search);
}

// What has been static, does not fit a person well and is none by the network, or by colour, is furniture.
static bool is_static_object(const struct tracker *tracker)
{
    if (tracker->backward || segmenter_static_frames(tracker->segmenter) < STATIC_FRAMES_MIN)
        return false;
    const bool well = fits_well(tracker);
    return tracker_points_deny_person(tracker, well) || (!well && tracker->person_mean < 0);
}

// Drops the followed person, who is lost or a static object, and segments again. False: there is no other person.
static bool find_other_person(struct tracker *tracker, struct fit_task *task, const uint16_t *depth)
{
    tracker_drop_person(tracker);
    bool there = tracker_segment_new_person(tracker, depth) == OK &&
                 evidence_read(tracker->evidence, depth, tracker->mask, tracker->options.points);
    if (there) {
        tracker_find_joints(tracker, task);
        tracker_take_points(tracker, task);
    }
    tracker_add_elapsed(tracker, &tracker->times.segment);
    return there;
}

bool tracker_decide(struct tracker *tracker, struct tracked_frame *frame)
{
    struct fit_task *task = &frame->task;
    tracker->static_object_frames = 0;
    if (frame->has_evidence)
        tracker_count_unconfirmed(tracker);
    bool followed = frame->has_evidence && tracker->following && track_frame(tracker, task, frame->dt_s);
    if (followed && is_static_object(tracker)) {
        tracker->static_object_frames = LEARN_EVERY * segmenter_static_frames(tracker->segmenter);
        segmenter_absorb_static(tracker->segmenter);
        tracker->unconfirmed_images = 0;
        followed = false;
    }
    if (frame->has_evidence && tracker->following && !followed)
        frame->has_evidence = find_other_person(tracker, task, frame->depth);
    frame->detected = !tracker->following;
    if (!frame->has_evidence)
        return false;
    if (frame->detected && tracker_is_person_refused(tracker)) {
        segmenter_drop_person(tracker->segmenter);
        return false;
    }
    if (frame->detected)
        return tracker->following = detect_person(tracker, task, frame->depth);
    reinitialise(tracker, task);
    return true;
}
