#include "capture/tracking/skeleton_smoother.h"

#include "capture/tracking/tracker_backward.h"

#include <stdlib.h>
#include <string.h>

#define GAP_NS            200000000 // frames further from each other are not one motion
#define AGREE_M           0.06      // two places of a limb about this far apart are half averaged
#define TURNED_M          0.15      // trunks further apart stand another way round
#define PICTURE_ODDS_MOST 3         // one picture alone may err
#define CHANGE_M          0.05      // a limb that goes this far from one frame to the next costs 1 in odds
#define CHANGE_ODDS_MOST  50.0
#define WALK_ODDS         1.5 // in a frame, for somebody who walks ahead and not backwards
#define WALK_M_S          0.5 // a slow walk
#define IMPOSSIBLE        1e6
#define AROUND_NS         500000000 // so far to both sides trembling is averaged
#define LINE_M            0.010     // off the line between two moments; more is motion
#define FASTEST_M_S       6.5       // of a thrown punch, as in pose_filter.c
enum { SMOOTHINGS = 2 };            // the second knows better than the first where the line is
enum { SLOWINGS = 60 };
enum { STEPS = 5 };    // frames to both sides in which walking is measured
enum { REPAIRS = 40 }; // lengths and speeds undo each other: so often in turn they agree

// The way forward, the way back, and of a leg that is mostly hidden, where its outline has it in that picture.
enum way { AHEAD, BACK, ASIDE, WAYS };

struct moment {
    int64_t time_ns;
    int person; // counts those found; -1: nobody
    bool looked_back;
    struct body_pose pose;     // the way forward, as told
    struct skeleton way[WAYS]; // depth camera's axes
    struct pose_odds odds;     // against the way forward
    double aside[LIMB_COUNT];  // odds for ASIDE against the way back; 0: there is no such place
    enum way round;            // where they differ about which way round the person stands, this one is right
    struct skeleton settled;   // at last in the colour camera's axes
};

struct settle {
    struct calibration calibration;
    struct moment *moment;
    int64_t count, room;
    struct body_shape *shape; // of each person found, as known last
    int people;
    bool looking_back;
    int looked_at; // the person
};

static const struct {
    enum joint root, bend, tip;
} limb[LIMB_COUNT] = {
    {JOINT_LEFT_SHOULDER, JOINT_LEFT_ELBOW, JOINT_LEFT_HAND},
    {JOINT_RIGHT_SHOULDER, JOINT_RIGHT_ELBOW, JOINT_RIGHT_HAND},
    {JOINT_LEFT_HIP, JOINT_LEFT_KNEE, JOINT_LEFT_FOOT},
    {JOINT_RIGHT_HIP, JOINT_RIGHT_KNEE, JOINT_RIGHT_FOOT},
};

enum status settle_open(struct settle **out, const struct calibration *calibration)
{
    if (!(*out = calloc(1, sizeof **out)))
        return fail(ERR_MEMORY, "not enough memory to think a take over");
    (*out)->calibration = *calibration;
    return OK;
}

void settle_close(struct settle **s)
{
    if (!*s)
        return;
    free((*s)->moment);
    free((*s)->shape);
    free(*s);
    *s = NULL;
}

// ------------------------------------------------------------- there and back

static enum status make_room(struct settle *s, int people)
{
    if (s->count == s->room) {
        int64_t room = s->room ? 2 * s->room : 256;
        struct moment *grown = realloc(s->moment, (size_t)room * sizeof *grown);
        if (!grown)
            return fail(ERR_MEMORY, "not enough memory to think a take over");
        s->moment = grown;
        s->room = room;
    }
    if (people > s->people) {
        struct body_shape *grown = realloc(s->shape, (size_t)people * sizeof *grown);
        if (!grown)
            return fail(ERR_MEMORY, "not enough memory to think a take over");
        memset(grown + s->people, 0, (size_t)(people - s->people) * sizeof *grown);
        s->shape = grown;
        s->people = people;
    }
    return OK;
}

enum status settle_note(struct settle *s, const struct tracker *t, int64_t time_ns, const struct skeleton *told)
{
    assert(!s->count || time_ns > s->moment[s->count - 1].time_ns);
    enum status status = make_room(s, tracker_found_count(t));
    if (status != OK)
        return status;
    for (int k = 1; k <= tracker_furniture_frames(t) && k <= s->count; k++)
        s->moment[s->count - k].person = -1;
    struct moment *m = &s->moment[s->count++];
    *m = (struct moment){.time_ns = time_ns, .person = -1};
    if (!told)
        return OK;
    m->person = tracker_found_count(t) - 1;
    m->pose = *tracker_pose(t);
    m->way[AHEAD] = *told;
    s->shape[m->person] = *tracker_shape(t);
    return OK;
}

// Where this picture alone has the legs that the way back has wrong.
static void look_aside(struct moment *m, struct tracker *t)
{
    m->way[ASIDE] = m->way[BACK];
    for (int k = 0; k < LIMB_COUNT; k++) {
        struct body_pose pose;
        struct body_build build;
        m->aside[k] = k < FIRST_LEG ? 0 : tracker_shin_aside(t, k, &pose);
        if (!(m->aside[k] > 0))
            continue;
        body_build(tracker_shape(t), &pose, &build);
        m->way[ASIDE].joint[limb[k].bend] = build.joint[limb[k].bend];
        m->way[ASIDE].joint[limb[k].tip] = build.joint[limb[k].tip];
    }
}

enum status settle_look_back(struct settle *s, struct tracker *t, int64_t index, const uint16_t *depth)
{
    assert(index >= 0 && index < s->count);
    struct moment *m = &s->moment[index];
    struct skeleton told;
    if (!s->looking_back || (m->person >= 0 && m->person != s->looked_at)) {
        tracker_turn_back(t, m->person < 0 ? tracker_shape(t) : &s->shape[m->person]);
        s->looked_at = m->person;
    }
    s->looking_back = true;
    if (m->person >= 0)
        tracker_also_there(t, &m->pose);
    enum status status = tracker_next(t, m->time_ns, depth, &told, NULL);
    if (status < 0)
        return status;
    if (status != OK || m->person < 0)
        return OK;
    m->looked_back = true;
    m->way[BACK] = skeleton_transform(pose_inverse(s->calibration.color_from_depth), &told);
    m->odds = tracker_weigh(t, &m->pose);
    look_aside(m, t);
    return OK;
}

// ------------------------------------------------------------- deciding

enum { TRUNK = LIMB_COUNT };   // beside the limbs: which way round the person stands
enum { STATES = WAYS * WAYS }; // choices of ways for a left and a right limb

static uint8_t state_of(enum way left, enum way right) { return (uint8_t)(left * WAYS + right); }
static enum way left_way(int state) { return (enum way)(state / WAYS); }
static enum way right_way(int state) { return (enum way)(state % WAYS); }

static double farther(const struct skeleton *a, const struct skeleton *b, int k)
{
    if (k < LIMB_COUNT)
        return fmax(v3_distance(a->joint[limb[k].bend], b->joint[limb[k].bend]),
                    v3_distance(a->joint[limb[k].tip], b->joint[limb[k].tip]));
    double most = 0;
    for (int i = 0; i < LIMB_COUNT; i++)
        most = fmax(most, v3_distance(a->joint[limb[i].root], b->joint[limb[i].root]));
    return most;
}

static bool is_turned(const struct moment *m) { return farther(&m->way[AHEAD], &m->way[BACK], TRUNK) > TURNED_M; }

// People walk ahead more often than backwards, as a logarithm of odds.
static double walking_odds(const struct moment *m, int64_t count, int64_t i, enum way w)
{
    int64_t from = i > STEPS ? i - STEPS : 0, to = i + STEPS < count ? i + STEPS : count - 1;
    const struct vec3 *j = m[i].way[w].joint;
    struct vec3 left = v3_sub(j[JOINT_LEFT_HIP], j[JOINT_RIGHT_HIP]), up = v3_sub(j[JOINT_NECK], j[JOINT_WAIST]),
                way = v3_sub(m[to].way[AHEAD].joint[JOINT_WAIST], m[from].way[AHEAD].joint[JOINT_WAIST]);
    double passed_s = 1e-9 * (double)(m[to].time_ns - m[from].time_ns);
    if (!(passed_s > 0))
        return 0;
    return WALK_ODDS * fmax(-1, fmin(1, v3_dot(way, v3_unit(v3_cross(left, up))) / (passed_s * WALK_M_S)));
}

// What speaks against each way round in moment i, as a logarithm of odds.
static void find_trunk_odds(const struct moment *m, int64_t count, int64_t i, double against[STATES])
{
    const struct moment *at = &m[i];
    bool turned = at->looked_back && is_turned(at);
    for (int state = 0; state < STATES; state++)
        against[state] = IMPOSSIBLE;
    double *ahead = &against[state_of(AHEAD, AHEAD)], *back = &against[state_of(BACK, BACK)];
    *ahead = 0;
    if (!at->looked_back)
        return;
    *back = 0;
    if (!turned)
        return;
    *ahead = fmax(-PICTURE_ODDS_MOST, fmin(PICTURE_ODDS_MOST, at->odds.whole)) - walking_odds(m, count, i, AHEAD);
    *back = -walking_odds(m, count, i, BACK);
}

// The same against each choice of ways for a pair of limbs, `first` and the next.
static void find_pair_odds(const struct moment *at, int first, double against[STATES])
{
    bool turned = at->looked_back && is_turned(at);
    double least = IMPOSSIBLE;
    for (int state = 0; state < STATES; state++) {
        enum way left = left_way(state), right = right_way(state);
        const double(*odds)[2] = (const double(*)[2])at->odds.pair[first / 2];
        against[state] = odds[left == AHEAD][right == AHEAD] - (left == ASIDE ? at->aside[first] : 0) -
                         (right == ASIDE ? at->aside[first + 1] : 0);
        bool there = (left != ASIDE || at->aside[first] > 0) && (right != ASIDE || at->aside[first + 1] > 0);
        if (!at->looked_back || turned)
            there = left == right && left == (turned ? at->round : AHEAD);
        if (!there)
            against[state] = IMPOSSIBLE;
        least = fmin(least, against[state]);
    }
    for (int state = 0; state < STATES; state++)
        if (against[state] < IMPOSSIBLE)
            against[state] = fmin(PICTURE_ODDS_MOST, against[state] - least);
}

// What speaks against part k going from each way to each, from the moment before `m` to it.
static void find_changes(const struct moment *m, int k, double change[WAYS][WAYS])
{
    for (int v = 0; v < WAYS; v++)
        for (int w = 0; w < WAYS; w++)
            change[v][w] = fmin(farther(&m->way[w], &m[-1].way[v], k) / CHANGE_M, CHANGE_ODDS_MOST);
}

// What speaks against any of these choices: the logarithm of the odds, of which the lowest weigh most.
static double any_of(const double against[STATES])
{
    double least = INFINITY, sum = 0;
    for (int s = 0; s < STATES; s++)
        least = fmin(least, against[s]);
    for (int s = 0; s < STATES; s++)
        sum += exp(least - against[s]);
    return least - log(sum);
}

// What the pictures say in moment i, of a pair of limbs, `first` and the next, or of the trunk (TRUNK), and how choices
// follow on each other from the moment before.
struct step {
    double against[STATES], change[STATES][STATES];
};

static void find_step(const struct moment *m, int64_t count, int64_t i, int first, struct step *out)
{
    double left[WAYS][WAYS] = {0}, right[WAYS][WAYS] = {0};
    if (first == TRUNK)
        find_trunk_odds(m, count, i, out->against);
    else
        find_pair_odds(&m[i], first, out->against);
    if (i)
        find_changes(&m[i], first, left);
    if (i && first != TRUNK)
        find_changes(&m[i], first + 1, right);
    for (int r = 0; r < STATES; r++)
        for (int s = 0; s < STATES; s++)
            out->change[r][s] = left[left_way(r)][left_way(s)] + right[right_way(r)][right_way(s)];
}

// How likely each choice of ways is in each of `count` moments, by all sequences of choices (forward and backward,
// Rabiner 1989): by what the pictures say and by how far a part would go from frame to frame. Legs may be exchanged in
// one of the ways, so that both are chosen together.
static void find_likely(const struct moment *m, int64_t count, int first, double (*likely)[STATES])
{
    struct step step;
    double sum[STATES], after[STATES] = {0};
    for (int64_t i = 0; i < count; i++) { // for now, what speaks against it up to here
        find_step(m, count, i, first, &step);
        for (int s = 0; s < STATES; s++) {
            for (int r = 0; i && r < STATES; r++)
                sum[r] = likely[i - 1][r] + step.change[r][s];
            likely[i][s] = step.against[s] + (i ? any_of(sum) : 0);
        }
    }
    for (int64_t i = count - 1; i >= 0; i--) {
        for (int s = 0; s < STATES; s++)
            likely[i][s] += after[s];
        double all = any_of(likely[i]);
        for (int s = 0; s < STATES; s++)
            likely[i][s] = exp(all - likely[i][s]);
        find_step(m, count, i, first, &step);
        double then[STATES];
        memcpy(then, after, sizeof then);
        for (int r = 0; r < STATES; r++) {
            for (int s = 0; s < STATES; s++)
                sum[s] = step.change[r][s] + step.against[s] + then[s];
            after[r] = any_of(sum);
        }
    }
}

// The mean of both ways where they agree.
static void join_ways(struct moment *m)
{
    m->settled = m->way[m->looked_back && is_turned(m) ? m->round : AHEAD];
    if (!m->looked_back || is_turned(m))
        return;
    for (int j = 0; j < JOINT_COUNT; j++) {
        m->settled.joint[j] = v3_mix(m->way[AHEAD].joint[j], m->way[BACK].joint[j], 0.5);
        if (m->way[BACK].confidence[j] == 1)
            m->settled.confidence[j] = 1;
    }
}

// Where a limb's joint is if `way` is right about the limb: the other one counts, too, where it agrees.
static struct vec3 place_by(const struct moment *m, int k, enum way way, enum joint joint)
{
    if (way == ASIDE)
        return m->way[ASIDE].joint[joint];
    double off = farther(&m->way[AHEAD], &m->way[BACK], k) / AGREE_M, other = 0.5 * exp(-off * off);
    return v3_mix(m->way[AHEAD].joint[joint], m->way[BACK].joint[joint], way == BACK ? 1 - other : other);
}

// The mean over what each choice says, as likely as it is: of a limb that nobody sees, what is least wrong.
static void join_pair(struct moment *m, int first, const double likely[STATES])
{
    if (!m->looked_back || is_turned(m))
        return;
    for (int k = first; k < first + 2; k++) {
        const enum joint joint[2] = {limb[k].bend, limb[k].tip};
        for (int i = 0; i < 2; i++) {
            struct vec3 mean = {0, 0, 0};
            for (int s = 0; s < STATES; s++) {
                enum way way = k == first ? left_way(s) : right_way(s);
                mean = v3_add(mean, v3_scale(place_by(m, k, way, joint[i]), likely[s]));
            }
            m->settled.joint[joint[i]] = mean;
        }
    }
}

// ------------------------------------------------------------- smoothing

// Each place becomes the mean of itself and of the lines between a moment before and one after,
// as many as meet it, the nearest first: trembling is averaged, straight motion stays what it is,
// and where it bends the lines soon miss.
static void smooth(const struct moment *m, int64_t count, const struct vec3 *is, struct vec3 *out)
{
    for (int64_t i = 0; i < count; i++) {
        double weight = 1, sum = 1;
        struct vec3 mean = is[i];
        for (int64_t k = 1; k <= i && i + k < count && weight > 1e-3; k++) {
            int64_t before = m[i].time_ns - m[i - k].time_ns, after = m[i + k].time_ns - m[i].time_ns;
            if (before > AROUND_NS || after > AROUND_NS)
                break;
            struct vec3 line = v3_mix(is[i - k], is[i + k], (double)before / (double)(before + after));
            double off = v3_distance(line, is[i]) / LINE_M;
            weight = fmin(weight, exp(-off * off));
            mean = v3_add(mean, v3_scale(line, 2 * weight)); // two moments
            sum += 2 * weight;
        }
        out[i] = v3_scale(mean, 1 / sum);
    }
}

// Where the ways are changed at a distance, the limb is told on its way there, as much before as
// after, not faster than a body moves.
static void keep_speed(struct moment *m, int64_t count, enum joint j)
{
    bool fast = true;
    for (int round = 0; fast && round < SLOWINGS; round++) {
        fast = false;
        for (int64_t i = 1; i < count; i++) {
            struct vec3 *is = &m[i].settled.joint[j], *was = &m[i - 1].settled.joint[j];
            double far = v3_distance(*is, *was), most = FASTEST_M_S * (double)(m[i].time_ns - m[i - 1].time_ns) * 1e-9;
            if (far <= 1.001 * most)
                continue;
            struct vec3 back = v3_scale(v3_sub(*was, *is), 0.5 * (far - most) / far);
            *is = v3_add(*is, back);
            *was = v3_sub(*was, back);
            fast = true;
        }
    }
}

static void smooth_joints(struct moment *m, int64_t count, struct vec3 *is, struct vec3 *smoothed)
{
    for (int j = 0; j < JOINT_COUNT; j++) {
        for (int64_t i = 0; i < count; i++)
            is[i] = m[i].settled.joint[j];
        for (int round = 0; round < SMOOTHINGS; round++) {
            smooth(m, count, is, smoothed);
            memcpy(is, smoothed, (size_t)count * sizeof *is);
        }
        for (int64_t i = 0; i < count; i++)
            m[i].settled.joint[j] = is[i];
    }
}

// Means of places shorten bones: each limb gets its person's lengths again.
static void restore_lengths(struct moment *m, const struct body_build *build)
{
    struct vec3 *joint = m->settled.joint;
    for (int k = 0; k < LIMB_COUNT; k++) {
        const enum joint chain[3] = {limb[k].root, limb[k].bend, limb[k].tip};
        for (int i = 1; i < 3; i++) {
            double length = v3_distance(build->joint[chain[i]], build->joint[chain[i - 1]]);
            struct vec3 along = v3_unit(v3_sub(joint[chain[i]], joint[chain[i - 1]]));
            joint[chain[i]] = v3_add(joint[chain[i - 1]], v3_scale(along, length));
        }
    }
}

// Moments that follow each other, of one person.
static int64_t stretch_end(const struct settle *s, int64_t first)
{
    int64_t end = first + 1;
    while (end < s->count && s->moment[end].person == s->moment[first].person &&
           s->moment[end].time_ns - s->moment[end - 1].time_ns <= GAP_NS)
        end++;
    return end;
}

struct settle_room {
    double (*likely)[STATES];
    struct vec3 *is, *smoothed;
};

static void settle_stretch(struct settle *s, struct moment *m, int64_t count, const struct settle_room *room)
{
    const struct body_shape *shape = &s->shape[m->person];
    struct body_build build;
    for (int64_t i = 0; i < count; i++) {
        body_build(shape, &m[i].pose, &build);
        memcpy(m[i].way[AHEAD].joint, build.joint, sizeof build.joint);
    }
    find_likely(m, count, TRUNK, room->likely);
    for (int64_t i = 0; i < count; i++) {
        const double *likely = room->likely[i];
        m[i].round = likely[state_of(BACK, BACK)] > likely[state_of(AHEAD, AHEAD)] ? BACK : AHEAD;
        join_ways(&m[i]);
    }
    for (int first = 0; first < LIMB_COUNT; first += 2) {
        find_likely(m, count, first, room->likely);
        for (int64_t i = 0; i < count; i++)
            join_pair(&m[i], first, room->likely[i]);
    }
    smooth_joints(m, count, room->is, room->smoothed);
    for (int round = 0; round < REPAIRS; round++) {
        for (int j = 0; j < JOINT_COUNT; j++)
            keep_speed(m, count, (enum joint)j);
        for (int64_t i = 0; i < count; i++)
            restore_lengths(&m[i], &build);
    }
    for (int64_t i = 0; i < count; i++)
        m[i].settled = skeleton_transform(s->calibration.color_from_depth, &m[i].settled);
}

enum status settle_finish(struct settle *s)
{
    size_t count = (size_t)s->count + 1;
    struct settle_room room = {calloc(count, sizeof *room.likely), calloc(count, sizeof *room.is),
                               calloc(count, sizeof *room.smoothed)};
    bool enough = room.likely && room.is && room.smoothed;
    for (int64_t first = 0, end; enough && first < s->count; first = end) {
        end = stretch_end(s, first);
        if (s->moment[first].person >= 0)
            settle_stretch(s, &s->moment[first], end - first, &room);
    }
    free(room.likely);
    free(room.is);
    free(room.smoothed);
    return enough ? OK : fail(ERR_MEMORY, "not enough memory to think a take over");
}

const struct skeleton *settle_skeleton(const struct settle *s, int64_t index)
{
    assert(index >= 0 && index < s->count);
    return s->moment[index].person >= 0 ? &s->moment[index].settled : NULL;
}
