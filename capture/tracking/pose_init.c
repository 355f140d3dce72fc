#include "capture/tracking/pose_init.h"

#include "base/portable_math.h"
#include "capture/body/hem_detector.h"
#include "capture/tracking/point_pose.h"

#include <stdlib.h>
#include <string.h>

enum { YAWS = 8, YAW_STEP = 3, FACINGS = 4, SIZES = 2 };
// Chosen by hand; docs/results.md measures the outcome.
#define POOR_FIT_ENERGY         75.0 // a fit's energy if all its points, 150 independent ones, are off by their sigma
#define AWAY_LOG_ODDS           10.0 // against a person who faces away from the sensor
#define AWAY_LOG_ODDS_UNSURE    45.0 // the same without feet, or without a floor under them: little other evidence
#define AWAY_LOG_ODDS_SEEN      3.0 // the same with points of the colour image, which tell the face and left from right
#define EVALUATE_KERNEL_M       0.20  // wide, so that an unexplained toe counts
#define REINIT_LOG_ODDS         20.0  // against the followed body having been wrong all along
#define FEET_SEEN_LOG_ODDS      5.0   // the same when feet appear: proportions learned without them are uncertain
#define REFINE_RATE             1.6   // of the least energy: a rough fit above this is not refined
#define RESTART_RATE            1.2   // of the followed pose's energy: a rough fit above this is not refined
#define RESTART_LOG_ODDS        15.0  // against the followed body having been wrong, of another start
#define RESTART_TURNED_LOG_ODDS 35.0  // the same of a start that faces the other way
#define SAME_POSE_M             0.06  // starts that converge to within this of the followed joints are the same pose
#define WAIST_RATE              0.571 // the waist joint's height over the floor, of body height, in body_model.c
#define CROWN_RATE              0.429 // of the crown over the waist joint: 1 - WAIST_RATE
#define SPINE_DEPTH_RATE        0.085 // of the waist joint behind the trunk's surface, of body height
#define HEIGHT_SIGMA            0.06  // of an uncropped person's height: raised arms, bent knees, shoes
#define BENT_SHARE              0.12  // of the height by the points: a body that much less or more tall does not stand
#define FOUND_SHARE             0.6   // of the points within FOUND_M of the body: a person was found
#define FOUND_M                 0.10
#define PI                      3.14159265358979323846

// Fits: wide and rough from a standing pose, then fine with the shape learned. Sigmas are expected_sigma of body_fit.h.
#define WIDE_KERNEL_M  0.25
#define ROUGH_KERNEL_M 0.10
#define FINE_KERNEL_M  0.06
#define START_SIGMA    8
#define REFINE_SIGMA   4
#define LEARN_RATE     0.3
enum { WIDE_ITERATIONS = 5, ROUGH_ITERATIONS = 7, FINE_ITERATIONS = 10, LIMB_SEARCHES = 2 };

// Ranges of a person's height, and levels over the floor below which feet are cropped, or stand on the floor.
static const double TALL_MIN_M = 0.9, TALL_MAX_M = 2.4, GUESS_MAX_M = 2.0, LEGS_HIDDEN_M = 0.4, STANDING_M = 0.25;

// The levels of the trunk's points, below the top, of body height.
static const double TRUNK_LOW = 0.5, TRUNK_HIGH = 0.2;
enum { TRUNK_POINTS_MIN = 8, POINTS_MIN = 30, START_STRIDE = 3 };

double explained_share(const struct depth_evidence *evidence, const struct fit_result *result, double within_m)
{
    int good = 0;
    for (int i = 0; i < evidence->count; i++)
        good += fabs((double)result->residual[i]) < within_m;
    return evidence->count ? (double)good / evidence->count : 0;
}

static int compare_doubles(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

static double rank_of(double *values, int count, double share)
{
    qsort(values, (size_t)count, sizeof *values, compare_doubles);
    int i = (int)(share * (count - 1));
    return values[i];
}

struct person_measures {
    double top, bottom, height; // over the floor or any level
    struct vec3 trunk;          // median of the trunk's surface; y is unused
    bool legs_cropped;          // by the image's lower edge or by something in front of the legs
    bool head_cropped;          // by the upper edge
    bool height_from_points;    // the body is not upright, or cropped
    int side_cropped;           // by the left (-1) or right (1) edge
};

static double level_of(const struct fit_task *task, struct vec3 p) { return v3_dot(task->up, p) + task->floor_m; }

// The median of the points at the trunk's levels below the top.
static bool measure_trunk(const struct fit_task *task, struct person_measures *out)
{
    const struct depth_evidence *e = task->evidence;
    double x[EVIDENCE_POINTS_MAX], z[EVIDENCE_POINTS_MAX];
    double low = out->top - TRUNK_LOW * out->height, high = out->top - TRUNK_HIGH * out->height;
    int count = 0;
    for (int i = 0; i < e->count; i++) {
        double h = level_of(task, e->point[i].p);
        if (h > low && h < high) {
            x[count] = e->point[i].p.x;
            z[count++] = e->point[i].p.z;
        }
    }
    if (count < TRUNK_POINTS_MIN)
        return false;
    out->trunk.x = rank_of(x, count, 0.5);
    out->trunk.z = rank_of(z, count, 0.5);
    return true;
}

// Rough measures of the person from the points alone.
static bool measure(const struct fit_task *task, struct person_measures *out)
{
    const struct depth_evidence *e = task->evidence;
    double level[EVIDENCE_POINTS_MAX];
    for (int i = 0; i < e->count; i++)
        level[i] = level_of(task, e->point[i].p);
    out->top = rank_of(level, e->count, 0.995) + 0.01;
    out->bottom = rank_of(level, e->count, 0.005);
    unsigned cropped = evidence_cropped_edges(e);
    out->legs_cropped = cropped & CROP_BOTTOM || (task->have_floor && out->bottom > LEGS_HIDDEN_M);
    out->head_cropped = cropped & CROP_TOP;
    out->side_cropped = (cropped & CROP_RIGHT ? 1 : 0) - (cropped & CROP_LEFT ? 1 : 0);
    out->height = BODY_AVERAGE_HEIGHT_M;
    if (!out->legs_cropped && task->have_floor && out->bottom < STANDING_M)
        out->bottom = 0;
    double tall = out->top - out->bottom;
    if (!out->legs_cropped && !out->head_cropped && tall > TALL_MIN_M && tall < TALL_MAX_M)
        out->height = tall;
    if (out->legs_cropped && !out->head_cropped && task->have_floor && out->top > TALL_MIN_M && out->top < TALL_MAX_M)
        out->height = out->top; // most people stand
    if (!out->legs_cropped && out->head_cropped)
        out->top = out->bottom + fmax(tall, out->height);
    const double by_points = task->points ? point_height_m(task) : 0;
    out->height_from_points =
        by_points > TALL_MIN_M && by_points < TALL_MAX_M && fabs(by_points - out->height) > BENT_SHARE * by_points;
    if (out->height_from_points)
        out->height = by_points;
    return measure_trunk(task, out);
}

// What a person may be doing when first seen. The height that the points suggest is then another share of the body's.
enum posture {
    ARMS_DOWN,
    ARMS_OUT,
    ARMS_RAISED, // the topmost points are hands
    CROUCHED,
    BENT, // the trunk leans ahead
    LEFT_KICK,
    RIGHT_KICK,
    POSTURES
};
static const double height_rate[POSTURES] = {1, 1, 0.80, 1.35, 1.35, 1, 1};

static void rotate(struct body_pose *pose, enum segment segment, double x, double z)
{
    pose->rotation[segment] = quat_from_rotation_vector(v3(x, 0, z));
}

static void take_posture(struct body_pose *pose, enum posture posture)
{
    static const double raised[POSTURES] = {0.12, 0.9, 2.6, 0.4, 0.12, 0, 0}; // arms from hanging, radians
    rotate(pose, SEG_LEFT_UPPER_ARM, 0, raised[posture]);
    rotate(pose, SEG_RIGHT_UPPER_ARM, 0, -raised[posture]);
    if (posture == CROUCHED || posture == LEFT_KICK) {
        rotate(pose, SEG_LEFT_THIGH, -1.2, 0);
        rotate(pose, SEG_LEFT_SHIN, posture == CROUCHED ? 1.6 : 0.6, 0);
    }
    if (posture == CROUCHED || posture == RIGHT_KICK) {
        rotate(pose, SEG_RIGHT_THIGH, -1.2, 0);
        rotate(pose, SEG_RIGHT_SHIN, posture == CROUCHED ? 1.6 : 0.6, 0);
    }
    if (posture == BENT) {
        rotate(pose, SEG_ABDOMEN, 0.7, 0);
        rotate(pose, SEG_CHEST, 0.7, 0);
    }
}

struct start_pose {
    struct body_pose pose;
    struct body_shape shape;
    double energy; // with facing_log_odds and the shape's
};

// The likeliest poses so far, one for each direction that the trunk may face: towards the sensor, left, away, right;
// of people as tall as their points, and of others.
struct pose_candidates {
    struct start_pose of[FACINGS * SIZES];
    double away_log_odds; // against one that faces away
};

static struct vec3 ahead_of(const struct body_pose *pose)
{
    return quat_rotate(pose->rotation[SEG_PELVIS], v3(0, 0, 1));
}

// Log-odds against a pose that faces away: most people face the sensor at the start.
static double facing_log_odds(const struct body_pose *pose, double away_log_odds)
{
    return away_log_odds * 0.5 * (1 + ahead_of(pose).z);
}

// unsure: no feet are visible, or no floor is known.
static struct pose_candidates no_candidates(const struct fit_task *task, bool unsure)
{
    struct pose_candidates none = {.away_log_odds = task->points ? AWAY_LOG_ODDS_SEEN
                                                    : unsure     ? AWAY_LOG_ODDS_UNSURE
                                                                 : AWAY_LOG_ODDS};
    for (int i = 0; i < FACINGS * SIZES; i++)
        none.of[i].energy = INFINITY;
    return none;
}

static void keep_best(struct pose_candidates *candidates, const struct fit_result *result, enum posture posture)
{
    struct vec3 ahead = ahead_of(&result->pose);
    int facing = fabs(ahead.x) > fabs(ahead.z) ? (ahead.x > 0 ? 1 : 3) : (ahead.z > 0 ? 2 : 0);
    double energy =
        result->energy + facing_log_odds(&result->pose, candidates->away_log_odds) + shape_log_odds(&result->shape);
    struct start_pose *best = &candidates->of[facing + (height_rate[posture] == 1 ? 0 : FACINGS)];
    if (energy < best->energy)
        *best = (struct start_pose){result->pose, result->shape, energy};
}

// Fits roughly from `pose` into scratch->trial, first with a wide kernel.
static void fit_start(struct fit_task *task, const struct body_pose *pose, struct fit_scratch *scratch)
{
    task->expected = *pose;
    task->expected_sigma = START_SIGMA;
    task->iterations = WIDE_ITERATIONS;
    task->kernel_m = WIDE_KERNEL_M;
    body_fit(task, pose, &scratch->trial);
    struct body_pose rough = scratch->trial.pose;
    task->iterations = ROUGH_ITERATIONS;
    task->kernel_m = ROUGH_KERNEL_M;
    body_fit(task, &rough, &scratch->trial);
}

// Refines a rough fit, with a limb search and the shape learned, into scratch->best.
static void refine_candidate(struct fit_task *task, const struct start_pose *start_pose, struct fit_scratch *scratch)
{
    struct body_pose pose = start_pose->pose;
    task->point_stride = 1;
    task->learn_shape = false;
    task->shape.mean = start_pose->shape;
    task->expected = pose;
    task->expected_sigma = REFINE_SIGMA;
    task->iterations = WIDE_ITERATIONS;
    task->kernel_m = ROUGH_KERNEL_M;
    body_evaluate(task, &pose, &start_pose->shape, &scratch->best);
    for (int round = 0; round < LIMB_SEARCHES; round++)
        limb_search(task, scratch);
    task->learn_shape = true;
    task->learn_rate = LEARN_RATE;
    task->iterations = FINE_ITERATIONS;
    pose = scratch->best.pose;
    body_fit(task, &pose, &scratch->trial);
    pose = scratch->trial.pose;
    task->kernel_m = FINE_KERNEL_M;
    task->shape.mean = scratch->trial.shape;
    body_fit(task, &pose, &scratch->best);
}

// A hem in this frame counts until more frames are known (update_hem).
static void apply_skirt(struct fit_task *task, double height_m)
{
    struct hem hem;
    if (!hem_detect(task, height_m, &hem) || !hem_is_worn(hem.narrow, hem.wide_m, height_m, false))
        return;
    task->shape.mean.hem_m = WAIST_RATE * height_m - hem.level_m;
    task->shape.mean.hem_radius_m = 0.5 * hem.wide_m;
}

// Refines all candidates that may turn out to be the likeliest, and leaves the best in scratch->best.
static void choose_best(struct fit_task *task, const struct pose_candidates *rough, struct fit_scratch *scratch)
{
    struct start_pose best = {.energy = INFINITY};
    double min = INFINITY;
    for (int i = 0; i < FACINGS * SIZES; i++)
        min = fmin(min, rough->of[i].energy);
    for (int i = 0; i < FACINGS * SIZES; i++) {
        if (!(rough->of[i].energy <= REFINE_RATE * min))
            continue;
        refine_candidate(task, &rough->of[i], scratch);
        struct start_pose fine = {scratch->best.pose, scratch->best.shape, 0};
        task->kernel_m = EVALUATE_KERNEL_M;
        body_evaluate(task, &fine.pose, &fine.shape, &scratch->best);
        fine.energy =
            scratch->best.energy + facing_log_odds(&fine.pose, rough->away_log_odds) + shape_log_odds(&fine.shape);
        if (fine.energy < best.energy)
            best = fine;
    }
    body_evaluate(task, &best.pose, &best.shape, &scratch->best);
    task->shape.mean = best.shape;
}

// Where the waist joint of a person in this posture is.
static struct vec3 start_root(const struct fit_task *task, const struct person_measures *measures, enum posture posture)
{
    double rise = posture == BENT ? measures->bottom + WAIST_RATE * measures->height
                                  : measures->top - CROWN_RATE * measures->height;
    double waist = rise - task->floor_m;
    struct vec3 root = v3(measures->trunk.x, 0, measures->trunk.z + SPINE_DEPTH_RATE * measures->height);
    root.y = (waist - v3_dot(task->up, root)) / fmin(task->up.y, -0.3);
    return root;
}

// The measures of the person who would be in this posture. False: the points do not allow for it.
static bool adapt_measures(const struct fit_task *task, struct person_measures *measures, enum posture posture)
{
    if (height_rate[posture] == 1)
        return true;
    if (measures->head_cropped || measures->side_cropped || measures->height_from_points ||
        (measures->legs_cropped && !task->have_floor))
        return false;
    measures->height *= height_rate[posture];
    if (posture == ARMS_RAISED)
        measures->top = measures->bottom + measures->height;
    return measures->height > TALL_MIN_M && measures->height < GUESS_MAX_M && measure_trunk(task, measures);
}

// What is known of the shape before the first fit.
static void start_shape(struct fit_task *task, const struct person_measures *measures)
{
    task->shape = shape_prior_default();
    task->shape.mean.log[SHAPE_SCALE] = portable_log(measures->height / BODY_AVERAGE_HEIGHT_M);
    if (measures->height_from_points || (!measures->legs_cropped && !measures->head_cropped))
        task->shape.information[SHAPE_SCALE][SHAPE_SCALE] = 1 / (HEIGHT_SIGMA * HEIGHT_SIGMA);
    apply_skirt(task, measures->height);
}

// Fits a posture in all directions. Cropped at a side, one direction is enough: half a person fits any of them. Then,
// and where neither head nor feet are visible, places further out of the image are tried too.
static void try_posture(struct fit_task *task, const struct person_measures *measured, enum posture posture,
                        struct fit_scratch *scratch, struct pose_candidates *rough)
{
    static const double away[3] = {0, 0.06, 0.12}; // of body height
    struct person_measures s = *measured;
    if (!adapt_measures(task, &s, posture))
        return;
    start_shape(task, &s);
    struct vec3 root = start_root(task, &s, posture);
    bool middle = s.legs_cropped && s.head_cropped;
    task->learn_shape = false;
    task->point_stride = START_STRIDE;
    for (int yaw = 0; yaw < (s.side_cropped ? 1 : YAWS); yaw++)
        for (int k = 0; k < (s.side_cropped || middle ? 3 : 1); k++) {
            double by = away[k] * s.height;
            struct vec3 at =
                v3_add(root, v3_add(v3(s.side_cropped * by, 0, 0), v3_scale(task->up, middle ? 2 * by : 0)));
            struct body_pose pose = body_standing_pose(at, task->up, yaw * 2 * PI / YAWS);
            take_posture(&pose, posture);
            fit_start(task, &pose, scratch);
            keep_best(rough, &scratch->trial, posture);
        }
}

// Fits what the colour image's points suggest: a body in mid-motion may be far from any posture.
static void try_pointed(struct fit_task *task, const struct person_measures *measures, struct fit_scratch *scratch,
                        struct pose_candidates *rough)
{
    struct body_pose pointed[POINT_POSES];
    const int count = point_poses(task, pointed);
    if (count)
        start_shape(task, measures);
    task->learn_shape = false;
    task->point_stride = START_STRIDE;
    for (int i = 0; i < count; i++) {
        fit_start(task, &pointed[i], scratch);
        keep_best(rough, &scratch->trial, ARMS_DOWN);
    }
}

bool pose_init_search(struct fit_task *task, struct fit_scratch *scratch)
{
    struct person_measures s;
    if (task->evidence->count < POINTS_MIN || !measure(task, &s))
        return false;
    struct pose_candidates rough = no_candidates(task, s.legs_cropped || !task->have_floor);
    for (enum posture p = ARMS_DOWN; p <= ARMS_RAISED; p++)
        try_posture(task, &s, p, scratch, &rough);
    try_pointed(task, &s, scratch, &rough);
    choose_best(task, &rough, scratch);
    if (scratch->best.energy > POOR_FIT_ENERGY && !s.side_cropped && !s.legs_cropped) {
        for (enum posture p = CROUCHED; p < POSTURES; p++)
            try_posture(task, &s, p, scratch, &rough);
        choose_best(task, &rough, scratch);
    }
    return explained_share(task->evidence, &scratch->best, FOUND_M) > FOUND_SHARE;
}

static double largest_distance(const struct body_build *a, const struct body_build *b)
{
    double max = 0;
    for (int j = 0; j < JOINT_COUNT; j++)
        max = fmax(max, v3_distance(a->joint[j], b->joint[j]));
    return max;
}

// One of the starts, fitted roughly into scratch->trial: each turn another posture and direction. False: the points do
// not allow for it.
static bool fit_turn(struct fit_task *task, const struct person_measures *measured, int turn,
                     struct fit_scratch *scratch)
{
    const enum posture posture = (enum posture)(turn % POSTURES);
    struct person_measures s = *measured;
    if (s.side_cropped || s.head_cropped || (s.legs_cropped && !task->have_floor) || !adapt_measures(task, &s, posture))
        return false;
    start_shape(task, &s);
    task->learn_shape = false;
    struct body_pose start =
        body_standing_pose(start_root(task, &s, posture), task->up, turn * YAW_STEP % YAWS * 2 * PI / YAWS);
    take_posture(&start, posture);
    fit_start(task, &start, scratch);
    return true;
}

static double energy_with_shape(const struct fit_result *result)
{
    return result->energy + shape_log_odds(&result->shape);
}

// Refines the start in scratch->trial into scratch->best and compares it with the followed body. feet: they are
// visible; of depth only they tell which way a person faces.
static bool is_start_likelier(struct fit_task *task, const struct body_pose *followed, const struct body_shape *shape,
                              bool feet, struct fit_scratch *scratch)
{
    struct pose_candidates rough = no_candidates(task, true);
    keep_best(&rough, &scratch->trial, ARMS_DOWN);
    choose_best(task, &rough, scratch);
    body_evaluate(task, followed, shape, &scratch->trial);
    bool turned = v3_dot(ahead_of(followed), ahead_of(&scratch->best.pose)) < 0;
    if (turned && !feet && !task->points)
        return false;
    return energy_with_shape(&scratch->trial) - energy_with_shape(&scratch->best) >
           (turned ? RESTART_TURNED_LOG_ODDS : RESTART_LOG_ODDS);
}

bool pose_restart(struct fit_task *task, const struct body_pose *followed, int turn, struct fit_scratch *scratch)
{
    const struct fit_task before = *task;
    const struct body_pose pose = *followed; // `followed` may point into scratch
    struct person_measures s;
    scratch->other_rate = 0;
    if (measure(task, &s)) {
        task->kernel_m = ROUGH_KERNEL_M;
        task->point_stride = START_STRIDE;
        body_evaluate(task, &pose, &before.shape.mean, &scratch->best);
        if (fit_turn(task, &s, turn, scratch) &&
            largest_distance(&scratch->trial.build, &scratch->best.build) > SAME_POSE_M) {
            scratch->other_rate = energy_with_shape(&scratch->trial) / fmax(1, energy_with_shape(&scratch->best));
            if (scratch->other_rate < RESTART_RATE &&
                is_start_likelier(task, &pose, &before.shape.mean, !s.legs_cropped, scratch))
                return true;
        }
    }
    *task = before;
    body_evaluate(task, &pose, &task->shape.mean, &scratch->best);
    return false;
}

bool pose_reinit(struct fit_task *task, const struct body_pose *followed, bool feet_appeared,
                 struct fit_scratch *scratch)
{
    const struct fit_task before = *task;
    const struct body_pose pose = *followed; // `followed` may point into scratch
    if (pose_init_search(task, scratch)) {
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
