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
    BALLS_MAX = 2 * 4 * SOLID_COUNT,
    TURN_EVERY = 4,
    TURN_START = 24,
    LEARN_EVERY = 2,
    HEM_EVERY = 4,
    HEM_PICTURES = 8,
    STILL_PICTURES = 12, // of those that are learned from, 0.8 s at 30 Hz; real people who were filmed reached 3
    OTHER_EVERY = 5
};

#define SURELY_EXPLAINED 0.97  // the share of somebody's points that lie within 6 cm of the body: of furniture less do,
#define UNLIKELY         120.0 // or a fit's energy is beyond this: points of people's 25 to 60
#define ELSEWHERE_M      0.08  // a limb that a search moves further than this was lost

struct tracker {
    struct tracker_options options;
    struct calibration calibration;
    struct segmenter *segmenter;
    struct body_evidence *evidence;
    struct fit_room *room;
    uint8_t *mask, *spare;
    bool following, back;          // back: frames come in falling order, their times negated here
    int found_count;               // how often somebody was found anew
    struct body_pose pose, before; // of the last two frames
    struct body_steady shown;      // what was reported last
    int64_t time_ns, before_ns;    // their times
    bool moving;                   // `before` is there
    struct body_pose other;        // in the next frame: where the other way had the body
    bool has_other;
    struct shape_belief shape;
    double learned_s;
    struct hem_belief hem;
    struct body_pose taught; // the last one that taught much of the shape
    int64_t lost_since_ns;   // 0: in sight
    int poor_frames, frames, empty_frames;
    int furniture_frames;    // before this one, in which nobody was followed, as it turns out now
    unsigned cut;            // which of the picture's edges cut the person when they were found, or last thought over
    double turned_evidence;  // that the person looks the other way, as a logarithm of odds
    double swapped_evidence; // the same for their legs
    double elsewhere_evidence[LIMB_COUNT]; // and that a limb is elsewhere
    bool found_elsewhere[LIMB_COUNT];      // in this frame it turned out to
    bool turned;                           // in this frame they turned out to
    bool seen_ever[JOINT_COUNT];
    float out_of_picture_s[JOINT_COUNT];
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
    t->room = calloc(1, sizeof *t->room);
    t->mask = calloc((size_t)calibration->depth.width, (size_t)calibration->depth.height);
    t->spare = calloc((size_t)calibration->depth.width, (size_t)calibration->depth.height);
    status = t->room && t->mask && t->spare ? OK : fail(ERR_MEMORY, "not enough memory to track a person");
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
    free((*t)->room);
    free((*t)->mask);
    free((*t)->spare);
    free(*t);
    *t = NULL;
}

void tracker_set_background(struct tracker *t, const uint16_t *depth) { segmenter_set_background(t->segmenter, depth); }

void tracker_set_floor(struct tracker *t, struct vec3 up, double height_m)
{
    segmenter_set_floor(t->segmenter, up, height_m);
}

struct tracker_times tracker_times(const struct tracker *t) { return t->times; }

// The time since the last call went into `step`.
static void took(struct tracker *t, int64_t *step)
{
    int64_t now_ns = clock_cpu_ns();
    *step += now_ns - t->mark_ns;
    t->mark_ns = now_ns;
}

static void forget_person(struct tracker *t)
{
    t->following = t->moving = false;
    t->poor_frames = 0;
    t->turned_evidence = t->swapped_evidence = 0;
    memset(t->elsewhere_evidence, 0, sizeof t->elsewhere_evidence);
    memset(t->found_elsewhere, 0, sizeof t->found_elsewhere);
    t->lost_since_ns = 0;
    memset(t->seen_ever, 0, sizeof t->seen_ever);
    memset(t->out_of_picture_s, 0, sizeof t->out_of_picture_s);
    segmenter_forget_person(t->segmenter);
}

void tracker_reset(struct tracker *t)
{
    forget_person(t);
    t->back = false;
    segmenter_reset(t->segmenter);
}

// The pose a frame later when everything goes on as it did, a little slower:
// limbs turn back more often than they speed up.
static struct body_pose predicted(const struct tracker *t, int64_t time_ns)
{
    struct body_pose pose = t->pose;
    double past = (double)(t->time_ns - t->before_ns), ahead = (double)(time_ns - t->time_ns);
    if (!t->moving || past <= 0 || ahead <= 0 || ahead > 2e8)
        return pose;
    double rate = 0.8 * fmin(ahead / past, 3);
    pose.root = v3_add(t->pose.root, v3_scale(v3_sub(t->pose.root, t->before.root), rate));
    for (int s = 0; s < SEG_COUNT; s++) {
        struct vec3 turn = quat_to_rotation_vector(quat_multiply(t->pose.turn[s], quat_conjugate(t->before.turn[s])));
        pose.turn[s] = quat_unit(quat_multiply(quat_from_rotation_vector(v3_scale(turn, rate)), t->pose.turn[s]));
    }
    return pose;
}

// Adds a body's balls; returns how many there are then.
static int add_balls(const struct body_build *build, struct ball balls[BALLS_MAX], int count)
{
    for (int i = 0; i < build->solids; i++) {
        const struct body_solid *s = &build->solid[i];
        for (int k = 0; k < 4; k++) {
            double t = k / 3.0;
            balls[count++] = (struct ball){v3_mix(s->a, s->b, t), s->radius_a + (s->radius_b - s->radius_a) * t +
                                                                      s->width_a + (s->width_b - s->width_a) * t};
        }
    }
    return count;
}

// Where the person is expected, by the way ahead and, once, by the other way.
static int place_balls(struct tracker *t, const struct body_pose *expected, struct ball balls[BALLS_MAX])
{
    struct body_build build;
    int count = 0;
    if (t->following) {
        body_build(&t->shape.mean, expected, &build);
        count = add_balls(&build, balls, 0);
        if (t->has_other) {
            body_build(&t->shape.mean, &t->other, &build);
            count = add_balls(&build, balls, count);
        }
    }
    t->has_other = false;
    return count;
}

enum { MOST_SHOWN = 3 }; // of EVIDENCE_ABOUT

static void report(struct tracker *t, const struct fit_result *fit, double passed_s, struct skeleton *out)
{
    struct body_build build;
    body_build(&fit->shape, &t->shown.pose, &build);
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
        int shown = evidence_shown(t->evidence, p, radius[j] * size, &outside);
        t->seen_ever[j] |= shown > 0;
        t->out_of_picture_s[j] = outside ? t->out_of_picture_s[j] + (float)passed_s : 0;
        out->joint[j] = pose_apply(t->calibration.color_from_depth, p);
        out->confidence[j] = shown >= MOST_SHOWN ? 1 : t->seen_ever[j] && t->out_of_picture_s[j] < 1 ? 0.5f : 0;
    }
}

// How much a picture may add to the shape: pictures of one pose err alike
// (cloth, the model's own coarseness), a new pose tells something new.
static double novelty(const struct tracker *t, const struct body_pose *pose)
{
    double sum = 0;
    for (int s = 0; s < SEG_COUNT; s++) {
        struct vec3 turn = quat_to_rotation_vector(quat_multiply(pose->turn[s], quat_conjugate(t->taught.turn[s])));
        sum += v3_dot(turn, turn);
    }
    double angle = sqrt(sum / SEG_COUNT);
    return 0.002 + 0.1 * fmin(1, angle / 0.25) * fmin(1, angle / 0.25);
}

static void learn_shape(struct tracker *t, const struct fit_task *task, const struct fit_result *fit, double passed_s)
{
    t->shape.mean = fit->shape;
    for (int a = 0; a < SHAPE_COUNT; a++)
        for (int b = 0; b < SHAPE_COUNT; b++)
            t->shape.information[a][b] += task->learn_rate * fit->shape_information[a][b];
    t->learned_s += passed_s;
    if (task->learn_rate > 0.05)
        t->taught = fit->pose;
}

enum { CUT_LEFT = 1, CUT_RIGHT = 2, CUT_ABOVE = 4, CUT_BELOW = 8 };

// Which of the picture's edges cut the person.
static unsigned cuts(const struct body_evidence *e)
{
    return (e->left <= e->picture.left + 2 ? CUT_LEFT : 0) | (e->right >= e->picture.right - 2 ? CUT_RIGHT : 0) |
           (e->top <= e->picture.top + 2 ? CUT_ABOVE : 0) | (e->bottom >= e->picture.bottom - 2 ? CUT_BELOW : 0);
}

static bool is_whole(const struct body_evidence *e) { return !(cuts(e) & (CUT_LEFT | CUT_RIGHT | CUT_BELOW)); }

// Sums up what pictures gain by another pose, as a logarithm of odds. One picture alone says
// little: while something is lost, anything is better.
static bool is_likelier(double *evidence, double gain, double enough)
{
    *evidence = fmax(0, 0.9 * *evidence + fmin(gain, 0.4 * enough));
    if (*evidence < enough)
        return false;
    *evidence = 0;
    return true;
}

// People walk ahead more often than backwards, as a logarithm of odds.
static double backwards_odds(const struct tracker *t)
{
    const double(*pelvis)[3] = (const double(*)[3])t->room->best.build.axes[SEG_PELVIS];
    struct vec3 ahead = v3(pelvis[0][2], pelvis[1][2], pelvis[2][2]);
    return (t->back ? -6 : 6) *
           fmax(-1, fmin(1, -v3_dot(t->shown.speed[JOINT_WAIST], ahead) / 0.5)); // a slow walk: 0.5 m/s
}

// A person in front and one from behind look much alike, and so do legs that crossed. Now and
// then, at the start more often, the other way round is tried too: true when it has been
// likelier for a while; it is then in room->trial.
static bool is_otherwise(struct tracker *t, const struct fit_task *task)
{
    // A fresh fit of any pose gains about a tenth; legs that are badly explained gain more. Of
    // those in a skirt there is less to see, and the two ways are fitted alike.
    double energy = t->room->best.energy;
    int every = t->frames < TURN_START ? TURN_EVERY / 2 : TURN_EVERY;
    if (!is_whole(t->evidence)) // without feet nothing tells
        return false;
    if (t->frames % every == 0)
        return t->turned = is_likelier(&t->turned_evidence,
                                       turned_round_gain(task, t->room) - 0.1 * energy + backwards_odds(t), 20);
    bool tails = task->shape.mean.hem_m > 0;
    return t->frames % every == every / 2 &&
           is_likelier(&t->swapped_evidence, legs_swapped_gain(task, t->room) - (tails ? 0.02 : 0.2) * energy,
                       tails ? 10 : 20);
}

// An arm may hide before the trunk so that nothing is left unexplained: one arm a frame is thought over.
static void reconsider_arm(struct tracker *t, struct fit_task *task, int arm)
{
    if (!is_likelier(&t->elsewhere_evidence[arm], limb_elsewhere_gain(task, arm, t->room) - 0.5, 3))
        return;
    task->expected = t->room->best.pose;
    limb_copy(arm, &t->room->trial.pose, &task->expected);
    task->expected_sigma = 2;
    body_fit(task, &task->expected, &t->room->best);
}

// The person turns out to wear a skirt or a coat, or none: what was learned so far was not their shape.
static void dress_otherwise(struct tracker *t)
{
    double scale_log = t->shape.mean.log[SHAPE_SCALE];
    t->shape = shape_belief_start();
    t->shape.mean.log[SHAPE_SCALE] = scale_log;
    t->learned_s = 0;
}

// What the pictures say of a hem goes into the shape, for as long as that is learned.
static void learn_hem(struct tracker *t, const struct fit_task *task)
{
    const struct body_build *build = &t->room->best.build;
    double height = exp(t->shape.mean.log[SHAPE_SCALE]) * BODY_AVERAGE_HEIGHT_M;
    struct vec3 spine = v3(build->axes[SEG_PELVIS][0][1], build->axes[SEG_PELVIS][1][1], build->axes[SEG_PELVIS][2][1]);
    struct hem hem;
    if (v3_dot(spine, task->up) < 0.95 || !hem_find(task, height, &hem)) // bent, it hangs elsewhere
        return;
    hem_learn(&t->hem, &hem, v3_dot(task->up, build->origin[SEG_PELVIS]) + task->floor_m);
    if (t->hem.count < HEM_PICTURES)
        return;
    bool wears = t->shape.mean.hem_m > 0, worn = hem_is_worn(t->hem.narrow, t->hem.wide_m, height, wears);
    if (worn != wears)
        dress_otherwise(t);
    t->shape.mean.hem_m = worn ? t->hem.below_m : 0;
    t->shape.mean.hem_radius_m = worn ? 0.5 * t->hem.wide_m : 0;
}

// Lays the body into this frame from where it is expected. False: it is not there.
static bool follow(struct tracker *t, struct fit_task *task, double passed_s)
{
    struct fit_result *best = &t->room->best;
    task->learn_shape = false;
    task->expected_sigma = fmin(6, fmax(1, passed_s * 30));
    int first = t->options.iterations / 2;
    task->iterations = first;
    task->reach_m = 0.12;
    struct body_pose start = task->expected;
    if (first > 0) {
        task->rough = true;
        body_fit(task, &start, best);
        start = best->pose;
        task->rough = false;
    }
    task->iterations = t->options.iterations - first;
    task->reach_m = 0.06;
    task->learn_shape = t->learned_s < t->options.learn_s && !t->back;
    task->learn_rate = novelty(t, &start);
    body_fit(task, &start, best);
    took(t, &t->times.fit);
    struct body_build fitted = best->build;
    double explained = explained_share(t->evidence, best, 0.06);
    if (explained < 0.985 && limbs_search(task, t->room)) {
        start = best->pose;
        task->shape.mean = best->shape;
        body_fit(task, &start, &t->room->trial);
        *best = t->room->trial;
    }
    reconsider_arm(t, task, t->frames % 2);
    t->frames++;
    t->turned = false;
    if (is_otherwise(t, task)) {
        task->expected = t->room->trial.pose;
        task->expected_sigma = 4;
        body_fit(task, &task->expected, best);
    }
    took(t, &t->times.search);
    for (int k = 0; k < LIMB_COUNT; k++)
        t->found_elsewhere[k] = limb_moved_m(k, &fitted, &best->build) > ELSEWHERE_M;
    explained = explained_share(t->evidence, best, 0.10);
    t->poor_frames = explained < 0.7 ? t->poor_frames + 1 : 0;
    if (explained < 0.35 || t->poor_frames > 12)
        return false;
    if (task->learn_shape && explained_share(t->evidence, best, 0.06) > 0.985)
        learn_shape(t, task, best, passed_s);
    else
        t->learned_s += passed_s;
    if (task->learn_shape && t->frames % HEM_EVERY == 0)
        learn_hem(t, task);
    return true;
}

// What was found in room->best is from now on what the person looks like.
static void believe(struct tracker *t, const struct fit_task *task)
{
    if (!t->back) { // looking back, whoever is found is known
        t->shape = task->shape;
        t->shape.mean = t->room->best.shape;
    }
    t->taught = t->room->best.pose;
    t->learned_s = 0;
    t->hem = (struct hem_belief){0};
    t->frames = 0;
}

static bool start(struct tracker *t, struct fit_task *task)
{
    bool found = start_search(task, t->room);
    took(t, &t->times.search);
    if (!found)
        return false;
    t->found_count++;
    t->cut = cuts(t->evidence);
    believe(t, task);
    return true;
}

// Of somebody whom the picture's edge cuts, or who is just coming in, a leg may be taken for all of them, and what
// follows holds on to that. When less of them is cut they are looked for once more, as if nothing was known.
static void think_start_over(struct tracker *t, struct fit_task *task)
{
    unsigned before = t->cut, now = cuts(t->evidence);
    if (t->back || __builtin_popcount(now) >= __builtin_popcount(before))
        return;
    t->cut = now;
    if (start_over(task, &t->room->best.pose, before & ~now & CUT_BELOW, t->room)) {
        believe(t, task);
        t->turned = true; // this was no motion
        t->turned_evidence = t->swapped_evidence = 0;
        memset(t->elsewhere_evidence, 0, sizeof t->elsewhere_evidence);
        memset(t->found_elsewhere, 0, sizeof t->found_elsewhere);
    }
    took(t, &t->times.search);
}

// What has not moved by a thing for seconds and is not much like a person is none when somebody else is, surely: it is
// a chair, perhaps, that was there before them.
static bool is_furniture(struct tracker *t, struct fit_task *task, const uint16_t *depth)
{
    struct fit_result *best = &t->room->best;
    if (t->back || t->frames % OTHER_EVERY || segmenter_motionless(t->segmenter) < STILL_PICTURES ||
        (explained_share(t->evidence, best, 0.06) > SURELY_EXPLAINED && best->energy < UNLIKELY))
        return false;
    struct body_pose pose = best->pose;
    struct body_shape shape = best->shape;
    struct fit_task other = *task;
    if (segmenter_other(t->segmenter, depth, t->spare) == OK &&
        evidence_read(t->evidence, depth, t->spare, t->options.points) && start_search(&other, t->room) &&
        explained_share(t->evidence, best, 0.06) > SURELY_EXPLAINED)
        return true;
    if (!evidence_read(t->evidence, depth, t->mask, t->options.points))
        return true; // it was there a moment ago
    body_judge(task, &pose, &shape, best);
    return false;
}

// The one who is followed is lost, or none. False: nobody else is there either.
static bool look_elsewhere(struct tracker *t, const uint16_t *depth)
{
    forget_person(t);
    bool there = segmenter_next(t->segmenter, depth, NULL, 0, t->mask) == OK &&
                 evidence_read(t->evidence, depth, t->mask, t->options.points);
    took(t, &t->times.segment);
    return there;
}

enum status tracker_next(struct tracker *t, int64_t time_ns, const uint16_t *depth, struct skeleton *out, uint8_t *mask)
{
    memset(out, 0, sizeof *out);
    t->times = (struct tracker_times){0};
    t->mark_ns = clock_cpu_ns();
    if (t->back)
        time_ns = -time_ns;
    size_t pixels = (size_t)t->calibration.depth.width * (size_t)t->calibration.depth.height;
    if (mask)
        memset(mask, 0, pixels);
    if (t->following && (time_ns <= t->time_ns ||
                         (t->lost_since_ns && (double)(time_ns - t->lost_since_ns) > t->options.patience_s * 1e9))) {
        if (time_ns > t->time_ns)
            forget_person(t);
        t->moving = false;
    }
    double passed_s = t->following && time_ns > t->time_ns ? fmin(1, (double)(time_ns - t->time_ns) * 1e-9) : 1.0 / 30;
    struct body_pose expected = t->following ? predicted(t, time_ns) : t->pose;
    struct ball balls[BALLS_MAX];
    int ball_count = place_balls(t, &expected, balls);
    enum status status = segmenter_next(t->segmenter, depth, balls, ball_count, t->mask);
    took(t, &t->times.segment);
    if (status < 0)
        return status;
    struct fit_task task = {.every = 1, .evidence = t->evidence, .expected = expected, .shape = t->shape};
    task.have_floor = segmenter_floor(t->segmenter, &task.up, &task.floor_m);
    bool there = status == OK && evidence_read(t->evidence, depth, t->mask, t->options.points);
    took(t, &t->times.evidence);
    t->furniture_frames = 0;
    bool followed = there && t->following && follow(t, &task, passed_s);
    if (followed && is_furniture(t, &task, depth)) {
        t->furniture_frames = LEARN_EVERY * segmenter_motionless(t->segmenter);
        segmenter_put_away(t->segmenter);
        followed = false;
    }
    if (there && t->following && !followed)
        there = look_elsewhere(t, depth);
    bool fresh = !t->following;
    if (there && !fresh)
        think_start_over(t, &task);
    if (there && fresh)
        there = t->following = start(t, &task);
    if (!there) {
        if (t->following && !t->lost_since_ns)
            t->lost_since_ns = time_ns;
        else if (!t->following && t->empty_frames++ % LEARN_EVERY == 0) // what stands there now is furniture
            segmenter_learn(t->segmenter);
        t->moving = false;
        return NOTHING;
    }
    t->lost_since_ns = 0;
    t->before = t->pose;
    t->before_ns = t->time_ns;
    t->pose = t->room->best.pose;
    for (int k = 0; k < LIMB_COUNT; k++) // that was no motion, and does not go on
        if (t->found_elsewhere[k])
            limb_copy(k, &t->pose, &t->before);
    t->moving = !fresh && !t->turned && time_ns > t->time_ns;
    if (fresh || !t->moving)
        body_steady_start(&t->shown, &t->room->best.shape, &t->pose);
    else
        body_steady_next(&t->shown, &t->room->best.shape, &t->pose, passed_s);
    t->time_ns = time_ns;
    took(t, &t->times.fit);
    if (fresh || t->frames % LEARN_EVERY == 0)
        segmenter_learn(t->segmenter);
    took(t, &t->times.segment);
    report(t, &t->room->best, passed_s, out);
    if (mask)
        memcpy(mask, t->mask, pixels);
    return OK;
}

// ------------------------------------------------------------- looking back

void tracker_turn_back(struct tracker *t, const struct body_shape *shape)
{
    t->back = true;
    t->shape.mean = *shape;
    t->moving = false;
    t->lost_since_ns = 0;
    t->turned_evidence = t->swapped_evidence = 0;
    memset(t->elsewhere_evidence, 0, sizeof t->elsewhere_evidence);
}

void tracker_also_there(struct tracker *t, const struct body_pose *pose)
{
    t->other = *pose;
    t->has_other = true;
}

const struct body_pose *tracker_pose(const struct tracker *t) { return &t->shown.pose; }

const struct body_shape *tracker_shape(const struct tracker *t) { return &t->shape.mean; }

int tracker_furniture_frames(const struct tracker *t) { return t->furniture_frames; }

int tracker_found_count(const struct tracker *t) { return t->found_count; }

// As far a reach as in the search for limbs: what is left unexplained has to count.
static struct fit_task weighing(const struct tracker *t)
{
    struct fit_task task = {.every = 1, .evidence = t->evidence, .shape = t->shape, .reach_m = 0.12};
    task.have_floor = segmenter_floor(t->segmenter, &task.up, &task.floor_m);
    return task;
}

struct pose_odds tracker_weigh(struct tracker *t, const struct body_pose *other)
{
    struct fit_task task = weighing(t);
    return pose_weigh(&task, &t->pose, other, t->room);
}

double tracker_shin_aside(struct tracker *t, int leg, struct body_pose *out)
{
    struct fit_task task = weighing(t);
    struct body_pose found;
    double gain = shin_aside_gain(&task, leg, t->room, &found);
    *out = t->shown.pose;
    if (gain > 0)
        limb_copy(leg, &found, out);
    return gain;
}
