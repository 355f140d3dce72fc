#include "reenact/select.h"

#include <stdlib.h>

// What a part looked like in one frame, as far as joints tell.
struct part_sight {
    bool known, excluded;
    bool bodily;           // eye and around are in bodily axes; else the twist is unknown and they are facing ones
    struct vec3 eye;       // unit, to the camera, in the part's bodily axes
    struct vec3 around[3]; // the joints of around_joints, in the part's bodily axes, metres
    uint8_t around_known;  // bit i: around[i] means something
    double hidden;         // share of the bone behind other parts, 0..1
    double distance_m;     // from the camera
    double guess;          // 1 - confidence of the worse end
};

struct candidate {
    int64_t frame;
    struct skeleton skeleton; // camera axes
    struct part_sight parts[PART_COUNT];
};

struct selector {
    struct candidate *candidates;
    int64_t count, capacity;
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

static struct part_sight sight_of(const struct skeleton *s, const struct body *body, enum part p)
{
    struct part_sight sight = {0};
    struct part_frame f;
    sight.bodily = part_frame_bodily(s, p, &f);
    if (!sight.bodily && !part_frame_facing(s, p, v3(0, 0, 0), &f))
        return sight;
    struct vec3 middle = v3_add(f.origin, v3_scale(f.z, f.length / 2));
    sight.distance_m = v3_length(middle);
    if (!(sight.distance_m > 1e-3))
        return sight;
    sight.known = true;
    sight.eye = v3_unit(part_frame_direction_in(&f, v3_scale(middle, -1)));
    for (int i = 0; i < 3; i++) {
        enum joint j = around_joints[p][i];
        if (s->confidence[j] > 0) {
            sight.around[i] = part_frame_point_in(&f, s->joint[j]);
            sight.around_known |= (uint8_t)(1 << i);
        }
    }
    sight.guess = 1 - fminf(s->confidence[part_ends[p].from], s->confidence[part_ends[p].to]);
    if (body)
        sight.hidden = hidden_share(s, body, p);
    return sight;
}

enum status selector_open(struct selector **out, int64_t capacity)
{
    assert(capacity >= 0);
    *out = NULL;
    struct selector *s = calloc(1, sizeof *s);
    struct candidate *candidates = calloc(capacity > 0 ? (size_t)capacity : 1, sizeof *candidates);
    if (!s || !candidates) {
        free(s);
        free(candidates);
        return fail(ERR_MEMORY, "out of memory");
    }
    *s = (struct selector){.candidates = candidates, .capacity = capacity};
    *out = s;
    return OK;
}

void selector_close(struct selector **s)
{
    if (!*s)
        return;
    free((*s)->candidates);
    free(*s);
    *s = NULL;
}

enum status selector_add(struct selector *s, int64_t frame, const struct skeleton *in_camera, const struct body *body)
{
    assert(s->count < s->capacity && (s->count == 0 || s->candidates[s->count - 1].frame < frame));
    enum status status = check(in_camera);
    if (status != OK)
        return status;
    struct candidate *c = &s->candidates[s->count++];
    c->frame = frame;
    c->skeleton = *in_camera;
    for (int p = 0; p < PART_COUNT; p++)
        c->parts[p] = sight_of(in_camera, body, (enum part)p);
    return OK;
}

void selector_exclude(struct selector *s, int64_t frame, enum part p)
{
    for (int64_t n = 0; n < s->count; n++)
        if (s->candidates[n].frame == frame)
            s->candidates[n].parts[p].excluded = true;
}

// Equation 5 for one pair; negative when they cannot be compared.
static double whole_cost(const struct skeleton *k, const struct skeleton *n, int needed)
{
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
    return joints >= needed ? sum * JOINT_COUNT / joints : -1;
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
    bool found = false;
    for (int64_t n = 0; n < s->count; n++) {
        double cost = whole_cost(in_viewer, &s->candidates[n].skeleton, (known + 1) / 2);
        if (cost >= 0 && (!found || cost < out->cost_m)) {
            *out = (struct selection){s->candidates[n].frame, cost};
            found = true;
        }
    }
    return found ? OK : NOTHING;
}

static double part_cost(const struct part_sight *k, const struct part_sight *n)
{
    // Between known and unknown twist the side is anybody's guess: a right angle off.
    double cost = SIDE_M * (k->bodily == n->bodily ? v3_distance(k->eye, n->eye) : 1.4);
    double sum = 0;
    int joints = 0;
    for (int i = 0; i < 3 && k->bodily == n->bodily; i++)
        if ((k->around_known & n->around_known) >> i & 1) {
            sum += v3_distance(k->around[i], n->around[i]);
            joints++;
        }
    if (joints)
        cost += AROUND_M * sum / joints;
    // No sharper than needed is no merit.
    if (n->distance_m > k->distance_m)
        cost += COARSE_M * (n->distance_m / k->distance_m - 1);
    return cost + HIDDEN_M * n->hidden + GUESS_M * n->guess;
}

enum status select_part(const struct selector *s, const struct skeleton *in_viewer, enum part p, struct selection *out)
{
    enum status status = check(in_viewer);
    if (status != OK)
        return status;
    struct part_sight wanted = sight_of(in_viewer, NULL, p);
    if (!wanted.known)
        return NOTHING;
    bool found = false;
    for (int64_t n = 0; n < s->count; n++) {
        const struct part_sight *sight = &s->candidates[n].parts[p];
        if (!sight->known || sight->excluded)
            continue;
        double cost = part_cost(&wanted, sight);
        if (!found || cost < out->cost_m) {
            *out = (struct selection){s->candidates[n].frame, cost};
            found = true;
        }
    }
    return found ? OK : NOTHING;
}
