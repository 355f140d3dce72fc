#include "tests/world/edit.h"

#include "tests/world/numbers.h"
#include "tests/world/world_internal.h"

#include <math.h>

static const double PI = 3.14159265358979323846, DEGREE = 3.14159265358979323846 / 180;
static const struct quat unturned = {0, 0, 0, 1};
static const double RAMP_S = 0.3, BRIDGE_HALF_S = 0.1;

const char *world_edit_name(enum world_edit_kind kind)
{
    static const char *const names[EDIT_KINDS] = {
        "none",       "tempo",       "pause",    "late arm",  "missing",   "extra",      "range", "mirrored",
        "left elbow", "right elbow", "left arm", "right arm", "left knee", "right knee", "lean",
    };
    return names[kind];
}

// ---------------------------------------------------------------- time

static double eased(double x)
{
    const double t = most(0, least(1, x));
    return t * t * (3 - 2 * t);
}

double world_edit_seconds(const struct world_edit *e)
{
    switch (e->kind) {
    case EDIT_TEMPO: return e->seconds / e->amount;
    case EDIT_PAUSE:
    case EDIT_EXTRA: return e->seconds + e->amount;
    case EDIT_MISSING: return e->seconds - (e->to_s - e->from_s);
    default: return e->seconds;
    }
}

// As world_edit_reference_s, but what is added shows the instant at which it was added.
static double instant(const struct world_edit *e, double t)
{
    const double end_s = world_edit_seconds(e);
    t = most(0, least(end_s, t));
    switch (e->kind) {
    case EDIT_TEMPO:
        t = e->amount * t + 0.12 * sin(2 * PI * t / 2.3) * eased(t / 0.5) * eased((end_s - t) / 0.5);
        return most(0, least(e->seconds, t));
    case EDIT_PAUSE:
    case EDIT_EXTRA: return t < e->from_s ? t : most(e->from_s, t - e->amount);
    case EDIT_MISSING: return t < e->from_s ? t : t + e->to_s - e->from_s;
    default: return t;
    }
}

double world_edit_reference_s(const struct world_edit *e, double time_s)
{
    const bool added = e->kind == EDIT_EXTRA && time_s > e->from_s && time_s < e->from_s + e->amount;
    return added ? NAN : instant(e, time_s);
}

// ---------------------------------------------------------------- posture

struct performance {
    const struct world_edit *edit;
    const struct figure_motion *motion;
    const struct physique *physique;
};

static struct stance reference(const struct performance *p, double instant_s)
{
    return world_motion_at(p->motion, p->physique, p->edit->start_s + instant_s);
}

static struct vec3 turned(struct vec3 v, struct vec3 axis, double rad)
{
    return quat_rotate(quat_from_rotation_vector(v3_scale(v3_unit(axis), rad)), v);
}

static struct vec3 mirrored_vector(struct vec3 v) { return v3(-v.x, v.y, v.z); }
static struct quat mirrored_rotation(struct quat q) { return (struct quat){q.x, -q.y, -q.z, q.w}; }

// Across the plane x = 0: its normal turns round, and with it all rotations about other axes.
static struct stance mirror(const struct stance *s)
{
    struct stance m = {mirrored_vector(s->waist), mirrored_rotation(s->pelvis), mirrored_rotation(s->chest),
                       mirrored_rotation(s->head), .knee = {{0, 0, 0}}};
    for (int side = LEFT; side <= RIGHT; side++) {
        m.upper_arm[side] = mirrored_vector(s->upper_arm[!side]);
        m.forearm[side] = mirrored_vector(s->forearm[!side]);
        m.ankle[side] = mirrored_vector(s->ankle[!side]);
        m.foot[side] = mirrored_rotation(s->foot[!side]);
        m.knee[side] = mirrored_vector(s->knee[!side]);
    }
    return m;
}

static struct stance mix(const struct stance *a, const struct stance *b, double t)
{
    struct stance s = {v3_mix(a->waist, b->waist, t), quat_slerp(a->pelvis, b->pelvis, t),
                       quat_slerp(a->chest, b->chest, t), quat_slerp(a->head, b->head, t), .knee = {{0, 0, 0}}};
    for (int side = LEFT; side <= RIGHT; side++) {
        s.upper_arm[side] = v3_unit(v3_mix(a->upper_arm[side], b->upper_arm[side], t));
        s.forearm[side] = v3_unit(v3_mix(a->forearm[side], b->forearm[side], t));
        s.ankle[side] = v3_mix(a->ankle[side], b->ankle[side], t);
        s.foot[side] = quat_slerp(a->foot[side], b->foot[side], t);
        s.knee[side] = v3_mix(a->knee[side], b->knee[side], t);
    }
    return s;
}

static void bend_elbow(struct stance *s, int side, double rad)
{
    const struct vec3 upper = s->upper_arm[side], fore = s->forearm[side], across = v3_cross(upper, fore);
    // A straight arm is bent forwards.
    const struct vec3 ahead = quat_rotate(s->chest, v3(0, -1, 0));
    const bool straight = v3_length(across) < 0.3;
    s->forearm[side] = turned(fore, straight ? v3_cross(upper, ahead) : across, rad);
}

static void lower_arm(struct stance *s, int side, double rad)
{
    const struct vec3 upper = s->upper_arm[side], down = v3(0, 0, -1), axis = v3_cross(upper, down);
    const double up = atan2(v3_length(axis), v3_dot(upper, down));
    if (!(v3_length(axis) > 1e-6))
        return;
    s->upper_arm[side] = turned(upper, axis, least(rad, up));
    s->forearm[side] = turned(s->forearm[side], axis, least(rad, up));
}

static void bend_knee(const struct physique *p, struct stance *s, int side, double rad)
{
    const struct vec3 joint = p->bind_joint[side == LEFT ? JOINT_LEFT_HIP : JOINT_RIGHT_HIP];
    const struct vec3 hip = v3_add(s->waist, quat_rotate(s->pelvis, v3_sub(joint, p->bind_joint[JOINT_WAIST])));
    const struct vec3 leg = v3_sub(s->ankle[side], hip);
    const double a = p->thigh_m, b = p->shin_m, length = least(0.9995 * (a + b), v3_length(leg));
    // Law of cosines; a leg is never stretched further than physique_pose does.
    const double bent = acos(most(-1, least(1, (length * length - a * a - b * b) / (2 * a * b))));
    const double shorter = sqrt(a * a + b * b + 2 * a * b * cos(least(2.6, bent + rad)));
    s->ankle[side] = v3_add(hip, v3_scale(leg, shorter / v3_length(leg)));
}

static void lean(struct stance *s, double rad)
{
    const struct quat forwards = quat_from_rotation_vector(v3_scale(quat_rotate(s->pelvis, v3(1, 0, 0)), rad));
    s->chest = quat_multiply(forwards, s->chest);
    s->head = quat_multiply(forwards, s->head);
    for (int side = LEFT; side <= RIGHT; side++) {
        s->upper_arm[side] = quat_rotate(forwards, s->upper_arm[side]);
        s->forearm[side] = quat_rotate(forwards, s->forearm[side]);
    }
}

static struct vec3 scaled_about(struct vec3 direction, struct vec3 mean, double factor)
{
    const struct quat part = quat_slerp(unturned, quat_between(mean, direction), factor);
    return quat_rotate(part, v3_unit(mean));
}

static void scale_range(const struct performance *p, struct stance *s)
{
    enum { SAMPLES = 24 };
    struct vec3 upper[2] = {{0, 0, 0}, {0, 0, 0}}, fore[2] = {{0, 0, 0}, {0, 0, 0}};
    double waist = 0;
    for (int k = 0; k < SAMPLES; k++) {
        const struct stance at = reference(p, p->edit->seconds * (k + 0.5) / SAMPLES);
        const struct quat chest_from_world = quat_conjugate(at.chest);
        waist += at.waist.z / SAMPLES;
        for (int side = LEFT; side <= RIGHT; side++) {
            upper[side] = v3_add(upper[side], quat_rotate(chest_from_world, at.upper_arm[side]));
            fore[side] = v3_add(fore[side], quat_rotate(chest_from_world, at.forearm[side]));
        }
    }
    s->waist.z = waist + p->edit->amount * (s->waist.z - waist);
    for (int side = LEFT; side <= RIGHT; side++) {
        s->upper_arm[side] = scaled_about(s->upper_arm[side], quat_rotate(s->chest, upper[side]), p->edit->amount);
        s->forearm[side] = scaled_about(s->forearm[side], quat_rotate(s->chest, fore[side]), p->edit->amount);
    }
}

static void delay_arm(const struct performance *p, struct stance *s, double instant_s)
{
    const struct stance then = reference(p, most(0, instant_s - p->edit->amount));
    const struct quat now_from_then = quat_multiply(s->chest, quat_conjugate(then.chest));
    s->upper_arm[RIGHT] = quat_rotate(now_from_then, then.upper_arm[RIGHT]);
    s->forearm[RIGHT] = quat_rotate(now_from_then, then.forearm[RIGHT]);
}

static void raise_arms(struct stance *s, double share)
{
    const double way = sin(PI * most(0, least(1, share))); // to horizontal and back, from and to where they are
    for (int side = LEFT; side <= RIGHT; side++) {
        const struct vec3 out = quat_rotate(s->chest, v3(side == LEFT ? 1 : -1, 0, 0.2));
        s->upper_arm[side] =
            quat_rotate(quat_slerp(unturned, quat_between(s->upper_arm[side], out), way * way), s->upper_arm[side]);
        s->forearm[side] =
            quat_rotate(quat_slerp(unturned, quat_between(s->forearm[side], out), way * way), s->forearm[side]);
    }
}

static struct stance bridged(const struct performance *p, double time_s)
{
    const double left_out_s = p->edit->to_s - p->edit->from_s;
    const struct stance before = reference(p, time_s), after = reference(p, time_s + left_out_s);
    return mix(&before, &after, eased((time_s - p->edit->from_s + BRIDGE_HALF_S) / (2 * BRIDGE_HALF_S)));
}

struct stance world_edit_at(const struct world_edit *e, const struct figure_motion *motion,
                            const struct physique *physique, double time_s)
{
    const struct performance p = {e, motion, physique};
    const double now_s = instant(e, time_s);
    const double share = eased((time_s - e->from_s) / RAMP_S) * eased((e->to_s - time_s) / RAMP_S);
    const double rad = e->amount * share * DEGREE;
    struct stance s = reference(&p, now_s);
    switch (e->kind) {
    case EDIT_LATE: delay_arm(&p, &s, now_s); break;
    case EDIT_MISSING: return fabs(time_s - e->from_s) < BRIDGE_HALF_S ? bridged(&p, time_s) : s;
    case EDIT_EXTRA: raise_arms(&s, (time_s - e->from_s) / e->amount); break;
    case EDIT_RANGE: scale_range(&p, &s); break;
    case EDIT_MIRRORED: return mirror(&s);
    case EDIT_LEFT_ELBOW:
    case EDIT_RIGHT_ELBOW: bend_elbow(&s, e->kind == EDIT_LEFT_ELBOW ? LEFT : RIGHT, rad); break;
    case EDIT_LEFT_ARM:
    case EDIT_RIGHT_ARM: lower_arm(&s, e->kind == EDIT_LEFT_ARM ? LEFT : RIGHT, rad); break;
    case EDIT_LEFT_KNEE:
    case EDIT_RIGHT_KNEE: bend_knee(physique, &s, e->kind == EDIT_LEFT_KNEE ? LEFT : RIGHT, rad); break;
    case EDIT_LEAN: lean(&s, rad); break;
    default: break;
    }
    return s;
}
