#include "capture/tracking/pose_init.h"

#include "base/portable_math.h"
#include "capture/body/hem_detector.h"
#include "capture/tracking/point_pose.h"

// Chosen by hand; docs/results.md measures the outcome.
#define AWAY_LOG_ODDS      20.0  // against a person who faces away from the sensor at the start
#define AWAY_LOG_ODDS_SEEN 3.0   // the same with points of the colour image, which tell the face
#define EVALUATE_KERNEL_M  0.20  // wide, so that an unexplained toe counts
#define REINIT_LOG_ODDS    20.0  // against the followed body having been wrong all along
#define FEET_SEEN_LOG_ODDS 5.0   // the same when feet appear: proportions learned without them are uncertain
#define REFINE_RATE        1.6   // of the least energy: a rough fit above this is not refined
#define WAIST_RATE         0.571 // the waist joint's height over the floor, of body height, in body_model.c
#define UPRIGHT_COSINE     0.9   // of the spine: of a bent person a hem hangs elsewhere
#define FOUND_SHARE        0.6   // of the points within FOUND_M of the body: a person was found
#define FOUND_M            0.10
#define PI                 3.14159265358979323846

// Fits: wide and rough, then fine with the shape learned. Sigmas are expected_sigma of body_fit.h.
#define WIDE_KERNEL_M     0.25
#define ROUGH_KERNEL_M    0.10
#define FINE_KERNEL_M     0.06
#define START_SIGMA       8
#define HELD_SIGMA        2   // of a start that is held near where the network has the joints: a limb is not lost then
#define REFINE_SIGMA_RATE 0.5 // of it while it is refined
#define LEARN_RATE        0.3
enum { WIDE_ITERATIONS = 5, ROUGH_ITERATIONS = 7, FINE_ITERATIONS = 10, POINTS_MIN = 30, START_STRIDE = 3 };

static const double TALL_MIN_M = 0.9, TALL_MAX_M = 2.1;

double explained_share(const struct depth_evidence *evidence, const struct fit_result *result, double within_m)
{
    int good = 0;
    for (int i = 0; i < evidence->count; i++)
        good += fabs((double)result->residual[i]) < within_m;
    return evidence->count ? (double)good / evidence->count : 0;
}

struct start_pose {
    const struct joint_evidence *joints; // the network's, told the sides that this pose has
    struct body_pose pose;
    struct body_shape shape;
    double sigma;
    double energy; // with facing_log_odds, the shape's, and of what the network finds untold
};

enum { STARTS = 6 + POINT_POSES };

struct starts {
    struct start_pose of[STARTS];
    int count;
    const struct joint_evidence *untold; // what the network finds without a hint: it judges between the sides
};

// Log-odds against a pose that faces away: most people face the sensor at the start.
static double facing_log_odds(const struct fit_task *task, const struct body_pose *pose)
{
    const double away = quat_rotate(pose->rotation[SEG_PELVIS], v3(0, 0, 1)).z;
    return (task->points ? AWAY_LOG_ODDS_SEEN : AWAY_LOG_ODDS) * 0.5 * (1 + away);
}

static struct start_pose start_of(const struct fit_task *task, const struct fit_result *fit, double sigma,
                                  const struct joint_evidence *untold)
{
    const double sides =
        joint_evidence_energy(untold, &fit->build, NULL) - joint_evidence_energy(task->joints, &fit->build, NULL);
    return (struct start_pose){task->joints, fit->pose, fit->shape, sigma,
                               fit->energy + sides + facing_log_odds(task, &fit->pose) + shape_log_odds(&fit->shape)};
}

// First with a wide kernel, then with `kernel_m`.
static void fit_from(const struct fit_task *given, const struct body_pose *pose, double sigma, double kernel_m,
                     struct fit_scratch *scratch)
{
    struct fit_task task = *given;
    task.learn_shape = false;
    task.expected = *pose;
    task.expected_sigma = sigma;
    task.iterations = WIDE_ITERATIONS;
    task.kernel_m = WIDE_KERNEL_M;
    body_fit(&task, pose, &scratch->trial);
    const struct body_pose rough = scratch->trial.pose;
    task.iterations = ROUGH_ITERATIONS;
    task.kernel_m = kernel_m;
    body_fit(&task, &rough, &scratch->trial);
}

void pose_init_fit(const struct fit_task *task, const struct body_pose *pose, struct fit_scratch *scratch)
{
    fit_from(task, pose, START_SIGMA, SEARCH_KERNEL_M, scratch);
}

static void try_start(struct fit_task *task, const struct body_pose *pose, double sigma, struct fit_scratch *scratch,
                      struct starts *starts)
{
    task->point_stride = START_STRIDE;
    fit_from(task, pose, sigma, ROUGH_KERNEL_M, scratch);
    starts->of[starts->count++] = start_of(task, &scratch->trial, sigma, starts->untold);
}

// Refines a rough fit, with the shape learned, into scratch->best.
static void refine(struct fit_task *task, const struct start_pose *start, struct fit_scratch *scratch)
{
    task->point_stride = 1;
    task->joints = start->joints;
    task->shape.mean = start->shape;
    task->expected = start->pose;
    task->expected_sigma = REFINE_SIGMA_RATE * start->sigma;
    task->learn_shape = true;
    task->learn_rate = LEARN_RATE;
    task->iterations = FINE_ITERATIONS;
    task->kernel_m = ROUGH_KERNEL_M;
    body_fit(task, &start->pose, &scratch->trial);
    const struct body_pose pose = scratch->trial.pose;
    task->kernel_m = FINE_KERNEL_M;
    task->shape.mean = scratch->trial.shape;
    body_fit(task, &pose, &scratch->best);
}

// Refines all that may turn out to be the likeliest, and leaves the best in scratch->best.
static void choose_best(struct fit_task *task, const struct starts *rough, struct fit_scratch *scratch)
{
    struct start_pose best = {.energy = INFINITY};
    double min = INFINITY;
    for (int i = 0; i < rough->count; i++)
        min = fmin(min, rough->of[i].energy);
    for (int i = 0; i < rough->count; i++) {
        if (!(rough->of[i].energy <= REFINE_RATE * min))
            continue;
        refine(task, &rough->of[i], scratch);
        const struct body_pose pose = scratch->best.pose;
        const struct body_shape shape = scratch->best.shape;
        task->kernel_m = EVALUATE_KERNEL_M;
        body_evaluate(task, &pose, &shape, &scratch->best);
        const struct start_pose fine = start_of(task, &scratch->best, rough->of[i].sigma, rough->untold);
        if (fine.energy < best.energy)
            best = fine;
    }
    task->joints = rough->untold;
    body_evaluate(task, &best.pose, &best.shape, &scratch->best);
    task->shape.mean = best.shape;
}

// What is known of the shape before the first fit: the height, and a hem in this frame, which counts until more frames
// are known.
static void start_shape(struct fit_task *task)
{
    const double height_m = fmax(TALL_MIN_M, fmin(TALL_MAX_M, joint_evidence_height_m(task->joints)));
    struct hem hem;
    task->shape = shape_prior_default();
    task->shape.mean.log[SHAPE_SCALE] = portable_log(height_m / BODY_AVERAGE_HEIGHT_M);
    const struct joint_evidence joints = joint_evidence_complete(task->joints, &task->shape.mean, task->up);
    const struct vec3 *j = joints.joint, spine = v3_sub(v3_mix(j[JOINT_LEFT_SHOULDER], j[JOINT_RIGHT_SHOULDER], 0.5),
                                                        v3_mix(j[JOINT_LEFT_HIP], j[JOINT_RIGHT_HIP], 0.5));
    if (v3_dot(v3_unit(spine), task->up) < UPRIGHT_COSINE || !hem_detect(task, height_m, &hem) ||
        !hem_is_worn(hem.narrow, hem.wide_m, height_m, false))
        return;
    task->shape.mean.hem_m = WAIST_RATE * height_m - hem.level_m;
    task->shape.mean.hem_radius_m = 0.5 * hem.wide_m;
}

// Standing upright where the trunk is, arms hanging.
static struct body_pose upright_pose(const struct fit_task *task, double yaw)
{
    static const enum joint trunk[] = {JOINT_NECK, JOINT_TORSO, JOINT_WAIST};
    struct body_pose pose = body_standing_pose(v3(0, 0, 0), task->up, yaw);
    const struct joint_evidence joints = joint_evidence_complete(task->joints, &task->shape.mean, task->up);
    struct body_build build;
    body_forward_kinematics(&task->shape.mean, &pose, &build);
    for (size_t i = 0; i < COUNT_OF(trunk); i++)
        pose.root =
            v3_add(pose.root, v3_scale(v3_sub(joints.joint[trunk[i]], build.joint[trunk[i]]), 1.0 / COUNT_OF(trunk)));
    return pose;
}

bool pose_init_search(struct fit_task *task, const struct joint_evidence told[2], struct fit_scratch *scratch)
{
    if (task->evidence->count < POINTS_MIN)
        return false;
    const struct joint_evidence *untold = task->joints;
    start_shape(task);
    struct starts rough = {.untold = untold};
    struct body_pose pointed[POINT_POSES];
    for (int i = 0; i < 2; i++) {
        task->joints = &told[i];
        const struct body_pose found = joint_evidence_pose(&told[i], &task->shape.mean, task->up),
                               upright = upright_pose(task, told[i].left.x < 0 ? PI : 0);
        try_start(task, &found, START_SIGMA, scratch, &rough);
        try_start(task, &found, HELD_SIGMA, scratch, &rough);
        try_start(task, &upright, START_SIGMA, scratch, &rough);
    }
    task->joints = untold;
    const int count = point_poses(task, pointed);
    for (int i = 0; i < count; i++)
        try_start(task, &pointed[i], START_SIGMA, scratch, &rough);
    choose_best(task, &rough, scratch);
    return explained_share(task->evidence, &scratch->best, FOUND_M) > FOUND_SHARE;
}

bool pose_reinit(struct fit_task *task, const struct joint_evidence told[2], bool feet_appeared,
                 struct fit_scratch *scratch)
{
    const struct fit_task before = *task;
    const struct body_pose pose = scratch->best.pose;
    if (pose_init_search(task, told, scratch)) {
        struct fit_task judged = *task;
        judged.shape = before.shape;
        body_evaluate(&judged, &pose, &before.shape.mean, &scratch->trial);
        if (scratch->trial.energy - scratch->best.energy > (feet_appeared ? FEET_SEEN_LOG_ODDS : REINIT_LOG_ODDS))
            return true;
    }
    *task = before;
    body_evaluate(task, &pose, &task->shape.mean, &scratch->best);
    return false;
}
