#include "capture/tracking/limb_hypotheses.h"

#include "capture/body/solid_distance.h"
#include "capture/body/two_bone_ik.h"
#include "capture/tracking/point_hypotheses.h"

// Chosen by hand; docs/results.md measures the outcome.
#define LIMB_MOVE_ENERGY  20   // energy that a limb must gain for each metre that a search moves it
#define FLIP_SIGMA        4    // expected_sigma of fits about the flipped body,
#define SWAP_SIGMA        2    // about exchanged legs,
#define MOVE_SIGMA        1.5  // and about a moved limb
#define REFIT_RATE        0.0  // of the energy: a fit that gains less than minus this is no candidate
#define UNEXPLAINED_M     0.04 // a point is unexplained this far off the body, and one and a half standard deviations
#define UNEXPLAINED_SHARE 0.008
#define MISPLACED_ENERGY  6    // a limb's energy in free space above which it is misplaced
#define ENOUGH_RATE       0.97 // a search must reduce the energy to this share,
#define ENOUGH_ENERGY     0.5  // and by this
#define REACH_RATE        1.25 // of a limb's length, within which points may be its own, for the search
#define CLOSE_REACH_RATE  1.15 // and for alternatives
#define REACH_M           0.05 // and so much more: its thickness
#define OFF_BODY_M        0.01 // points nearer to the rest of the body than this do not count for a limb
#define TARGET_OFF_M      0.02 // and targets are further off than this and a standard deviation
#define ELBOW_SLACK_M     0.10 // a point at the upper segment's length, this much more or less, may be the elbow
enum {
    GAIN_ITERATIONS = 5,
    QUICK_ITERATIONS = 4,
    GAIN_STRIDE = 2,
    UNEXPLAINED_MIN = 5,
    OWN_MIN = 3,
    SEARCH_ROUNDS = 2, // the limb that gains most first; then another one may take its points
};

// The energy gained by a fit from `pose` against the pose in scratch->best.
static double energy_gain(const struct fit_task *given, const struct body_pose *pose, double expected_sigma,
                          struct fit_scratch *scratch)
{
    struct fit_task task = *given;
    struct body_pose now = scratch->best.pose;
    struct body_shape shape = scratch->best.shape;
    task.learn_shape = false;
    task.shape.mean = shape;
    task.kernel_m = SEARCH_KERNEL_M;
    task.expected = *pose;
    task.expected_sigma = expected_sigma;
    task.iterations = GAIN_ITERATIONS;
    task.point_stride = GAIN_STRIDE;
    body_evaluate(&task, &now, &shape, &scratch->trial);
    double energy = scratch->trial.energy;
    body_fit(&task, pose, &scratch->trial);
    return energy - scratch->trial.energy;
}

// The energy gained by a fit from `pose` against a fit from the pose in scratch->best: any new fit gains something. The
// second fit is only made where the first is not much worse than no fit at all. scratch->trial is the fit from `pose`.
static double fair_energy_gain(const struct fit_task *given, const struct body_pose *pose, double expected_sigma,
                               struct fit_scratch *scratch)
{
    double gain = energy_gain(given, pose, expected_sigma, scratch);
    if (gain < -REFIT_RATE * scratch->best.energy)
        return gain;
    struct body_pose now = scratch->best.pose;
    scratch->other = scratch->trial;
    gain -= energy_gain(given, &now, expected_sigma, scratch);
    scratch->trial = scratch->other;
    return gain;
}

double flipped_log_odds(const struct fit_task *given, struct fit_scratch *scratch)
{
    struct body_pose pose = body_pose_flip_facing(&scratch->best.shape, &scratch->best.pose);
    return energy_gain(given, &pose, FLIP_SIGMA, scratch);
}

static struct body_pose reach_target(const struct fit_result *from, const struct body_limb *limb, struct vec3 target,
                                     struct vec3 pole)
{
    struct body_pose pose = from->pose;
    pose.rotation[limb->end] = (struct quat){0, 0, 0, 1};
    two_bone_ik(&from->shape, &pose, limb->upper, target, pole);
    return pose;
}

struct unexplained {                 // unexplained points within a limb's reach
    struct vec3 far;                 // the farthest from its root
    struct vec3 own_far, own_middle; // of those nearer to this limb's root than to its counterpart's
    int count, own;
};

static struct unexplained find_unexplained(const struct depth_evidence *evidence, const struct fit_result *result,
                                           const struct body_limb *limb)
{
    struct vec3 base = result->build.origin[limb->upper], opposite = result->build.origin[body_mirror(limb->upper)];
    double reach = REACH_RATE * (v3_distance(base, result->build.origin[limb->lower]) +
                                 v3_distance(result->build.origin[limb->lower], result->build.origin[limb->end])) +
                   REACH_M;
    struct unexplained out = {.far = base, .own_far = base};
    for (int i = 0; i < evidence->count; i++) {
        struct vec3 p = evidence->point[i].p;
        double sigma = 1 / sqrt(evidence->point[i].weight), d = v3_distance(p, base);
        if ((double)result->residual[i] < UNEXPLAINED_M + 1.5 * sigma || d > reach)
            continue;
        out.count++;
        if (d > v3_distance(out.far, base))
            out.far = p;
        if (d > v3_distance(p, opposite))
            continue;
        out.own++;
        out.own_middle = v3_add(out.own_middle, p);
        if (d > v3_distance(out.own_far, base))
            out.own_far = p;
    }
    if (out.own)
        out.own_middle = v3_scale(out.own_middle, 1.0 / out.own);
    return out;
}

// Fits a pose and keeps it in scratch->other if it is the likeliest so far. *min: its energy. Moving a limb costs
// energy, so that a followed limb is not given up for a slightly better place.
static void try_pose(const struct fit_task *task, const struct body_pose *pose, struct fit_scratch *scratch,
                     double *min)
{
    struct fit_task quick = *task;
    quick.learn_shape = false;
    quick.shape.mean = scratch->best.shape;
    quick.iterations = QUICK_ITERATIONS;
    quick.expected = *pose;
    quick.expected_sigma = MOVE_SIGMA;
    body_fit(&quick, pose, &scratch->trial);
    double far = 0;
    for (int j = 0; j < JOINT_COUNT; j++)
        far = fmax(far, v3_distance(scratch->trial.build.joint[j], scratch->best.build.joint[j]));
    double energy = scratch->trial.energy + LIMB_MOVE_ENERGY * far;
    if (energy >= *min)
        return;
    *min = energy;
    scratch->other = scratch->trial;
}

enum { POLES = 3 };

// Directions in which a limb's middle joint may point: an elbow down, outward or back, a knee ahead. Returns their
// number.
static int find_poles(const struct fit_task *task, const struct fit_result *result, int k, struct vec3 out[POLES])
{
    struct vec3 ahead = body_axis(&result->build, SEG_PELVIS, 2);
    if (k >= FIRST_LEG) {
        out[0] = ahead;
        return 1;
    }
    out[0] = v3_scale(task->up, -1);
    out[1] = v3_scale(body_axis(&result->build, SEG_PELVIS, 0), k ? -1 : 1);
    out[2] = v3_scale(ahead, -1);
    return 3;
}

// Where the colour image's points have a limb, if they dispute where it is.
static void try_points(const struct fit_task *task, int k, struct fit_scratch *scratch, double *min)
{
    struct limb_target target[LIMB_TARGETS_MAX];
    if (!task->points || !point_limb_is_disputed(task->points, &scratch->best.build, k))
        return;
    const int count = point_limb_targets(task->points, &scratch->best.build, k, target);
    for (int i = 0; i < count; i++) {
        const struct body_pose pose = reach_target(&scratch->best, &body_limbs[k], target[i].end, target[i].pole);
        try_pose(task, &pose, scratch, min);
    }
}

static void try_limb(const struct fit_task *task, int k, struct fit_scratch *scratch, double *min)
{
    const struct body_limb *l = &body_limbs[k];
    const struct fit_result *best = &scratch->best;
    struct unexplained unexplained = find_unexplained(task->evidence, best, l);
    double misplaced_energy = best->limb_energy[l->upper] + best->limb_energy[l->lower] + best->limb_energy[l->end];
    struct vec3 pole[POLES], down = v3_scale(task->up, -1);
    int pole_count = find_poles(task, best, k, pole);
    try_points(task, k, scratch, min);
    if (unexplained.count > UNEXPLAINED_SHARE * task->evidence->count && unexplained.count >= UNEXPLAINED_MIN) {
        struct body_pose pose = reach_target(best, l, unexplained.far, pole[0]);
        try_pose(task, &pose, scratch, min);
        for (int b = 0; unexplained.own >= OWN_MIN && b < pole_count; b++) {
            pose = reach_target(best, l, unexplained.own_far, pole[b]);
            try_pose(task, &pose, scratch, min);
            pose = reach_target(best, l, unexplained.own_middle, pole[b]);
            try_pose(task, &pose, scratch, min);
        }
    }
    if (misplaced_energy < MISPLACED_ENERGY)
        return;
    struct body_pose pose = best->pose; // hanging
    pose.rotation[l->upper] = pose.rotation[l->lower] = pose.rotation[l->end] = (struct quat){0, 0, 0, 1};
    try_pose(task, &pose, scratch, min);
    struct vec3 base = best->build.origin[l->upper]; // hidden behind the trunk
    pose = reach_target(best, l, v3_add(base, v3_add(v3_scale(down, 0.3), v3(0, 0, 0.2))), down);
    try_pose(task, &pose, scratch, min);
}

int limb_search(const struct fit_task *given, struct fit_scratch *scratch)
{
    // Unexplained points must count, or a limb beside them would be as good as one on them.
    struct fit_task wide = *given;
    wide.kernel_m = SEARCH_KERNEL_M;
    struct body_pose now = scratch->best.pose;
    struct body_shape shape = scratch->best.shape;
    body_evaluate(&wide, &now, &shape, &scratch->best);
    int moved = 0;
    for (; moved < SEARCH_ROUNDS; moved++) {
        double min = ENOUGH_RATE * scratch->best.energy - ENOUGH_ENERGY, enough = min;
        for (int k = 0; k < LIMB_COUNT; k++)
            try_limb(&wide, k, scratch, &min);
        if (min >= enough)
            break;
        scratch->best = scratch->other;
    }
    return moved;
}

struct body_pose legs_swapped_pose(const struct fit_result *best)
{
    struct vec3 ahead = body_axis(&best->build, SEG_PELVIS, 2), left = best->build.origin[SEG_LEFT_FOOT],
                right = best->build.origin[SEG_RIGHT_FOOT];
    struct body_pose one = reach_target(best, &body_limbs[FIRST_LEG], right, ahead),
                     other = reach_target(best, &body_limbs[FIRST_LEG + 1], left, ahead), pose = best->pose;
    for (int s = SEG_LEFT_THIGH; s <= SEG_RIGHT_FOOT; s++)
        pose.rotation[s] = s <= SEG_LEFT_FOOT ? one.rotation[s] : other.rotation[s];
    return pose;
}

double legs_swapped_log_odds(const struct fit_task *given, struct fit_scratch *scratch)
{
    struct body_pose pose = legs_swapped_pose(&scratch->best);
    return fair_energy_gain(given, &pose, SWAP_SIGMA, scratch);
}

double limb_moved_m(int k, const struct body_build *from, const struct body_build *to)
{
    const struct body_limb *l = &body_limbs[k];
    return fmax(v3_distance(from->origin[l->lower], to->origin[l->lower]),
                v3_distance(from->origin[l->end], to->origin[l->end]));
}

void limb_copy(int k, const struct body_pose *from, struct body_pose *to)
{
    for (int s = (int)body_limbs[k].upper; s <= (int)body_limbs[k].end; s++)
        to->rotation[s] = from->rotation[s];
}

// Rotates segment s about its own origin to the axes that it has in `from`.
static void match_orientation(const struct body_shape *shape, enum segment segment, const struct body_build *from,
                              struct body_pose *to)
{
    struct body_build build;
    double wanted[3][3];
    body_forward_kinematics(shape, to, &build);
    for (int r = 0; r < 3; r++)
        for (int c = 0; c < 3; c++) {
            wanted[r][c] = 0;
            for (int i = 0; i < 3; i++)
                wanted[r][c] += build.parent_axes[segment][i][r] * from->axes[segment][i][c];
        }
    to->rotation[segment] = quat_from_matrix(wanted);
}

void limb_transfer(int k, const struct body_shape *shape, const struct body_build *from, struct body_pose *to)
{
    const enum segment chain[3] = {body_limbs[k].upper, body_limbs[k].lower, body_limbs[k].end};
    for (int i = 0; i < 3; i++) {
        match_orientation(shape, chain[i], from, to);
        if (i == 2)
            break;
        struct body_build build;
        body_forward_kinematics(shape, to, &build);
        body_aim_segment(shape, to, chain[i], v3_sub(from->origin[chain[i + 1]], build.origin[chain[i]]));
    }
}

// ---------------------------------------------------------------- alternatives of a limb

enum { TARGETS = 4, KEPT = 2 };

#define DISTINCT_M  0.12 // poses nearer to each other than this are one: a fit converges from the one to the other
#define REFINE_GAIN 3.0  // a fit reduces a candidate's energy by about this: four of five that become better gain less

struct limb_candidate {
    struct body_pose pose;
    double energy;
};

struct limb_task {
    const struct fit_task *task;
    const struct body_limb *limb;
    const struct fit_result *best;
    struct limb_point point[EVIDENCE_POINTS_MAX]; // within its reach, off every other solid
    int count;
    struct vec3 target[TARGETS]; // for its end, far from each other
    int targets;
    struct limb_candidate kept[KEPT];
};

// Distance of the nearest solid that is not of this limb.
static double other_distance(const struct fit_result *result, const struct body_limb *limb, int i, struct vec3 p)
{
    if (result->solid[i] < limb->first_solid || result->solid[i] >= limb->first_solid + LIMB_SOLIDS)
        return (double)result->residual[i];
    double min = 1e9;
    for (int k = 0; k < result->build.solids; k++) {
        if (k == limb->first_solid)
            k += LIMB_SOLIDS;
        if (k == result->build.solids)
            break;
        double d = solid_distance(&result->build.solid[k], p, NULL);
        min = fabs(d) < fabs(min) ? d : min;
    }
    return min;
}

// Collects the limb's points, and targets among those well off the rest of the body: farthest-point sampling, the first
// one the farthest from the limb's root.
static void find_targets(struct limb_task *task)
{
    const struct depth_evidence *e = task->task->evidence;
    const struct fit_result *r = task->best;
    struct vec3 base = r->build.origin[task->limb->upper];
    double reach =
        CLOSE_REACH_RATE * (v3_distance(base, r->build.origin[task->limb->lower]) +
                            v3_distance(r->build.origin[task->limb->lower], r->build.origin[task->limb->end])) +
        REACH_M;
    task->count = task->targets = 0;
    for (int i = 0; i < e->count; i++) {
        struct vec3 p = e->point[i].p;
        if (v3_distance(p, base) > reach)
            continue;
        task->point[task->count] = (struct limb_point){i, other_distance(r, task->limb, i, p)};
        task->count += fabs(task->point[task->count].other_distance_m) > OFF_BODY_M;
    }
    double target_distance[EVIDENCE_POINTS_MAX]; // of each to the nearest target so far
    for (int i = 0; i < task->count; i++) {
        const struct evidence_point *p = &e->point[task->point[i].index];
        target_distance[i] =
            task->point[i].other_distance_m > TARGET_OFF_M + 1 / sqrt(p->weight) ? v3_distance(p->p, base) : 0;
    }
    while (task->targets < TARGETS) {
        int max = -1;
        for (int i = 0; i < task->count; i++)
            if (target_distance[i] > DISTINCT_M && (max < 0 || target_distance[i] > target_distance[max]))
                max = i;
        if (max < 0)
            return;
        struct vec3 found = e->point[task->point[max].index].p;
        task->target[task->targets++] = found;
        for (int i = 0; i < task->count; i++)
            target_distance[i] = fmin(target_distance[i], v3_distance(e->point[task->point[i].index].p, found));
    }
}

// The energy of the limb's points and solids in a pose.
static double limb_energy(const struct limb_task *task, const struct body_build *build)
{
    const struct limb_evidence evidence = {task->limb->first_solid, LIMB_SOLIDS, task->point, task->count};
    return body_evaluate_limb(task->task, build, &evidence);
}

// Judges a pose by the limb's own solids and keeps it if it is one of the likeliest.
static void keep_candidate(struct limb_task *task, struct vec3 target, struct vec3 pole)
{
    const struct fit_result *r = task->best;
    struct limb_candidate candidate = {reach_target(r, task->limb, target, pole), 0};
    struct body_build build;
    body_forward_kinematics(&r->shape, &candidate.pose, &build);
    if (limb_moved_m((int)(task->limb - body_limbs), &r->build, &build) < DISTINCT_M)
        return;
    candidate.energy = limb_energy(task, &build);
    for (int i = 0; i < KEPT; i++)
        if (candidate.energy < task->kept[i].energy) {
            struct limb_candidate other = task->kept[i];
            task->kept[i] = candidate;
            candidate = other;
        }
}

// Keeps candidates of targets as the limb's end, and of pairs of targets as end and elbow.
static void find_candidates(struct limb_task *task, int k)
{
    const struct fit_result *best = task->best;
    struct vec3 pole[POLES], base = best->build.origin[task->limb->upper];
    int pole_count = find_poles(task->task, best, k, pole);
    double upper_m = v3_distance(base, best->build.origin[task->limb->lower]);
    for (int i = 0; i < task->targets; i++) {
        for (int b = 0; b < pole_count; b++)
            keep_candidate(task, task->target[i], pole[b]);
        for (int j = 0; j < task->targets; j++) // or target j is the elbow
            if (i != j && fabs(v3_distance(task->target[j], base) - upper_m) < ELBOW_SLACK_M)
                keep_candidate(task, task->target[i], v3_sub(task->target[j], base));
    }
    if (k < FIRST_LEG) { // or elbow and hand are mistaken for each other
        struct vec3 elbow = best->build.origin[task->limb->lower], hand = best->build.origin[task->limb->end];
        keep_candidate(task, elbow, v3_sub(hand, base));
    }
    struct limb_target target[LIMB_TARGETS_MAX];
    const int pointed = point_limb_targets(task->task->points, &best->build, k, target);
    for (int i = 0; i < pointed; i++)
        keep_candidate(task, target[i].end, target[i].pole);
}

double limb_alternative_log_odds(const struct fit_task *given, int k, struct fit_scratch *scratch)
{
    struct fit_task task = *given;
    struct limb_task t = {.task = &task, .limb = &body_limbs[k], .best = &scratch->best};
    task.learn_shape = false;
    task.shape.mean = scratch->best.shape;
    task.kernel_m = SEARCH_KERNEL_M;
    find_targets(&t);
    double now = limb_energy(&t, &scratch->best.build);
    const double rough = now + REFINE_GAIN;
    for (int i = 0; i < KEPT; i++)
        t.kept[i].energy = rough;
    find_candidates(&t, k);
    if (t.kept[0].energy >= rough)
        return -1;
    task.iterations = QUICK_ITERATIONS;
    task.expected_sigma = MOVE_SIGMA;
    task.expected = scratch->best.pose;
    struct body_pose pose = scratch->best.pose;
    body_fit(&task, &pose, &scratch->trial); // a fit is compared with a fit
    double min = 1e300;
    now = scratch->trial.energy;
    for (int i = 0; i < KEPT && t.kept[i].energy < rough; i++) {
        task.expected = t.kept[i].pose;
        body_fit(&task, &t.kept[i].pose, &scratch->trial);
        if (scratch->trial.energy < min) {
            min = scratch->trial.energy;
            scratch->other = scratch->trial;
        }
    }
    scratch->trial = scratch->other;
    return limb_moved_m(k, &scratch->best.build, &scratch->trial.build) < DISTINCT_M ? -1 : now - min;
}
