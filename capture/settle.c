#include "capture/settle.h"

#include "capture/tracker_back.h"

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
#define FASTEST_M_S       6.5       // of a thrown punch, as in body_steady.c
enum { SMOOTHINGS = 2 };            // the second knows better than the first where the line is
enum { SLOWINGS = 60 };
enum { STEPS = 5 };    // frames to both sides in which walking is measured
enum { REPAIRS = 40 }; // lengths and speeds undo each other: so often in turn they agree

enum way { AHEAD, BACK, WAYS };

struct moment {
    int64_t time_ns;
    int person; // counts those found; -1: nobody
    bool looked_back;
    struct body_pose pose;     // the way forward, as told
    struct skeleton way[WAYS]; // depth camera's axes
    struct pose_odds odds;     // against the way forward
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
    return OK;
}

// ------------------------------------------------------------- deciding

enum { TRUNK = LIMB_COUNT, PARTS }; // beside the limbs: which way round the person stands

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

// What speaks against way w of part k in moment i, as a logarithm of odds.
static double odds_against(const struct moment *m, int64_t count, int64_t i, int k, enum way w)
{
    const struct moment *at = &m[i];
    if (w == BACK && !at->looked_back)
        return IMPOSSIBLE;
    bool turned = at->looked_back && is_turned(at);
    if (k < LIMB_COUNT && turned)
        return w == at->round ? 0 : IMPOSSIBLE;
    double odds = k < LIMB_COUNT ? at->odds.limb[k] : turned ? at->odds.whole : 0;
    odds = w == AHEAD ? fmax(-PICTURE_ODDS_MOST, fmin(PICTURE_ODDS_MOST, odds)) : 0;
    return odds - (k == TRUNK && turned ? walking_odds(m, count, i, w) : 0);
}

// Which way is right about part k in each of `count` moments: the likeliest sequence (Viterbi 1967)
// of ways, by what the pictures say and by how far the part would go from frame to frame.
// from[i][w] is room for the way before way w.
static void decide(const struct moment *m, int64_t count, int k, uint8_t (*from)[WAYS], uint8_t *way)
{
    double cost[WAYS] = {0};
    for (int64_t i = 0; i < count; i++) {
        double next[WAYS];
        for (int w = 0; w < WAYS; w++) {
            double best = i ? INFINITY : 0;
            for (int v = 0; i && v < WAYS; v++) {
                double change = fmin(farther(&m[i].way[w], &m[i - 1].way[v], k) / CHANGE_M, CHANGE_ODDS_MOST),
                       there = cost[v] + change;
                if (there < best) {
                    best = there;
                    from[i][w] = (uint8_t)v;
                }
            }
            next[w] = best + odds_against(m, count, i, k, (enum way)w);
        }
        memcpy(cost, next, sizeof cost);
    }
    way[count - 1] = cost[BACK] < cost[AHEAD] ? BACK : AHEAD;
    for (int64_t i = count - 1; i > 0; i--)
        way[i - 1] = from[i][way[i]];
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

static void join_limb(struct moment *m, int k, enum way way)
{
    if (!m->looked_back || is_turned(m))
        return;
    double off = farther(&m->way[AHEAD], &m->way[BACK], k) / AGREE_M, other = 0.5 * exp(-off * off),
           back = way == BACK ? 1 - other : other;
    const enum joint joint[2] = {limb[k].bend, limb[k].tip};
    for (int i = 0; i < 2; i++)
        m->settled.joint[joint[i]] = v3_mix(m->way[AHEAD].joint[joint[i]], m->way[BACK].joint[joint[i]], back);
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
    uint8_t (*from)[WAYS], *way;
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
    decide(m, count, TRUNK, room->from, room->way);
    for (int64_t i = 0; i < count; i++) {
        m[i].round = (enum way)room->way[i];
        join_ways(&m[i]);
    }
    for (int k = 0; k < LIMB_COUNT; k++) {
        decide(m, count, k, room->from, room->way);
        for (int64_t i = 0; i < count; i++)
            join_limb(&m[i], k, room->way[i]);
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
    struct settle_room room = {calloc(count, sizeof *room.from), calloc(count, 1), calloc(count, sizeof *room.is),
                               calloc(count, sizeof *room.smoothed)};
    bool enough = room.from && room.way && room.is && room.smoothed;
    for (int64_t first = 0, end; enough && first < s->count; first = end) {
        end = stretch_end(s, first);
        if (s->moment[first].person >= 0)
            settle_stretch(s, &s->moment[first], end - first, &room);
    }
    free(room.from);
    free(room.way);
    free(room.is);
    free(room.smoothed);
    return enough ? OK : fail(ERR_MEMORY, "not enough memory to think a take over");
}

const struct skeleton *settle_skeleton(const struct settle *s, int64_t index)
{
    assert(index >= 0 && index < s->count);
    return s->moment[index].person >= 0 ? &s->moment[index].settled : NULL;
}
