#include "reenact/retrieval/frame_selection.h"

#include "base/memory.h"
#include "reenact/retrieval/pose_index.h"

#include <stdlib.h>

// What a part looked like in one frame, as far as joints tell. One line of the caches: so many are looked at in a
// search, each somewhere else, that fetching them takes longer than comparing them.
struct part_sight {
    _Alignas(MEMORY_LINE) bool known;
    bool excluded;
    bool bodily;          // eye and around are in bodily axes; else the twist is unknown and they are facing ones
    uint8_t around_known; // bit i: around[i] means something
    float distance_m;     // from the camera
    float own_m;          // cost of what is hidden and of what is guessed of it, whatever it is compared with
    float eye[3];         // unit, to the camera, in the part's bodily axes
    float around[3][3];   // the joints of around_joints, in the part's bodily axes, metres
};
static_assert(sizeof(struct part_sight) == MEMORY_LINE, "a line of the caches");

// One of each array for a frame that was added; they are looked at in different
// searches, so they lie apart.
struct selector {
    int64_t count, capacity;
    int64_t *frames;
    struct skeleton *skeletons;                // camera axes
    struct part_sight *sights[PART_COUNT];     // [slot] of parts; all of them in what sights[0] points to
    struct nearest *whole, *parts[PART_COUNT]; // which need not be looked at
};

// What bounds are counted in: a joint up to 4 m from the neck, a metre of a part's cost.
static const double WHOLE_UNIT_M = 1.0 / 2048, PART_UNIT_M = 1.0 / 8192;

// The neck is where skeletons are laid on each other. The others begin with
// those that differ most from pose to pose, so that most are told apart soon.
static const enum joint whole_joints[] = {
    JOINT_LEFT_HAND,      JOINT_RIGHT_HAND, JOINT_LEFT_FOOT,  JOINT_RIGHT_FOOT, JOINT_LEFT_ELBOW,
    JOINT_RIGHT_ELBOW,    JOINT_LEFT_KNEE,  JOINT_RIGHT_KNEE, JOINT_HEAD,       JOINT_LEFT_SHOULDER,
    JOINT_RIGHT_SHOULDER, JOINT_WAIST,      JOINT_LEFT_HIP,   JOINT_RIGHT_HIP,  JOINT_TORSO,
};

// The neighbours whose place about a part changes how its surface lies.
static const enum joint around_joints[PART_COUNT][3] = {
    [PART_HEAD] = {JOINT_TORSO, JOINT_LEFT_SHOULDER, JOINT_RIGHT_SHOULDER},
    [PART_UPPER_TORSO] = {JOINT_WAIST, JOINT_LEFT_ELBOW, JOINT_RIGHT_ELBOW},
    [PART_LOWER_TORSO] = {JOINT_NECK, JOINT_LEFT_KNEE, JOINT_RIGHT_KNEE},
    [PART_LEFT_UPPER_ARM] = {JOINT_NECK, JOINT_TORSO, JOINT_LEFT_HAND},
    [PART_LEFT_FOREARM] = {JOINT_LEFT_SHOULDER, JOINT_NECK, JOINT_TORSO},
    [PART_RIGHT_UPPER_ARM] = {JOINT_NECK, JOINT_TORSO, JOINT_RIGHT_HAND},
    [PART_RIGHT_FOREARM] = {JOINT_RIGHT_SHOULDER, JOINT_NECK, JOINT_TORSO},
    [PART_LEFT_THIGH] = {JOINT_WAIST, JOINT_RIGHT_HIP, JOINT_LEFT_FOOT},
    [PART_LEFT_SHIN] = {JOINT_LEFT_HIP, JOINT_WAIST, JOINT_RIGHT_HIP},
    [PART_RIGHT_THIGH] = {JOINT_WAIST, JOINT_LEFT_HIP, JOINT_RIGHT_FOOT},
    [PART_RIGHT_SHIN] = {JOINT_RIGHT_HIP, JOINT_WAIST, JOINT_LEFT_HIP},
};

// Costs are metres. That the body is bent alike about the part counts most: cloth,
// light and what lies over what follow it. The side comes next: a chord of one
// brings about a radius of unseen surface in.
static const double SIDE_M = 0.25;   // a chord of 1 between the two directions to the camera
static const double AROUND_M = 1.5;  // a metre of mean difference of the joints around
static const double HIDDEN_M = 0.5;  // the whole bone hidden
static const double COARSE_M = 0.06; // twice as far away as what is to be shown
static const double GUESS_M = 0.3;   // ends of confidence 0

static enum status check(const struct skeleton *s)
{
    for (int j = 0; j < JOINT_COUNT; j++)
        if (s->confidence[j] > 0 && !v3_finite(s->joint[j]))
            return fail(ERR_INPUT, "the skeleton's %s is not at a finite place", joint_name((enum joint)j));
    return OK;
}

// Does the sight line from the camera (origin) to `p` pass within `radius` of bone a-b before it?
static bool passes(struct vec3 p, struct vec3 a, struct vec3 b, double radius)
{
    // Closest approach of the segments 0..p and a..b, by a few alternating projections:
    // the distance is convex, and a centimetre is all that is asked.
    double s = 1, t = 0.5;
    struct vec3 ab = v3_sub(b, a);
    double pp = v3_dot(p, p), bb = v3_dot(ab, ab);
    if (!(pp > 0) || !(bb > 0))
        return false;
    for (int i = 0; i < 8; i++) {
        t = v3_dot(v3_sub(v3_scale(p, s), a), ab) / bb;
        t = t < 0 ? 0 : t > 1 ? 1 : t;
        s = v3_dot(v3_mix(a, b, t), p) / pp;
        s = s < 0 ? 0 : s > 1 ? 1 : s;
    }
    return s < 1 && v3_distance(v3_scale(p, s), v3_mix(a, b, t)) < radius;
}

static double hidden_share(const struct skeleton *s, const struct body *body, enum part p)
{
    enum { SAMPLES = 4 };
    struct part_ends ends = part_ends[p];
    double own = body->radius_rate[p] * v3_distance(s->joint[ends.from], s->joint[ends.to]);
    int hidden = 0;
    for (int i = 0; i < SAMPLES; i++) {
        struct vec3 at = v3_mix(s->joint[ends.from], s->joint[ends.to], (i + 0.5) / SAMPLES);
        double far = v3_length(at);
        if (!(far > own))
            continue;
        at = v3_scale(at, 1 - own / far); // the side that faces the camera
        for (int o = 0; o < PART_COUNT; o++) {
            struct part_ends other = part_ends[o];
            bool joined =
                other.from == ends.from || other.from == ends.to || other.to == ends.from || other.to == ends.to;
            if (o == (int)p || joined || !part_is_known(body, s, (enum part)o))
                continue;
            struct vec3 a = s->joint[other.from], b = s->joint[other.to];
            if (passes(at, a, b, body->radius_rate[o] * v3_distance(a, b))) {
                hidden++;
                break;
            }
        }
    }
    return (double)hidden / SAMPLES;
}

static void put(float out[3], struct vec3 v) { out[0] = (float)v.x, out[1] = (float)v.y, out[2] = (float)v.z; }

static struct vec3 put_back(const float v[3]) { return v3((double)v[0], (double)v[1], (double)v[2]); }

static struct part_sight sight_of(const struct skeleton *s, const struct body *body, enum part p)
{
    struct part_sight sight = {0};
    struct part_frame f;
    sight.bodily = part_frame_bodily(s, p, &f);
    if (!sight.bodily && !part_frame_facing(s, p, v3(0, 0, 0), &f))
        return sight;
    struct vec3 middle = part_frame_middle(&f);
    sight.distance_m = (float)v3_length(middle);
    if (!(sight.distance_m > 1e-3F))
        return sight;
    sight.known = true;
    put(sight.eye, v3_unit(part_frame_direction_in(&f, v3_scale(middle, -1))));
    for (int i = 0; i < 3; i++) {
        enum joint j = around_joints[p][i];
        if (s->confidence[j] > 0) {
            put(sight.around[i], part_frame_point_in(&f, s->joint[j]));
            sight.around_known |= (uint8_t)(1 << i);
        }
    }
    double guess = fmaxf(0, 1 - fminf(s->confidence[part_ends[p].from], s->confidence[part_ends[p].to]));
    double hidden = body ? hidden_share(s, body, p) : 0;
    sight.own_m = (float)(HIDDEN_M * hidden + GUESS_M * guess);
    return sight;
}

// ---------------------------------------------------------------- bounds

// Its cost is at least 16 / (joints known in the one looked for) times the sum of distances.
static struct nearest_point whole_point(const struct skeleton *s)
{
    struct nearest_point point = {.known = 0};
    if (!(s->confidence[JOINT_NECK] > 0))
        return point;
    for (size_t i = 0; i < COUNT_OF(whole_joints); i++)
        if (s->confidence[whole_joints[i]] > 0) {
            point.place[i] = v3_sub(s->joint[whole_joints[i]], s->joint[JOINT_NECK]);
            point.known |= 1u << i;
        }
    return point;
}

enum { PART_PLACES = 4 };

// Bodily and facing axes have nothing to do with each other: of the rarer, facing ones nothing is known.
static struct nearest_point part_point(const struct part_sight *sight)
{
    struct nearest_point point = {.own_m = (double)sight->own_m};
    if (!sight->bodily)
        return point;
    point.place[0] = v3_scale(put_back(sight->eye), SIDE_M);
    for (int i = 0; i < 3; i++)
        point.place[i + 1] = v3_scale(put_back(sight->around[i]), AROUND_M / 3);
    point.known = 1 | (uint32_t)sight->around_known << 1;
    return point;
}

// ---------------------------------------------------------------- candidates

static enum status open_arrays(struct selector *s)
{
    size_t room = s->capacity > 0 ? (size_t)s->capacity : 1;
    s->frames = calloc(room, sizeof *s->frames);
    s->skeletons = calloc(room, sizeof *s->skeletons);
    struct part_sight *sights = memory_in_lines(PART_COUNT * room * sizeof *sights);
    bool enough = s->frames && s->skeletons && sights;
    for (int p = 0; p < PART_COUNT && sights; p++)
        s->sights[p] = sights + (size_t)p * room;
    enum status status = enough ? OK : fail(ERR_MEMORY, "out of memory");
    if (status == OK)
        status = nearest_open(&s->whole, COUNT_OF(whole_joints), WHOLE_UNIT_M, s->capacity);
    for (int p = 0; p < PART_COUNT && status == OK; p++)
        status = nearest_open(&s->parts[p], PART_PLACES, PART_UNIT_M, s->capacity);
    return status;
}

enum status selector_open(struct selector **out, int64_t capacity)
{
    assert(capacity >= 0);
    *out = NULL;
    struct selector *s = calloc(1, sizeof *s);
    if (!s)
        return fail(ERR_MEMORY, "out of memory");
    s->capacity = capacity;
    enum status status = open_arrays(s);
    if (status != OK)
        selector_close(&s);
    *out = s;
    return status;
}

void selector_close(struct selector **s)
{
    if (!*s)
        return;
    nearest_close(&(*s)->whole);
    for (int p = 0; p < PART_COUNT; p++)
        nearest_close(&(*s)->parts[p]);
    free((*s)->sights[0]);
    free((*s)->skeletons);
    free((*s)->frames);
    free(*s);
    *s = NULL;
}

enum status selector_add(struct selector *s, int64_t frame, const struct skeleton *in_camera, const struct body *body)
{
    assert(s->count < s->capacity && (s->count == 0 || s->frames[s->count - 1] < frame));
    enum status status = check(in_camera);
    if (status != OK)
        return status;
    int64_t n = s->count++;
    s->frames[n] = frame;
    s->skeletons[n] = *in_camera;
    struct nearest_point point = whole_point(in_camera);
    nearest_add(s->whole, &point);
    for (int p = 0; p < PART_COUNT; p++) {
        s->sights[p][n] = sight_of(in_camera, body, (enum part)p);
        point = part_point(&s->sights[p][n]);
        nearest_add(s->parts[p], &point);
    }
    return OK;
}

enum status selector_settle(struct selector *s)
{
    enum status status = OK;
    for (int p = 0; p < PART_COUNT && status == OK; p++)
        status = nearest_settle(s->parts[p], s->sights[p], sizeof *s->sights[p]);
    return status;
}

void selector_exclude(struct selector *s, int64_t frame, enum part p)
{
    int64_t low = 0, high = s->count; // the first whose frame is not before `frame`
    while (low < high) {
        int64_t middle = low + (high - low) / 2;
        if (s->frames[middle] < frame)
            low = middle + 1;
        else
            high = middle;
    }
    if (low < s->count && s->frames[low] == frame)
        s->sights[p][nearest_slot(s->parts[p], low)].excluded = true;
}

static enum status chosen(const struct selector *s, const struct nearest_query *q, struct selection *out)
{
    if (q->number < 0)
        return NOTHING;
    *out = (struct selection){s->frames[q->number], q->cost_m};
    return OK;
}

// ---------------------------------------------------------------- the whole body

struct whole_wanted {
    const struct skeleton *skeletons, *skeleton;
    int needed; // joints that have to be known in both
};

// Equation 5 for one pair; negative when they cannot be compared.
static double whole_cost(const void *context, int64_t number)
{
    const struct whole_wanted *wanted = context;
    const struct skeleton *k = wanted->skeleton, *n = &wanted->skeletons[number];
    if (!(n->confidence[JOINT_NECK] > 0))
        return -1;
    int joints = 0;
    double sum = 0;
    for (int j = 0; j < JOINT_COUNT; j++) {
        if (!(k->confidence[j] > 0) || !(n->confidence[j] > 0))
            continue;
        joints++;
        sum += v3_distance(v3_sub(k->joint[j], k->joint[JOINT_NECK]), v3_sub(n->joint[j], n->joint[JOINT_NECK]));
    }
    return joints >= wanted->needed ? sum * JOINT_COUNT / joints : -1;
}

enum status select_whole(const struct selector *s, const struct skeleton *in_viewer, struct selection *out)
{
    enum status status = check(in_viewer);
    if (status != OK)
        return status;
    if (!(in_viewer->confidence[JOINT_NECK] > 0))
        return NOTHING;
    int known = 0;
    for (int j = 0; j < JOINT_COUNT; j++)
        known += in_viewer->confidence[j] > 0;
    struct whole_wanted wanted = {s->skeletons, in_viewer, (known + 1) / 2};
    struct nearest_query query = {s->whole, whole_point(in_viewer), (double)JOINT_COUNT / known, &wanted, -1, 0};
    nearest_find_all(&query, 1, whole_cost);
    return chosen(s, &query, out);
}

// ---------------------------------------------------------------- one part

struct part_wanted {
    const struct part_sight *sights;
    struct part_sight sight;
};

static double part_cost(const void *context, int64_t slot)
{
    const struct part_wanted *wanted = context;
    const struct part_sight *k = &wanted->sight, *n = &wanted->sights[slot];
    if (!n->known || n->excluded)
        return -1;
    // Between known and unknown twist the side is anybody's guess: a right angle off.
    double cost = SIDE_M * (k->bodily == n->bodily ? v3_distance(put_back(k->eye), put_back(n->eye)) : 1.4);
    double sum = 0;
    int joints = 0;
    for (int i = 0; i < 3 && k->bodily == n->bodily; i++)
        if ((k->around_known & n->around_known) >> i & 1) {
            sum += v3_distance(put_back(k->around[i]), put_back(n->around[i]));
            joints++;
        }
    if (joints)
        cost += AROUND_M * sum / joints;
    // No sharper than needed is no merit.
    if (n->distance_m > k->distance_m)
        cost += COARSE_M * ((double)n->distance_m / (double)k->distance_m - 1);
    return cost + (double)n->own_m;
}

enum status select_part(const struct selector *s, const struct skeleton *in_viewer, enum part p, struct selection *out)
{
    enum status status = check(in_viewer);
    if (status != OK)
        return status;
    struct part_wanted wanted = {s->sights[p], sight_of(in_viewer, NULL, p)};
    if (!wanted.sight.known)
        return NOTHING;
    struct nearest_query query = {s->parts[p], part_point(&wanted.sight), 1, &wanted, -1, 0};
    nearest_find_all(&query, 1, part_cost);
    return chosen(s, &query, out);
}

enum status select_parts(const struct selector *s, const struct skeleton *in_viewer, struct selection out[PART_COUNT])
{
    struct part_wanted wanted[PART_COUNT];
    struct nearest_query queries[PART_COUNT];
    int parts[PART_COUNT], count = 0;
    enum status status = check(in_viewer);
    if (status != OK)
        return status;
    for (int p = 0; p < PART_COUNT; p++) {
        out[p] = (struct selection){-1, 0};
        wanted[count] = (struct part_wanted){s->sights[p], sight_of(in_viewer, NULL, (enum part)p)};
        if (!wanted[count].sight.known)
            continue;
        queries[count] =
            (struct nearest_query){s->parts[p], part_point(&wanted[count].sight), 1, &wanted[count], -1, 0};
        parts[count++] = p;
    }
    if (count)
        nearest_find_all(queries, count, part_cost);
    enum status any = NOTHING;
    for (int i = 0; i < count; i++)
        any = chosen(s, &queries[i], &out[parts[i]]) == OK ? OK : any;
    return any;
}
