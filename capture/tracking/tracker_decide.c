// Decides what a frame shows: fits the body, tries alternative poses, learns the shape, detects a person from scratch
// and rejects static objects.
#include "base/portable_math.h"
#include "capture/tracking/person_check.h"
#include "capture/tracking/point_hypotheses.h"
#include "capture/tracking/pose_init.h"
#include "capture/tracking/tracker_internal.h"

#include <string.h>

// Of the energy of other starts over the fit's: beyond the first they are out of question; a trial's value rises by the
// second with each further trial, as it is forgotten.
#define RESTART_RATE_MAX 3.0
#define RESTART_FORGETS  1.03

// Frame counts, for 30 Hz.
enum {
    FLIP_EVERY = 4,          // how often facing and exchanged legs are tried,
    FLIP_START_FRAMES = 24,  // at first (0.8 s) twice as often
    HEM_EVERY = 4,           // how often the hem is measured
    HEM_FRAMES_MIN = 8,      // measurements that decide whether there is one
    STATIC_FRAMES_MIN = 12,  // updates of the background model, 0.8 s; people in recordings reached 3
    SECOND_PERSON_EVERY = 5, // how often a second person is looked for
    RESTART_EVERY = 12,      // how often another start is tried,
    RESTART_EVERY_DOUBTFUL = 2,
    RESTART_FIRST_FRAMES = 30, // at first, too
    REFUSED_WAIT = 4,          // frames until a component that was no person is looked at again
    POOR_FRAMES_MAX = 12,      // consecutive frames (0.4 s) with a poor fit, after which the person is lost
};

// Shares of the points within a distance of the body.
#define NEAR_M              0.06
#define ROUGHLY_M           0.10
#define EXPLAINED_SHARE_MIN 0.97  // within NEAR_M, of a person: of furniture fewer are,
#define FIT_ENERGY_MAX      120.0 // or its fit has more energy: people's have 25 to 60 on rendered films
#define DOUBTFUL_ENERGY     60.0  // a fit's energy above which other starts are tried often
#define STATIC_SHAPE_MAX    10.0  // or has an unlikely shape: log-odds against it; of right people's 1 in 100 is above
#define GOOD_SHARE          0.985 // within NEAR_M: below, limbs are searched and no shape is learned
#define POOR_SHARE          0.7   // within ROUGHLY_M: below, the frame is poor
#define LOST_SHARE          0.35  // within ROUGHLY_M: below, the person is lost immediately
#define LIMB_JUMP_M         0.08  // a limb that a search moves further than this was lost

// Fits: a coarse half of the iterations with a wide kernel, a fine half with a narrow one.
#define COARSE_KERNEL_M    0.12
#define FINE_KERNEL_M      0.06
#define EXPECTED_SIGMA_MAX 6 // after a gap
#define RELOCATED_SIGMA    2 // about an alternative pose of an arm
#define FLIPPED_SIGMA      4 // about the flipped body

// Log-odds that are needed to change the pose, accumulated with DECAY a trial; at most TRIAL_SHARE from one trial:
// while something is lost, any other pose fits better. Chosen by hand; docs/results.md measures the outcome.
#define DECAY               0.9
#define TRIAL_SHARE         0.4
#define POINTED_TRIAL_SHARE 0.6 // the same where colour's points favour it as well: two images must agree
#define FLIP_LOG_ODDS       20
#define LEG_SWAP_LOG_ODDS   20
#define SKIRT_SWAP_LOG_ODDS 10 // of legs in a skirt
#define ARM_LOG_ODDS        3
#define ARM_COST            0.5 // log-odds against an alternative pose of an arm
#define POINTS_FAVOUR       3   // log-odds of the colour image's points for another pose: it is tried right away
// A new fit of any pose gains about a tenth of the energy; badly explained legs gain more. Of legs in a skirt less is
// visible, and both ways are fitted alike.
#define FLIP_REFIT_SHARE 0.1
#define SWAP_REFIT_SHARE 0.02
#define WALKING_LOG_ODDS 6.0 // for walking ahead at WALKING_M_S or faster
#define WALKING_M_S      0.5

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

static bool is_uncropped(const struct depth_evidence *evidence)
{
    return !(evidence_cropped_edges(evidence) & (CROP_LEFT | CROP_RIGHT | CROP_BOTTOM));
}

// Accumulates a pose's log-odds over the trials. True: they reached `enough`, and start from 0 again.
static bool accumulate_log_odds(double *evidence, double gain, double enough, bool pointed)
{
    const double max = (pointed ? POINTED_TRIAL_SHARE : TRIAL_SHARE) * enough;
    *evidence = fmax(0, DECAY * *evidence + fmin(gain, max));
    if (*evidence < enough)
        return false;
    *evidence = 0;
    return true;
}

// Log-odds that the person walks ahead and not backwards.
static double walking_log_odds(const struct tracker *tracker)
{
    struct vec3 ahead = body_axis(&tracker->scratch->best.build, SEG_PELVIS, 2);
    return (tracker->backward ? -WALKING_LOG_ODDS : WALKING_LOG_ODDS) *
           fmax(-1, fmin(1, -v3_dot(tracker->filter.speed[JOINT_WAIST], ahead) / WALKING_M_S));
}

// Log-odds of the colour image's points alone for a pose against the fitted one.
static double points_log_odds(const struct fit_task *task, const struct fit_result *best, const struct body_pose *pose)
{
    struct body_build build;
    body_forward_kinematics(&best->shape, pose, &build);
    return point_evidence_energy(task->points, &best->build, NULL) - point_evidence_energy(task->points, &build, NULL);
}

struct trial {
    bool flip, legs; // at most one
    bool pointed;    // the points favour it
};

// Which of the two a frame tries. In frames with points that which they favour, else one after the other, and none in
// the frames between them, in which the points' evidence is missing.
static struct trial choose_trial(struct tracker *tracker, const struct fit_task *task)
{
    const int every = tracker->frames < FLIP_START_FRAMES ? FLIP_EVERY / 2 : FLIP_EVERY;
    if (task->points) {
        const struct fit_result *best = &tracker->scratch->best;
        const struct body_pose flipped = body_pose_flip_facing(&best->shape, &best->pose),
                               exchanged = legs_swapped_pose(best);
        const double flip = points_log_odds(task, best, &flipped), legs = points_log_odds(task, best, &exchanged);
        tracker->pointed_frames++;
        if (fmax(flip, legs) > POINTS_FAVOUR)
            return (struct trial){flip > legs, flip <= legs, true};
        if (is_uncropped(tracker->evidence))
            return (struct trial){tracker->pointed_frames % 2, tracker->pointed_frames % 2 == 0, false};
    }
    if (!is_uncropped(tracker->evidence) || tracker_points_decide(tracker)) // of depth, only feet tell
        return (struct trial){false, false, false};
    return (struct trial){tracker->frames % every == 0, tracker->frames % every == every / 2, false};
}

// Depth shows a person from the front and from behind alike, and legs that crossed. Periodically the flipped body and
// the exchanged legs are tried: true when one of them has become likelier; it is then in scratch->trial.
static bool is_flipped_likelier(struct tracker *tracker, const struct fit_task *task)
{
    const double energy = tracker->scratch->best.energy;
    const struct trial trial = choose_trial(tracker, task);
    if (trial.flip) {
        tracker->flip_gain =
            flipped_log_odds(task, tracker->scratch) - FLIP_REFIT_SHARE * energy + walking_log_odds(tracker);
        return tracker->flipped =
                   accumulate_log_odds(&tracker->flip_log_odds, tracker->flip_gain, FLIP_LOG_ODDS, trial.pointed);
    }
    if (!trial.legs)
        return false;
    bool alike = task->shape.mean.hem_m > 0 || task->points; // both ways are fitted alike
    tracker->leg_swap_gain = legs_swapped_log_odds(task, tracker->scratch) - SWAP_REFIT_SHARE * energy;
    return accumulate_log_odds(&tracker->leg_swap_log_odds, tracker->leg_swap_gain,
                               alike ? SKIRT_SWAP_LOG_ODDS : LEG_SWAP_LOG_ODDS, trial.pointed);
}

// An arm fitted in front of the trunk may leave nothing unexplained although it is elsewhere: one arm a frame is tried,
// or the limb that points dispute. What they favour is not tried in the frames between them, where they are missing.
static void try_limb_alternative(struct tracker *tracker, struct fit_task *task)
{
    const int disputed = point_disputed_limb(task->points, &tracker->scratch->best.build),
              arm = disputed >= 0 ? disputed : tracker->frames % 2;
    if (!task->points && tracker_points_decide(tracker) && tracker->limb_log_odds[arm] > 0)
        return;
    tracker->limb_gain[arm] = limb_alternative_log_odds(task, arm, tracker->scratch) - ARM_COST;
    if (!accumulate_log_odds(&tracker->limb_log_odds[arm], tracker->limb_gain[arm], ARM_LOG_ODDS, disputed >= 0))
        return;
    task->expected = tracker->scratch->best.pose;
    limb_copy(arm, &tracker->scratch->trial.pose, &task->expected);
    task->expected_sigma = RELOCATED_SIGMA;
    body_fit(task, &task->expected, &tracker->scratch->best);
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

// Tries other places of limbs, the flipped body and exchanged legs, and adopts what has become likelier.
static void try_alternatives(struct tracker *tracker, struct fit_task *task)
{
    struct fit_result *best = &tracker->scratch->best;
    struct body_build fitted = best->build;
    if (explained_share(tracker->evidence, best, NEAR_M) < GOOD_SHARE && limb_search(task, tracker->scratch)) {
        struct body_pose start = best->pose;
        task->shape.mean = best->shape;
        body_fit(task, &start, &tracker->scratch->trial);
        *best = tracker->scratch->trial;
    }
    try_limb_alternative(tracker, task);
    tracker->frames++;
    tracker->flipped = false;
    if (is_flipped_likelier(tracker, task)) {
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
    if (explained < LOST_SHARE || tracker->poor_frames > POOR_FRAMES_MAX)
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
    tracker->flip_gain = tracker->leg_swap_gain = 0;
    tracker->restart_rate = RESTART_RATE_MAX;
    memset(tracker->limb_gain, 0, sizeof tracker->limb_gain);
}

// Detects a person from scratch. False: there is none.
static bool detect_person(struct tracker *tracker, struct fit_task *task)
{
    if (tracker->refused_wait > 0) {
        tracker->refused_wait--;
        return false;
    }
    bool found = pose_init_search(task, tracker->scratch) &&
                 (tracker->backward || is_like_person(tracker->evidence, &tracker->scratch->best));
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
    tracker->flip_log_odds = tracker->leg_swap_log_odds = 0;
    memset(tracker->limb_log_odds, 0, sizeof tracker->limb_log_odds);
    memset(tracker->limb_relocated, 0, sizeof tracker->limb_relocated);
}

// A wrong start, or a wrong decision since, would be followed to the end: tries other starts, one at a time, more often
// at first and while the fit is poor.
static void try_restart(struct tracker *tracker, struct fit_task *task)
{
    bool doubtful = tracker->frames < RESTART_FIRST_FRAMES || tracker->scratch->best.energy > DOUBTFUL_ENERGY;
    if (!task->points && tracker_points_decide(tracker)) // their evidence would be missing
        return;
    if (tracker->backward || ++tracker->restart_wait < (doubtful ? RESTART_EVERY_DOUBTFUL : RESTART_EVERY))
        return;
    tracker->restart_wait = 0;
    const bool replaced = pose_restart(task, &tracker->scratch->best.pose, tracker->restart_turn++, tracker->scratch);
    tracker->restart_rate = fmin(RESTART_RATE_MAX, RESTART_FORGETS * tracker->restart_rate);
    if (tracker->scratch->other_rate > 0)
        tracker->restart_rate = fmin(tracker->restart_rate, tracker->scratch->other_rate);
    if (replaced)
        replace_fit(tracker, task);
    tracker_add_elapsed(tracker, &tracker->times.search);
}

// Of a person cropped by the image's edge, or just entering, a leg may have been taken for the whole body, and tracking
// would keep that. When fewer edges crop the person, detects the person again from scratch.
static void reinitialise(struct tracker *tracker, struct fit_task *task)
{
    unsigned before = tracker->cropped, now = evidence_cropped_edges(tracker->evidence);
    if (tracker->backward || __builtin_popcount(now) >= __builtin_popcount(before))
        return;
    tracker->cropped = now;
    if (pose_reinit(task, &tracker->scratch->best.pose, before & ~now & CROP_BOTTOM, tracker->scratch))
        replace_fit(tracker, task);
    tracker_add_elapsed(tracker, &tracker->times.search);
}

// What has been static and does not fit a person well is furniture if there is another person who fits well. On false,
// the evidence and scratch->best are those of the followed person again.
static bool is_static_object(struct tracker *tracker, struct fit_task *task, const uint16_t *depth)
{
    struct fit_result *best = &tracker->scratch->best;
    if (tracker->backward || segmenter_static_frames(tracker->segmenter) < STATIC_FRAMES_MIN)
        return false;
    const bool fits_well = explained_share(tracker->evidence, best, NEAR_M) > EXPLAINED_SHARE_MIN &&
                           best->energy < FIT_ENERGY_MAX && shape_log_odds(&best->shape) < STATIC_SHAPE_MAX;
    if (tracker_points_deny_person(tracker, fits_well))
        return true;
    if (tracker->frames % SECOND_PERSON_EVERY || fits_well)
        return false;
    struct body_pose pose = best->pose;
    struct body_shape shape = best->shape;
    struct fit_task other = *task;
    other.points = NULL; // they are the followed person's
    if (segmenter_second_person(tracker->segmenter, depth, tracker->second_mask) == OK &&
        evidence_read(tracker->evidence, depth, tracker->second_mask, tracker->options.points) &&
        pose_init_search(&other, tracker->scratch) &&
        explained_share(tracker->evidence, best, NEAR_M) > EXPLAINED_SHARE_MIN)
        return true;
    if (!evidence_read(tracker->evidence, depth, tracker->mask, tracker->options.points))
        return true; // cannot happen: the same mask was read before
    body_evaluate(task, &pose, &shape, best);
    return false;
}

// Drops the followed person, who is lost or a static object, and segments again. False: there is no other person.
static bool find_other_person(struct tracker *tracker, struct fit_task *task, const uint16_t *depth)
{
    tracker_drop_person(tracker);
    bool there = tracker_segment_new_person(tracker, depth) == OK &&
                 evidence_read(tracker->evidence, depth, tracker->mask, tracker->options.points);
    if (there)
        tracker_take_points(tracker, task);
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
    if (followed && is_static_object(tracker, task, frame->depth)) {
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
        return tracker->following = detect_person(tracker, task);
    reinitialise(tracker, task);
    try_restart(tracker, task);
    return true;
}
