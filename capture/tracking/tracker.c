#include "capture/tracking/tracker.h"

#include "capture/body/hem_detector.h"
#include "capture/body/pose_filter.h"
#include "capture/segmentation/segment.h"
#include "capture/tracking/tracker_backward.h"
#include "capture/tracking/occluded_shin.h"
#include "capture/tracking/pose_init.h"
#include "base/clock.h"

#include <stdlib.h>
#include <string.h>

enum {
    SPHERES_MAX = 2 * 4 * SOLID_COUNT,
    FLIP_EVERY = 4,
    FLIP_START_FRAMES = 24,
    LEARN_EVERY = 2,
    HEM_EVERY = 4,
    HEM_FRAMES_MIN = 8,
    STATIC_FRAMES_MIN = 12, // of those that are learned from, 0.8 s at 30 Hz; real people who were filmed reached 3
    SECOND_PERSON_EVERY = 5
};

#define EXPLAINED_SHARE_MIN                                                                                            \
    0.97                     // the share of somebody's points that lie within 6 cm of the body: of furniture less do,
#define FIT_ENERGY_MAX 120.0 // or a fit's energy is beyond this: points of people's 25 to 60
#define LIMB_JUMP_M    0.08  // a limb that a search moves further than this was lost

struct tracker {
    struct tracker_options options;
    struct calibration calibration;
    struct segmenter *segmenter;
    struct depth_evidence *evidence;
    struct fit_scratch *scratch;
    uint8_t *mask, *second_mask;
    bool following, backward;             // backward: frames come in falling order, their times negated here
    int detection_count;                  // how often somebody was found anew
    struct body_pose pose, previous_pose; // of the last two frames
    struct pose_filter filter;            // what was reported last
    int64_t time_ns, previous_ns;         // their times
    bool moving;                          // `before` is there
    struct body_pose prior_pose;          // in the next frame: where the other way had the body
    bool has_prior;
    struct shape_prior shape;
    double learned_s;
    struct hem_estimate hem;
    struct body_pose shape_pose; // the last one that taught much of the shape
    int64_t lost_since_ns;       // 0: in sight
    int poor_frames, frames, empty_frames;
    int static_object_frames; // before this one, in which nobody was followed, as it turns out now
    unsigned cropped;         // which of the picture's edges cut the person when they were found, or last thought over
    double flip_log_odds;     // that the person looks the other way, as a logarithm of odds
    double leg_swap_log_odds; // the same for their legs
    double limb_log_odds[LIMB_COUNT]; // and that a limb is elsewhere
    bool limb_relocated[LIMB_COUNT];  // in this frame it turned out to
    bool flipped;                     // in this frame they turned out to
    bool seen_ever[JOINT_COUNT];
    float out_of_image_s[JOINT_COUNT];
    struct tracker_times times;
    int64_t mark_ns; // of processor time: until here it is told in `times`
};

struct tracker_options tracker_default_options(void)
{
    return (struct tracker_options){.points = 600, .iterations = 5, .learn_s = 10, .patience_s = 0.7};
}

enum status tracker_open(struct tracker **out, const struct calibration *calibration,
                         const struct tracker_options *options)
{
    *out = NULL;
    struct tracker_options o = options ? *options : tracker_default_options();
    if (o.points < 100 || o.points > EVIDENCE_POINTS_MAX || o.iterations < 1 || o.iterations > 30 ||
        !(o.learn_s >= 0) || !(o.patience_s >= 0))
        return fail(ERR_INPUT, "tracking: points (%d) must be 100 to %d, iterations (%d) 1 to 30, times not negative",
                    o.points, EVIDENCE_POINTS_MAX, o.iterations);
    enum status status = lens_check(&calibration->depth, "depth");
    if (status != OK)
        return status;
    struct tracker *t = calloc(1, sizeof *t);
    if (!t)
        return fail(ERR_MEMORY, "not enough memory to track a person");
    t->options = o;
    t->calibration = *calibration;
    t->scratch = calloc(1, sizeof *t->scratch);
    t->mask = calloc((size_t)calibration->depth.width, (size_t)calibration->depth.height);
    t->second_mask = calloc((size_t)calibration->depth.width, (size_t)calibration->depth.height);
    status = t->scratch && t->mask && t->second_mask ? OK : fail(ERR_MEMORY, "not enough memory to track a person");
    if (status == OK)
        status = segmenter_open(&t->segmenter, &calibration->depth);
    if (status == OK)
        status = evidence_open(&t->evidence, &calibration->depth);
    if (status != OK) {
        tracker_close(&t);
        return status;
    }
    *out = t;
    return OK;
}

void tracker_close(struct tracker **t)
{
    if (!*t)
        return;
    if ((*t)->segmenter)
        segmenter_close(&(*t)->segmenter);
    if ((*t)->evidence)
        evidence_close(&(*t)->evidence);
    free((*t)->scratch);
    free((*t)->mask);
    free((*t)->second_mask);
    free(*t);
    *t = NULL;
}

void tracker_set_background(struct tracker *t, const uint16_t *depth) { segmenter_set_background(t->segmenter, depth); }

void tracker_set_floor(struct tracker *t, struct vec3 up, double height_m)
{
    segmenter_set_floor(t->segmenter, up, height_m);
}

struct tracker_times tracker_last_times(const struct tracker *t) { return t->times; }

// The time since the last call went into `step`.
static void add_elapsed(struct tracker *t, int64_t *step)
{
    int64_t now_ns = clock_cpu_ns();
    *step += now_ns - t->mark_ns;
    t->mark_ns = now_ns;
}

static void drop_person(struct tracker *t)
{
    t->following = t->moving = false;
    t->poor_frames = 0;
    t->flip_log_odds = t->leg_swap_log_odds = 0;
    memset(t->limb_log_odds, 0, sizeof t->limb_log_odds);
    memset(t->limb_relocated, 0, sizeof t->limb_relocated);
    t->lost_since_ns = 0;
    memset(t->seen_ever, 0, sizeof t->seen_ever);
    memset(t->out_of_image_s, 0, sizeof t->out_of_image_s);
    segmenter_drop_person(t->segmenter);
}

void tracker_reset(struct tracker *t)
{
    drop_person(t);
    t->backward = false;
    segmenter_reset(t->segmenter);
}

// The pose a frame later when everything goes on as it did, a little slower:
// limbs turn back more often than they speed up.
static struct body_pose predicted(const struct tracker *t, int64_t time_ns)
{
    struct body_pose pose = t->pose;
    double past = (double)(t->time_ns - t->previous_ns), ahead = (double)(time_ns - t->time_ns);
    if (!t->moving || past <= 0 || ahead <= 0 || ahead > 2e8)
        return pose;
    double rate = 0.8 * fmin(ahead / past, 3);
    pose.root = v3_add(t->pose.root, v3_scale(v3_sub(t->pose.root, t->previous_pose.root), rate));
    for (int s = 0; s < SEG_COUNT; s++) {
        struct vec3 rotation =
            quat_to_rotation_vector(quat_multiply(t->pose.rotation[s], quat_conjugate(t->previous_pose.rotation[s])));
        pose.rotation[s] =
            quat_unit(quat_multiply(quat_from_rotation_vector(v3_scale(rotation, rate)), t->pose.rotation[s]));
    }
    return pose;
}

// Adds a body's spheres; returns how many there are then.
static int add_spheres(const struct body_build *build, struct bounding_sphere spheres[SPHERES_MAX], int count)
{
    for (int i = 0; i < build->solids; i++) {
        const struct body_solid *s = &build->solid[i];
        for (int k = 0; k < 4; k++) {
            double t = k / 3.0;
            spheres[count++] =
                (struct bounding_sphere){v3_mix(s->a, s->b, t), s->radius_a + (s->radius_b - s->radius_a) * t +
                                                                    s->width_a + (s->width_b - s->width_a) * t};
        }
    }
    return count;
}

// Where the person is expected, by the way ahead and, once, by the other way.
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

enum { VISIBLE_PROBES_MIN = 3 }; // of EVIDENCE_PROBES

static void fill_skeleton(struct tracker *t, const struct fit_result *fit, double dt_s, struct skeleton *out)
{
    struct body_build build;
    body_forward_kinematics(&fit->shape, &t->filter.pose, &build);
    double size = exp(fit->shape.log[SHAPE_SCALE]) * BODY_AVERAGE_HEIGHT_M;
    static const double radius[JOINT_COUNT] = {
        [JOINT_HEAD] = 0.05,         [JOINT_NECK] = 0.04,        [JOINT_LEFT_SHOULDER] = 0.032,
        [JOINT_LEFT_ELBOW] = 0.024,  [JOINT_LEFT_HAND] = 0.017,  [JOINT_RIGHT_SHOULDER] = 0.032,
        [JOINT_RIGHT_ELBOW] = 0.024, [JOINT_RIGHT_HAND] = 0.017, [JOINT_TORSO] = 0.058,
        [JOINT_WAIST] = 0.058,       [JOINT_LEFT_HIP] = 0.055,   [JOINT_LEFT_KNEE] = 0.034,
        [JOINT_LEFT_FOOT] = 0.024,   [JOINT_RIGHT_HIP] = 0.055,  [JOINT_RIGHT_KNEE] = 0.034,
        [JOINT_RIGHT_FOOT] = 0.024,
    };
    for (int j = 0; j < JOINT_COUNT; j++) {
        struct vec3 p = build.joint[j];
        bool outside;
        int visible = evidence_visible_count(t->evidence, p, radius[j] * size, &outside);
        t->seen_ever[j] |= visible > 0;
        t->out_of_image_s[j] = outside ? t->out_of_image_s[j] + (float)dt_s : 0;
        out->joint[j] = pose_apply(t->calibration.color_from_depth, p);
        out->confidence[j] = visible >= VISIBLE_PROBES_MIN ? 1 : t->seen_ever[j] && t->out_of_image_s[j] < 1 ? 0.5f : 0;
    }
}

// How much a picture may add to the shape: pictures of one pose err alike
// (cloth, the model's own coarseness), a new pose tells something new.
static double novelty(const struct tracker *t, const struct body_pose *pose)
{
    double sum = 0;
    for (int s = 0; s < SEG_COUNT; s++) {
        struct vec3 rotation =
            quat_to_rotation_vector(quat_multiply(pose->rotation[s], quat_conjugate(t->shape_pose.rotation[s])));
        sum += v3_dot(rotation, rotation);
    }
    double angle = sqrt(sum / SEG_COUNT);
    return 0.002 + 0.1 * fmin(1, angle / 0.25) * fmin(1, angle / 0.25);
}

static void learn_shape(struct tracker *t, const struct fit_task *task, const struct fit_result *fit, double dt_s)
{
    t->shape.mean = fit->shape;
    for (int a = 0; a < SHAPE_COUNT; a++)
        for (int b = 0; b < SHAPE_COUNT; b++)
            t->shape.information[a][b] += task->learn_rate * fit->shape_information[a][b];
    t->learned_s += dt_s;
    if (task->learn_rate > 0.05)
        t->shape_pose = fit->pose;
}

enum { CROP_LEFT = 1, CROP_RIGHT = 2, CROP_TOP = 4, CROP_BOTTOM = 8 };

// Which of the picture's edges cut the person.
static unsigned crop_edges(const struct depth_evidence *e)
{
    return (e->left <= e->bounds.left + 2 ? CROP_LEFT : 0) | (e->right >= e->bounds.right - 2 ? CROP_RIGHT : 0) |
           (e->top <= e->bounds.top + 2 ? CROP_TOP : 0) | (e->bottom >= e->bounds.bottom - 2 ? CROP_BOTTOM : 0);
}

static bool is_uncropped(const struct depth_evidence *e)
{
    return !(crop_edges(e) & (CROP_LEFT | CROP_RIGHT | CROP_BOTTOM));
}

// Sums up what pictures gain by another pose, as a logarithm of odds. One picture alone says
// little: while something is lost, anything is better.
static bool accumulate_log_odds(double *evidence, double gain, double enough)
{
    *evidence = fmax(0, 0.9 * *evidence + fmin(gain, 0.4 * enough));
    if (*evidence < enough)
        return false;
    *evidence = 0;
    return true;
}

// People walk ahead more often than backwards, as a logarithm of odds.
static double walking_log_odds(const struct tracker *t)
{
    const double(*pelvis)[3] = (const double(*)[3])t->scratch->best.build.axes[SEG_PELVIS];
    struct vec3 ahead = v3(pelvis[0][2], pelvis[1][2], pelvis[2][2]);
    return (t->backward ? -6 : 6) *
           fmax(-1, fmin(1, -v3_dot(t->filter.speed[JOINT_WAIST], ahead) / 0.5)); // a slow walk: 0.5 m/s
}

// A person in front and one from behind look much alike, and so do legs that crossed. Now and
// then, at the start more often, the other way round is tried too: true when it has been
// likelier for a while; it is then in scratch->trial.
static bool is_flipped_likelier(struct tracker *t, const struct fit_task *task)
{
    // A fresh fit of any pose gains about a tenth; legs that are badly explained gain more. Of
    // those in a skirt there is less to see, and the two ways are fitted alike.
    double energy = t->scratch->best.energy;
    int every = t->frames < FLIP_START_FRAMES ? FLIP_EVERY / 2 : FLIP_EVERY;
    if (!is_uncropped(t->evidence)) // without feet nothing tells
        return false;
    if (t->frames % every == 0)
        return t->flipped = accumulate_log_odds(
                   &t->flip_log_odds, flipped_log_odds(task, t->scratch) - 0.1 * energy + walking_log_odds(t), 20);
    bool skirt = task->shape.mean.hem_m > 0;
    return t->frames % every == every / 2 &&
           accumulate_log_odds(&t->leg_swap_log_odds,
                               legs_swapped_log_odds(task, t->scratch) - (skirt ? 0.02 : 0.2) * energy,
                               skirt ? 10 : 20);
}

// An arm may hide before the trunk so that nothing is left unexplained: one arm a frame is thought over.
static void try_arm_alternative(struct tracker *t, struct fit_task *task, int arm)
{
    if (!accumulate_log_odds(&t->limb_log_odds[arm], limb_alternative_log_odds(task, arm, t->scratch) - 0.5, 3))
        return;
    task->expected = t->scratch->best.pose;
    limb_copy(arm, &t->scratch->trial.pose, &task->expected);
    task->expected_sigma = 2;
    body_fit(task, &task->expected, &t->scratch->best);
}

// The person turns out to wear a skirt or a coat, or none: what was learned so far was not their shape.
static void reset_clothing(struct tracker *t)
{
    double scale_log = t->shape.mean.log[SHAPE_SCALE];
    t->shape = shape_prior_default();
    t->shape.mean.log[SHAPE_SCALE] = scale_log;
    t->learned_s = 0;
}

// What the pictures say of a hem goes into the shape, for as long as that is learned.
static void update_hem(struct tracker *t, const struct fit_task *task)
{
    const struct body_build *build = &t->scratch->best.build;
    double height = exp(t->shape.mean.log[SHAPE_SCALE]) * BODY_AVERAGE_HEIGHT_M;
    struct vec3 spine = v3(build->axes[SEG_PELVIS][0][1], build->axes[SEG_PELVIS][1][1], build->axes[SEG_PELVIS][2][1]);
    struct hem hem;
    if (v3_dot(spine, task->up) < 0.95 || !hem_detect(task, height, &hem)) // bent, it hangs elsewhere
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

// Lays the body into this frame from where it is expected. False: it is not there.
static bool track_frame(struct tracker *t, struct fit_task *task, double dt_s)
{
    struct fit_result *best = &t->scratch->best;
    task->learn_shape = false;
    task->expected_sigma = fmin(6, fmax(1, dt_s * 30));
    int first = t->options.iterations / 2;
    task->iterations = first;
    task->kernel_m = 0.12;
    struct body_pose start = task->expected;
    if (first > 0) {
        task->rough = true;
        body_fit(task, &start, best);
        start = best->pose;
        task->rough = false;
    }
    task->iterations = t->options.iterations - first;
    task->kernel_m = 0.06;
    task->learn_shape = t->learned_s < t->options.learn_s && !t->backward;
    task->learn_rate = novelty(t, &start);
    body_fit(task, &start, best);
    add_elapsed(t, &t->times.fit);
    struct body_build fitted = best->build;
    double explained = explained_share(t->evidence, best, 0.06);
    if (explained < 0.985 && limb_search(task, t->scratch)) {
        start = best->pose;
        task->shape.mean = best->shape;
        body_fit(task, &start, &t->scratch->trial);
        *best = t->scratch->trial;
    }
    try_arm_alternative(t, task, t->frames % 2);
    t->frames++;
    t->flipped = false;
    if (is_flipped_likelier(t, task)) {
        task->expected = t->scratch->trial.pose;
        task->expected_sigma = 4;
        body_fit(task, &task->expected, best);
    }
    add_elapsed(t, &t->times.search);
    for (int k = 0; k < LIMB_COUNT; k++)
        t->limb_relocated[k] = limb_moved_m(k, &fitted, &best->build) > LIMB_JUMP_M;
    explained = explained_share(t->evidence, best, 0.10);
    t->poor_frames = explained < 0.7 ? t->poor_frames + 1 : 0;
    if (explained < 0.35 || t->poor_frames > 12)
        return false;
    if (task->learn_shape && explained_share(t->evidence, best, 0.06) > 0.985)
        learn_shape(t, task, best, dt_s);
    else
        t->learned_s += dt_s;
    if (task->learn_shape && t->frames % HEM_EVERY == 0)
        update_hem(t, task);
    return true;
}

// What was found in scratch->best is from now on what the person looks like.
static void adopt_fit(struct tracker *t, const struct fit_task *task)
{
    if (!t->backward) { // looking back, whoever is found is known
        t->shape = task->shape;
        t->shape.mean = t->scratch->best.shape;
    }
    t->shape_pose = t->scratch->best.pose;
    t->learned_s = 0;
    t->hem = (struct hem_estimate){0};
    t->frames = 0;
}

static bool detect_person(struct tracker *t, struct fit_task *task)
{
    bool found = pose_init_search(task, t->scratch);
    add_elapsed(t, &t->times.search);
    if (!found)
        return false;
    t->detection_count++;
    t->cropped = crop_edges(t->evidence);
    adopt_fit(t, task);
    return true;
}

// Of somebody whom the picture's edge cuts, or who is just coming in, a leg may be taken for all of them, and what
// follows holds on to that. When less of them is cut they are looked for once more, as if nothing was known.
static void reinitialise(struct tracker *t, struct fit_task *task)
{
    unsigned before = t->cropped, now = crop_edges(t->evidence);
    if (t->backward || __builtin_popcount(now) >= __builtin_popcount(before))
        return;
    t->cropped = now;
    if (pose_reinit(task, &t->scratch->best.pose, before & ~now & CROP_BOTTOM, t->scratch)) {
        adopt_fit(t, task);
        t->flipped = true; // this was no motion
        t->flip_log_odds = t->leg_swap_log_odds = 0;
        memset(t->limb_log_odds, 0, sizeof t->limb_log_odds);
        memset(t->limb_relocated, 0, sizeof t->limb_relocated);
    }
    add_elapsed(t, &t->times.search);
}

// What has not moved by a thing for seconds and is not much like a person is none when somebody else is, surely: it is
// a chair, perhaps, that was there before them.
static bool is_static_object(struct tracker *t, struct fit_task *task, const uint16_t *depth)
{
    struct fit_result *best = &t->scratch->best;
    if (t->backward || t->frames % SECOND_PERSON_EVERY || segmenter_static_frames(t->segmenter) < STATIC_FRAMES_MIN ||
        (explained_share(t->evidence, best, 0.06) > EXPLAINED_SHARE_MIN && best->energy < FIT_ENERGY_MAX))
        return false;
    struct body_pose pose = best->pose;
    struct body_shape shape = best->shape;
    struct fit_task other = *task;
    if (segmenter_second_person(t->segmenter, depth, t->second_mask) == OK &&
        evidence_read(t->evidence, depth, t->second_mask, t->options.points) && pose_init_search(&other, t->scratch) &&
        explained_share(t->evidence, best, 0.06) > EXPLAINED_SHARE_MIN)
        return true;
    if (!evidence_read(t->evidence, depth, t->mask, t->options.points))
        return true; // it was there a moment ago
    body_evaluate(task, &pose, &shape, best);
    return false;
}

// The one who is followed is lost, or none. False: nobody else is there either.
static bool find_other_person(struct tracker *t, const uint16_t *depth)
{
    drop_person(t);
    bool there = segmenter_next(t->segmenter, depth, NULL, 0, t->mask) == OK &&
                 evidence_read(t->evidence, depth, t->mask, t->options.points);
    add_elapsed(t, &t->times.segment);
    return there;
}

enum status tracker_next(struct tracker *t, int64_t time_ns, const uint16_t *depth, struct skeleton *out, uint8_t *mask)
{
    memset(out, 0, sizeof *out);
    t->times = (struct tracker_times){0};
    t->mark_ns = clock_cpu_ns();
    if (t->backward)
        time_ns = -time_ns;
    size_t pixels = (size_t)t->calibration.depth.width * (size_t)t->calibration.depth.height;
    if (mask)
        memset(mask, 0, pixels);
    if (t->following && (time_ns <= t->time_ns ||
                         (t->lost_since_ns && (double)(time_ns - t->lost_since_ns) > t->options.patience_s * 1e9))) {
        if (time_ns > t->time_ns)
            drop_person(t);
        t->moving = false;
    }
    double dt_s = t->following && time_ns > t->time_ns ? fmin(1, (double)(time_ns - t->time_ns) * 1e-9) : 1.0 / 30;
    struct body_pose expected = t->following ? predicted(t, time_ns) : t->pose;
    struct bounding_sphere spheres[SPHERES_MAX];
    int sphere_count = predict_spheres(t, &expected, spheres);
    enum status status = segmenter_next(t->segmenter, depth, spheres, sphere_count, t->mask);
    add_elapsed(t, &t->times.segment);
    if (status < 0)
        return status;
    struct fit_task task = {.point_stride = 1, .evidence = t->evidence, .expected = expected, .shape = t->shape};
    task.have_floor = segmenter_floor(t->segmenter, &task.up, &task.floor_m);
    bool there = status == OK && evidence_read(t->evidence, depth, t->mask, t->options.points);
    add_elapsed(t, &t->times.evidence);
    t->static_object_frames = 0;
    bool followed = there && t->following && track_frame(t, &task, dt_s);
    if (followed && is_static_object(t, &task, depth)) {
        t->static_object_frames = LEARN_EVERY * segmenter_static_frames(t->segmenter);
        segmenter_absorb_static(t->segmenter);
        followed = false;
    }
    if (there && t->following && !followed)
        there = find_other_person(t, depth);
    bool fresh = !t->following;
    if (there && !fresh)
        reinitialise(t, &task);
    if (there && fresh)
        there = t->following = detect_person(t, &task);
    if (!there) {
        if (t->following && !t->lost_since_ns)
            t->lost_since_ns = time_ns;
        else if (!t->following && t->empty_frames++ % LEARN_EVERY == 0) // what stands there now is furniture
            segmenter_update_background(t->segmenter);
        t->moving = false;
        return NOTHING;
    }
    t->lost_since_ns = 0;
    t->previous_pose = t->pose;
    t->previous_ns = t->time_ns;
    t->pose = t->scratch->best.pose;
    for (int k = 0; k < LIMB_COUNT; k++) // that was no motion, and does not go on
        if (t->limb_relocated[k])
            limb_copy(k, &t->pose, &t->previous_pose);
    t->moving = !fresh && !t->flipped && time_ns > t->time_ns;
    if (fresh || !t->moving)
        pose_filter_start(&t->filter, &t->scratch->best.shape, &t->pose);
    else
        pose_filter_update(&t->filter, &t->scratch->best.shape, &t->pose, dt_s);
    t->time_ns = time_ns;
    add_elapsed(t, &t->times.fit);
    if (fresh || t->frames % LEARN_EVERY == 0)
        segmenter_update_background(t->segmenter);
    add_elapsed(t, &t->times.segment);
    fill_skeleton(t, &t->scratch->best, dt_s, out);
    if (mask)
        memcpy(mask, t->mask, pixels);
    return OK;
}

// ------------------------------------------------------------- looking back

void tracker_begin_backward(struct tracker *t, const struct body_shape *shape)
{
    t->backward = true;
    t->shape.mean = *shape;
    t->moving = false;
    t->lost_since_ns = 0;
    t->flip_log_odds = t->leg_swap_log_odds = 0;
    memset(t->limb_log_odds, 0, sizeof t->limb_log_odds);
}

void tracker_add_prior(struct tracker *t, const struct body_pose *pose)
{
    t->prior_pose = *pose;
    t->has_prior = true;
}

const struct body_pose *tracker_pose(const struct tracker *t) { return &t->filter.pose; }

const struct body_shape *tracker_shape(const struct tracker *t) { return &t->shape.mean; }

int tracker_static_object_frames(const struct tracker *t) { return t->static_object_frames; }

int tracker_detection_count(const struct tracker *t) { return t->detection_count; }

// As far a reach as in the search for limbs: what is left unexplained has to count.
static struct fit_task evaluation_task(const struct tracker *t)
{
    struct fit_task task = {.point_stride = 1, .evidence = t->evidence, .shape = t->shape, .kernel_m = 0.12};
    task.have_floor = segmenter_floor(t->segmenter, &task.up, &task.floor_m);
    return task;
}

struct pose_log_odds tracker_log_odds(struct tracker *t, const struct body_pose *other)
{
    struct fit_task task = evaluation_task(t);
    return pose_compare(&task, &t->pose, other, t->scratch);
}

double tracker_shin_alternative(struct tracker *t, int leg, struct body_pose *out)
{
    struct fit_task task = evaluation_task(t);
    struct body_pose found;
    double gain = shin_alternative_log_odds(&task, leg, t->scratch, &found);
    *out = t->filter.pose;
    if (gain > 0)
        limb_copy(leg, &found, out);
    return gain;
}
