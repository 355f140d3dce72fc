// Decides what a frame shows: fits the body, tries alternative poses, learns the shape, detects a person from scratch
// and rejects static objects.
#include "capture/tracking/tracker_internal.h"
#include "base/portable_math.h"

#include "capture/tracking/point_hypotheses.h"
#include "capture/tracking/person_check.h"
#include "capture/tracking/pose_init.h"

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
static double novelty(const struct tracker *t, const struct body_pose *pose)
{
    double sum = 0;
    for (int s = 0; s < SEG_COUNT; s++) {
        struct vec3 rotation =
            quat_to_rotation_vector(quat_multiply(pose->rotation[s], quat_conjugate(t->shape_pose.rotation[s])));
        sum += v3_dot(rotation, rotation);
    }
    double angle = sqrt(sum / SEG_COUNT);
    return LEARN_RATE_MIN + LEARN_RATE_NEW_POSE * fmin(1, angle / NEW_POSE_RADIANS) * fmin(1, angle / NEW_POSE_RADIANS);
}

static void learn_shape(struct tracker *t, const struct fit_task *task, const struct fit_result *fit, double dt_s)
{
    t->shape.mean = fit->shape;
    for (int a = 0; a < SHAPE_COUNT; a++)
        for (int b = 0; b < SHAPE_COUNT; b++)
            t->shape.information[a][b] += task->learn_rate * fit->shape_information[a][b];
    t->learned_s += dt_s;
    if (task->learn_rate > MUCH_LEARNED_RATE)
        t->shape_pose = fit->pose;
}

static bool is_uncropped(const struct depth_evidence *e)
{
    return !(evidence_cropped_edges(e) & (CROP_LEFT | CROP_RIGHT | CROP_BOTTOM));
}

// Accumulates a pose's log-odds over the trials. True: they reached `enough`, and start from 0 again.
static bool accumulate_log_odds(double *evidence, double gain, double enough, bool pointed)
{
    const double most = (pointed ? POINTED_TRIAL_SHARE : TRIAL_SHARE) * enough;
    *evidence = fmax(0, DECAY * *evidence + fmin(gain, most));
    if (*evidence < enough)
        return false;
    *evidence = 0;
    return true;
}

// Log-odds that the person walks ahead and not backwards.
static double walking_log_odds(const struct tracker *t)
{
    struct vec3 ahead = body_axis(&t->scratch->best.build, SEG_PELVIS, 2);
    return (t->backward ? -WALKING_LOG_ODDS : WALKING_LOG_ODDS) *
           fmax(-1, fmin(1, -v3_dot(t->filter.speed[JOINT_WAIST], ahead) / WALKING_M_S));
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
static struct trial choose_trial(struct tracker *t, const struct fit_task *task)
{
    const int every = t->frames < FLIP_START_FRAMES ? FLIP_EVERY / 2 : FLIP_EVERY;
    if (task->points) {
        const struct fit_result *best = &t->scratch->best;
        const struct body_pose flipped = body_pose_flip_facing(&best->shape, &best->pose),
                               exchanged = legs_swapped_pose(best);
        const double flip = points_log_odds(task, best, &flipped), legs = points_log_odds(task, best, &exchanged);
        t->pointed_frames++;
        if (fmax(flip, legs) > POINTS_FAVOUR)
            return (struct trial){flip > legs, flip <= legs, true};
        if (is_uncropped(t->evidence))
            return (struct trial){t->pointed_frames % 2, t->pointed_frames % 2 == 0, false};
    }
    if (!is_uncropped(t->evidence) || tracker_points_decide(t)) // of depth, only feet tell
        return (struct trial){false, false, false};
    return (struct trial){t->frames % every == 0, t->frames % every == every / 2, false};
}

// Depth shows a person from the front and from behind alike, and legs that crossed. Periodically the flipped body and
// the exchanged legs are tried: true when one of them has become likelier; it is then in scratch->trial.
static bool is_flipped_likelier(struct tracker *t, const struct fit_task *task)
{
    const double energy = t->scratch->best.energy;
    const struct trial trial = choose_trial(t, task);
    if (trial.flip) {
        t->flip_gain = flipped_log_odds(task, t->scratch) - FLIP_REFIT_SHARE * energy + walking_log_odds(t);
        return t->flipped = accumulate_log_odds(&t->flip_log_odds, t->flip_gain, FLIP_LOG_ODDS, trial.pointed);
    }
    if (!trial.legs)
        return false;
    bool alike = task->shape.mean.hem_m > 0 || task->points; // both ways are fitted alike
    t->leg_swap_gain = legs_swapped_log_odds(task, t->scratch) - SWAP_REFIT_SHARE * energy;
    return accumulate_log_odds(&t->leg_swap_log_odds, t->leg_swap_gain, alike ? SKIRT_SWAP_LOG_ODDS : LEG_SWAP_LOG_ODDS,
                               trial.pointed);
}

// An arm fitted in front of the trunk may leave nothing unexplained although it is elsewhere: one arm a frame is tried,
// or the limb that points dispute. What they favour is not tried in the frames between them, where they are missing.
static void try_limb_alternative(struct tracker *t, struct fit_task *task)
{
    const int disputed = point_disputed_limb(task->points, &t->scratch->best.build),
              arm = disputed >= 0 ? disputed : t->frames % 2;
    if (!task->points && tracker_points_decide(t) && t->limb_log_odds[arm] > 0)
        return;
    t->limb_gain[arm] = limb_alternative_log_odds(task, arm, t->scratch) - ARM_COST;
    if (!accumulate_log_odds(&t->limb_log_odds[arm], t->limb_gain[arm], ARM_LOG_ODDS, disputed >= 0))
        return;
    task->expected = t->scratch->best.pose;
    limb_copy(arm, &t->scratch->trial.pose, &task->expected);
    task->expected_sigma = RELOCATED_SIGMA;
    body_fit(task, &task->expected, &t->scratch->best);
}

// The person turned out to wear a skirt or a coat, or none: learns the shape again from scratch.
static void reset_clothing(struct tracker *t)
{
    double scale_log = t->shape.mean.log[SHAPE_SCALE];
    t->shape = shape_prior_default();
    t->shape.mean.log[SHAPE_SCALE] = scale_log;
    t->learned_s = 0;
}

// Measures the hem and puts it into the shape.
static void update_hem(struct tracker *t, const struct fit_task *task)
{
    const struct body_build *build = &t->scratch->best.build;
    double height = portable_exp(t->shape.mean.log[SHAPE_SCALE]) * BODY_AVERAGE_HEIGHT_M;
    struct vec3 spine = body_axis(build, SEG_PELVIS, 1);
    struct hem hem;
    if (v3_dot(spine, task->up) < UPRIGHT_COSINE || !hem_detect(task, height, &hem))
        return;
    hem_update(&t->hem, &hem, v3_dot(task->up, build->origin[SEG_PELVIS]) + task->floor_m);
    if (t->hem.count < HEM_FRAMES_MIN)
        return;
    bool wears = t->shape.mean.hem_m > 0, worn = hem_is_worn(t->hem.narrow, t->hem.wide_m, height, wears);
    if (worn != wears)
        reset_clothing(t);
    t->shape.mean.hem_m = worn ? t->hem.below_m : 0;
    t->shape.mean.hem_radius_m = worn ? 0.5 * t->hem.wide_m : 0;
}

// The coarse and the fine fit from the predicted pose.
static void fit_frame(struct tracker *t, struct fit_task *task, double dt_s)
{
    struct fit_result *best = &t->scratch->best;
    task->learn_shape = false;
    task->expected_sigma = fmin(EXPECTED_SIGMA_MAX, fmax(1, dt_s * 30)); // frames at 30 Hz
    int first = t->options.iterations / 2;
    task->iterations = first;
    task->kernel_m = COARSE_KERNEL_M;
    struct body_pose start = task->expected;
    if (first > 0) {
        task->pose_only = true;
        body_fit(task, &start, best);
        start = best->pose;
        task->pose_only = false;
    }
    task->iterations = t->options.iterations - first;
    task->kernel_m = FINE_KERNEL_M;
    task->learn_shape = t->learned_s < t->options.learn_s && !t->backward;
    task->learn_rate = novelty(t, &start);
    body_fit(task, &start, best);
    tracker_add_elapsed(t, &t->times.fit);
}

// Tries other places of limbs, the flipped body and exchanged legs, and adopts what has become likelier.
static void try_alternatives(struct tracker *t, struct fit_task *task)
{
    struct fit_result *best = &t->scratch->best;
    struct body_build fitted = best->build;
    if (explained_share(t->evidence, best, NEAR_M) < GOOD_SHARE && limb_search(task, t->scratch)) {
        struct body_pose start = best->pose;
        task->shape.mean = best->shape;
        body_fit(task, &start, &t->scratch->trial);
        *best = t->scratch->trial;
    }
    try_limb_alternative(t, task);
    t->frames++;
    t->flipped = false;
    if (is_flipped_likelier(t, task)) {
        task->expected = t->scratch->trial.pose;
        task->expected_sigma = FLIPPED_SIGMA;
        body_fit(task, &task->expected, best);
    }
    tracker_add_elapsed(t, &t->times.search);
    for (int k = 0; k < LIMB_COUNT; k++)
        t->limb_relocated[k] = limb_moved_m(k, &fitted, &best->build) > LIMB_JUMP_M;
}

// Fits the body to this frame from the predicted pose. False: the person is lost.
static bool track_frame(struct tracker *t, struct fit_task *task, double dt_s)
{
    struct fit_result *best = &t->scratch->best;
    fit_frame(t, task, dt_s);
    try_alternatives(t, task);
    double explained = explained_share(t->evidence, best, ROUGHLY_M);
    t->poor_frames = explained < POOR_SHARE ? t->poor_frames + 1 : 0;
    if (explained < LOST_SHARE || t->poor_frames > POOR_FRAMES_MAX)
        return false;
    if (task->learn_shape && explained_share(t->evidence, best, NEAR_M) > GOOD_SHARE)
        learn_shape(t, task, best, dt_s);
    else
        t->learned_s += dt_s;
    if (task->learn_shape && t->frames % HEM_EVERY == 0)
        update_hem(t, task);
    return true;
}

// Takes the pose and shape in scratch->best as those of a newly detected person.
static void adopt_fit(struct tracker *t, const struct fit_task *task)
{
    if (!t->backward) { // backward, the shape is known
        t->shape = task->shape;
        t->shape.mean = t->scratch->best.shape;
    }
    t->shape_pose = t->scratch->best.pose;
    t->learned_s = 0;
    t->hem = (struct hem_estimate){0};
    t->frames = 0;
    t->flip_gain = t->leg_swap_gain = 0;
    t->restart_rate = RESTART_RATE_MAX;
    memset(t->limb_gain, 0, sizeof t->limb_gain);
}

// Detects a person from scratch. False: there is none.
static bool detect_person(struct tracker *t, struct fit_task *task)
{
    if (t->refused_wait > 0) {
        t->refused_wait--;
        return false;
    }
    bool found = pose_init_search(task, t->scratch) && (t->backward || is_like_person(t->evidence, &t->scratch->best));
    tracker_add_elapsed(t, &t->times.search);
    if (!found) {
        t->refused_wait = REFUSED_WAIT;
        segmenter_drop_person(t->segmenter);
        return false;
    }
    t->detection_count++;
    t->cropped = evidence_cropped_edges(t->evidence);
    adopt_fit(t, task);
    return true;
}

// The followed person's pose and shape were wrong: those in scratch->best replace them.
static void replace_fit(struct tracker *t, const struct fit_task *task)
{
    adopt_fit(t, task);
    t->flipped = true; // a jump, no motion
    t->flip_log_odds = t->leg_swap_log_odds = 0;
    memset(t->limb_log_odds, 0, sizeof t->limb_log_odds);
    memset(t->limb_relocated, 0, sizeof t->limb_relocated);
}

// A wrong start, or a wrong decision since, would be followed to the end: tries other starts, one at a time, more often
// at first and while the fit is poor.
static void try_restart(struct tracker *t, struct fit_task *task)
{
    bool doubtful = t->frames < RESTART_FIRST_FRAMES || t->scratch->best.energy > DOUBTFUL_ENERGY;
    if (!task->points && tracker_points_decide(t)) // their evidence would be missing
        return;
    if (t->backward || ++t->restart_wait < (doubtful ? RESTART_EVERY_DOUBTFUL : RESTART_EVERY))
        return;
    t->restart_wait = 0;
    const bool replaced = pose_restart(task, &t->scratch->best.pose, t->restart_turn++, t->scratch);
    t->restart_rate = fmin(RESTART_RATE_MAX, RESTART_FORGETS * t->restart_rate);
    if (t->scratch->other_rate > 0)
        t->restart_rate = fmin(t->restart_rate, t->scratch->other_rate);
    if (replaced)
        replace_fit(t, task);
    tracker_add_elapsed(t, &t->times.search);
}

// Of a person cropped by the image's edge, or just entering, a leg may have been taken for the whole body, and tracking
// would keep that. When fewer edges crop the person, detects the person again from scratch.
static void reinitialise(struct tracker *t, struct fit_task *task)
{
    unsigned before = t->cropped, now = evidence_cropped_edges(t->evidence);
    if (t->backward || __builtin_popcount(now) >= __builtin_popcount(before))
        return;
    t->cropped = now;
    if (pose_reinit(task, &t->scratch->best.pose, before & ~now & CROP_BOTTOM, t->scratch))
        replace_fit(t, task);
    tracker_add_elapsed(t, &t->times.search);
}

// What has been static and does not fit a person well is furniture if there is another person who fits well. On false,
// the evidence and scratch->best are those of the followed person again.
static bool is_static_object(struct tracker *t, struct fit_task *task, const uint16_t *depth)
{
    struct fit_result *best = &t->scratch->best;
    if (t->backward || segmenter_static_frames(t->segmenter) < STATIC_FRAMES_MIN)
        return false;
    const bool fits_well = explained_share(t->evidence, best, NEAR_M) > EXPLAINED_SHARE_MIN &&
                           best->energy < FIT_ENERGY_MAX && shape_log_odds(&best->shape) < STATIC_SHAPE_MAX;
    if (tracker_points_deny_person(t, fits_well))
        return true;
    if (t->frames % SECOND_PERSON_EVERY || fits_well)
        return false;
    struct body_pose pose = best->pose;
    struct body_shape shape = best->shape;
    struct fit_task other = *task;
    other.points = NULL; // they are the followed person's
    if (segmenter_second_person(t->segmenter, depth, t->second_mask) == OK &&
        evidence_read(t->evidence, depth, t->second_mask, t->options.points) && pose_init_search(&other, t->scratch) &&
        explained_share(t->evidence, best, NEAR_M) > EXPLAINED_SHARE_MIN)
        return true;
    if (!evidence_read(t->evidence, depth, t->mask, t->options.points))
        return true; // cannot happen: the same mask was read before
    body_evaluate(task, &pose, &shape, best);
    return false;
}

// Drops the followed person, who is lost or a static object, and segments again. False: there is no other person.
static bool find_other_person(struct tracker *t, struct fit_task *task, const uint16_t *depth)
{
    tracker_drop_person(t);
    bool there =
        tracker_segment_new_person(t, depth) == OK && evidence_read(t->evidence, depth, t->mask, t->options.points);
    if (there)
        tracker_take_points(t, task);
    tracker_add_elapsed(t, &t->times.segment);
    return there;
}

bool tracker_decide(struct tracker *t, struct tracked_frame *frame)
{
    struct fit_task *task = &frame->task;
    t->static_object_frames = 0;
    if (frame->has_evidence)
        tracker_count_unconfirmed(t);
    bool followed = frame->has_evidence && t->following && track_frame(t, task, frame->dt_s);
    if (followed && is_static_object(t, task, frame->depth)) {
        t->static_object_frames = LEARN_EVERY * segmenter_static_frames(t->segmenter);
        segmenter_absorb_static(t->segmenter);
        t->unconfirmed_images = 0;
        followed = false;
    }
    if (frame->has_evidence && t->following && !followed)
        frame->has_evidence = find_other_person(t, task, frame->depth);
    frame->detected = !t->following;
    if (!frame->has_evidence)
        return false;
    if (frame->detected && tracker_is_person_refused(t)) {
        segmenter_drop_person(t->segmenter);
        return false;
    }
    if (frame->detected)
        return t->following = detect_person(t, task);
    reinitialise(t, task);
    try_restart(t, task);
    return true;
}
