#include "capture/tracking/pose_init.h"
#include "base/portable_math.h"

#include "capture/body/hem_detector.h"
#include "capture/tracking/point_pose.h"
#include <stdlib.h>
#include <string.h>

enum { YAWS = 8, FACINGS = 4 };
// Chosen by hand; docs/results.md measures the outcome.
#define POOR_FIT_ENERGY      75.0  // a fit's energy if all its points, 150 independent ones, are off by their sigma
#define AWAY_LOG_ODDS        10.0  // against a person who faces away from the sensor
#define AWAY_LOG_ODDS_UNSURE 45.0  // the same without feet, or without a floor under them: little other evidence
#define AWAY_LOG_ODDS_SEEN   3.0   // the same with points of the colour image, which tell the face and left from right
#define EVALUATE_KERNEL_M    0.20  // wide, so that an unexplained toe counts
#define REINIT_LOG_ODDS      20.0  // against the followed body having been wrong all along
#define FEET_SEEN_LOG_ODDS   5.0   // the same when feet appear: proportions learned without them are uncertain
#define REFINE_RATE          1.6   // of the least energy: a rough fit above this is not refined
#define WAIST_RATE           0.571 // the waist joint's height over the floor, of body height, in body_model.c
#define CROWN_RATE           0.429 // of the crown over the waist joint: 1 - WAIST_RATE
#define SPINE_DEPTH_RATE     0.085 // of the waist joint behind the trunk's surface, of body height
#define HEIGHT_SIGMA         0.06  // of an uncropped person's height: raised arms, bent knees, shoes
#define BENT_SHARE           0.12  // of the height by the points: a body that much less or more tall does not stand
#define FOUND_SHARE          0.6   // of the points within FOUND_M of the body: a person was found
#define FOUND_M              0.10
#define PI                   3.14159265358979323846

// Fits: wide and rough from a standing pose, then fine with the shape learned. Sigmas are expected_sigma of body_fit.h.
#define WIDE_KERNEL_M  0.25
#define ROUGH_KERNEL_M 0.10
#define FINE_KERNEL_M  0.06
#define START_SIGMA    8
#define REFINE_SIGMA   4
#define LEARN_RATE     0.3
enum { WIDE_ITERATIONS = 5, ROUGH_ITERATIONS = 7, FINE_ITERATIONS = 10, LIMB_SEARCHES = 2 };

// Ranges of a person's height, and levels over the floor below which feet are cropped, or stand on the floor.
static const double TALL_MIN_M = 0.9, TALL_MAX_M = 2.4, LEGS_HIDDEN_M = 0.4, STANDING_M = 0.25;

// The levels of the trunk's points, below the top, of body height.
static const double TRUNK_LOW = 0.5, TRUNK_HIGH = 0.2;
enum { TRUNK_POINTS_MIN = 8, POINTS_MIN = 30, START_STRIDE = 3 };

double explained_share(const struct depth_evidence *e, const struct fit_result *r, double within_m)
{
    int good = 0;
    for (int i = 0; i < e->count; i++)
        good += fabs((double)r->residual[i]) < within_m;
    return e->count ? (double)good / e->count : 0;
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

// Rough measures of the person from the points alone.
static bool measure(const struct fit_task *task, struct person_measures *out)
{
    const struct depth_evidence *e = task->evidence;
    double level[EVIDENCE_POINTS_MAX], x[EVIDENCE_POINTS_MAX], z[EVIDENCE_POINTS_MAX];
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
    int count = 0;
    double low = out->top - TRUNK_LOW * out->height, high = out->top - TRUNK_HIGH * out->height;
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

// A leg raised as in a kick; side 0: the left one.
static void raise_leg(struct body_pose *pose, int side)
{
    pose->rotation[side ? SEG_RIGHT_THIGH : SEG_LEFT_THIGH] = quat_from_rotation_vector(v3(-1.2, 0, 0));
    pose->rotation[side ? SEG_RIGHT_SHIN : SEG_LEFT_SHIN] = quat_from_rotation_vector(v3(0.6, 0, 0));
}

static void raise_arms(struct body_pose *pose, double left, double right)
{
    pose->rotation[SEG_LEFT_UPPER_ARM] = quat_from_rotation_vector(v3(0, 0, left));
    pose->rotation[SEG_RIGHT_UPPER_ARM] = quat_from_rotation_vector(v3(0, 0, -right));
}

// The likeliest poses so far, one for each direction that the trunk may face: towards the sensor, left, away, right.
struct start_pose {
    struct body_pose pose;
    struct body_shape shape;
    double energy; // with facing_log_odds
};

struct pose_candidates {
    struct start_pose of[FACINGS];
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
    for (int i = 0; i < FACINGS; i++)
        none.of[i].energy = INFINITY;
    return none;
}

static void keep_best(struct pose_candidates *c, const struct fit_result *r)
{
    struct vec3 ahead = ahead_of(&r->pose);
    int facing = fabs(ahead.x) > fabs(ahead.z) ? (ahead.x > 0 ? 1 : 3) : (ahead.z > 0 ? 2 : 0);
    double energy = r->energy + facing_log_odds(&r->pose, c->away_log_odds);
    if (energy < c->of[facing].energy)
        c->of[facing] = (struct start_pose){r->pose, r->shape, energy};
}

// Fits roughly from `pose`, first with a wide kernel.
static void fit_start(struct fit_task *task, const struct body_pose *pose, struct fit_scratch *scratch,
                      struct pose_candidates *c)
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
    keep_best(c, &scratch->trial);
}

// Refines a rough fit, with a limb search and the shape learned, into scratch->best.
static void refine_candidate(struct fit_task *task, const struct start_pose *c, struct fit_scratch *scratch)
{
    struct body_pose pose = c->pose;
    task->point_stride = 1;
    task->learn_shape = false;
    task->shape.mean = c->shape;
    task->expected = pose;
    task->expected_sigma = REFINE_SIGMA;
    task->iterations = WIDE_ITERATIONS;
    task->kernel_m = ROUGH_KERNEL_M;
    body_evaluate(task, &pose, &c->shape, &scratch->best);
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
    double least = INFINITY;
    for (int i = 0; i < FACINGS; i++)
        least = fmin(least, rough->of[i].energy);
    for (int i = 0; i < FACINGS; i++) {
        if (!(rough->of[i].energy <= REFINE_RATE * least))
            continue;
        refine_candidate(task, &rough->of[i], scratch);
        struct start_pose fine = {scratch->best.pose, scratch->best.shape, 0};
        task->kernel_m = EVALUATE_KERNEL_M;
        body_evaluate(task, &fine.pose, &fine.shape, &scratch->best);
        fine.energy = scratch->best.energy + facing_log_odds(&fine.pose, rough->away_log_odds);
        if (fine.energy < best.energy)
            best = fine;
    }
    body_evaluate(task, &best.pose, &best.shape, &scratch->best);
    task->shape.mean = best.shape;
}

// No standing pose fits well, whichever way it faces: tries a raised leg.
static void try_kicks(struct fit_task *task, struct vec3 root, struct fit_scratch *scratch)
{
    struct pose_candidates rough = no_candidates(task, !task->have_floor);
    struct start_pose standing = {scratch->best.pose, scratch->best.shape, scratch->best.energy};
    standing.energy += facing_log_odds(&standing.pose, rough.away_log_odds);
    task->learn_shape = false;
    task->point_stride = START_STRIDE;
    for (int yaw = 0; yaw < YAWS; yaw++)
        for (int side = 0; side < 2; side++) {
            struct body_pose pose = body_standing_pose(root, task->up, yaw * 2 * PI / YAWS);
            raise_leg(&pose, side);
            fit_start(task, &pose, scratch, &rough);
        }
    choose_best(task, &rough, scratch);
    if (scratch->best.energy + facing_log_odds(&scratch->best.pose, rough.away_log_odds) < standing.energy)
        return;
    body_evaluate(task, &standing.pose, &standing.shape, &scratch->best);
    task->shape.mean = standing.shape;
}

// Where the waist joint of a standing person is.
static struct vec3 standing_root(const struct fit_task *task, const struct person_measures *s)
{
    double waist = s->top - CROWN_RATE * s->height - task->floor_m;
    struct vec3 root = v3(s->trunk.x, 0, s->trunk.z + SPINE_DEPTH_RATE * s->height);
    double rise = (waist - v3_dot(task->up, root)) / fmin(task->up.y, -0.3);
    root.y = rise;
    return root;
}

// Fits standing poses of all directions about `root`. Cropped at a side, one direction is enough: half a person fits
// any of them. Then, and where neither head nor feet are visible, places further out of the image are tried too.
static void try_standing(struct fit_task *task, const struct person_measures *s, struct vec3 root,
                         struct fit_scratch *scratch, struct pose_candidates *rough)
{
    static const double arms[2] = {0.12, 0.9}, away[3] = {0, 0.06, 0.12}; // radians; of body height
    bool middle = s->legs_cropped && s->head_cropped;
    for (int yaw = 0; yaw < (s->side_cropped ? 1 : YAWS); yaw++)
        for (int a = 0; a < 2; a++)
            for (int k = 0; k < (s->side_cropped || middle ? 3 : 1); k++) {
                double by = away[k] * s->height;
                struct vec3 at =
                    v3_add(root, v3_add(v3(s->side_cropped * by, 0, 0), v3_scale(task->up, middle ? 2 * by : 0)));
                struct body_pose pose = body_standing_pose(at, task->up, yaw * 2 * PI / YAWS);
                raise_arms(&pose, arms[a], arms[a]);
                fit_start(task, &pose, scratch, rough);
            }
    struct body_pose pointed[POINT_POSES]; // a body in mid-motion may be far from standing
    const int count = point_poses(task, pointed);
    for (int i = 0; i < count; i++)
        fit_start(task, &pointed[i], scratch, rough);
}

bool pose_init_search(struct fit_task *task, struct fit_scratch *scratch)
{
    struct person_measures s;
    if (task->evidence->count < POINTS_MIN || !measure(task, &s))
        return false;
    double scale_log = portable_log(s.height / BODY_AVERAGE_HEIGHT_M);
    task->shape = shape_prior_default();
    task->shape.mean.log[SHAPE_SCALE] = scale_log;
    if (s.height_from_points || (!s.legs_cropped && !s.head_cropped))
        task->shape.information[SHAPE_SCALE][SHAPE_SCALE] = 1 / (HEIGHT_SIGMA * HEIGHT_SIGMA);
    apply_skirt(task, s.height);
    task->learn_shape = false;
    struct vec3 root = standing_root(task, &s);
    struct pose_candidates rough = no_candidates(task, s.legs_cropped || !task->have_floor);
    task->point_stride = START_STRIDE;
    try_standing(task, &s, root, scratch, &rough);
    choose_best(task, &rough, scratch);
    if (scratch->best.energy > POOR_FIT_ENERGY && !s.side_cropped && !s.legs_cropped)
        try_kicks(task, root, scratch);
    return explained_share(task->evidence, &scratch->best, FOUND_M) > FOUND_SHARE;
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
