#include "tests/world/motion.h"

#include "tests/world/keys.h"
#include "tests/world/numbers.h"
#include "tests/world/posture.h"
#include "tests/world/retarget.h"
#include "tests/world/world.h"

#include <stdlib.h>
#include <string.h>

// Key poses, or a file, or a posture.
struct figure_motion {
    const struct named_motion *named;
    struct retarget *file;
    struct posture_motion posture; // where neither of the two
};

static const double DEGREE = 3.14159265358979323846 / 180;

static struct quat rotation_of(double yaw, double pitch, double roll) // degrees: about z, then own x, then own y
{
    struct quat q = quat_from_rotation_vector(v3(0, 0, yaw * DEGREE));
    q = quat_multiply(q, quat_from_rotation_vector(v3(pitch * DEGREE, 0, 0)));
    return quat_multiply(q, quat_from_rotation_vector(v3(0, roll * DEGREE, 0)));
}

// Cubic Hermite interpolation with slopes from the neighbours (Catmull-Rom for uneven times), number by number.
static struct key key_at(const struct named_motion *m, double t)
{
    const struct key *k = m->keys;
    int n = m->count, i = 0;
    if (t <= k[0].t)
        return k[0];
    if (t >= k[n - 1].t)
        return k[n - 1];
    while (k[i + 1].t < t)
        i++;
    const double *p0 = (const double *)&k[i > 0 ? i - 1 : 0], *p1 = (const double *)&k[i];
    const double *p2 = (const double *)&k[i + 1], *p3 = (const double *)&k[i + 2 < n ? i + 2 : n - 1];
    double dt = p2[0] - p1[0], u = (t - p1[0]) / dt, u2 = u * u, u3 = u2 * u;
    struct key out;
    double *o = (double *)&out;
    for (size_t c = 0; c < sizeof(struct key) / sizeof(double); c++) {
        // At the ends, and where the curve turns back, the slope is zero: nothing overshoots.
        double before = p1[c] - p0[c], here = p2[c] - p1[c], after = p3[c] - p2[c];
        double m1 = before * here > 0 ? (p2[c] - p0[c]) / (p2[0] - p0[0]) * dt : 0;
        double m2 = here * after > 0 ? (p3[c] - p1[c]) / (p3[0] - p1[0]) * dt : 0;
        m1 = copysign(least(fabs(m1), 3 * fabs(here)), m1);
        m2 = copysign(least(fabs(m2), 3 * fabs(here)), m2);
        o[c] = (2 * u3 - 3 * u2 + 1) * p1[c] + (u3 - 2 * u2 + u) * m1 + (3 * u2 - 2 * u3) * p2[c] + (u3 - u2) * m2;
    }
    o[0] = t;
    return out;
}

struct footing {
    struct vec3 at;    // of the sole's middle below the ankle: x, y, height z
    double yaw, pitch; // degrees
};

// Position of foot `side` while it is planted, around time t.
static struct footing planted(const struct named_motion *m, const struct physique *p, int side, double t)
{
    struct key k = key_at(m, t);
    double scale = p->figure.height_m / 1.75, apart = p->bind_joint[JOINT_LEFT_FOOT].x + k.apart * scale;
    double x = side == LEFT ? apart : -apart;
    struct vec3 o = quat_rotate(rotation_of(k.heading, 0, 0), v3(x, 0, 0));
    return (struct footing){v3(k.x + o.x, k.y + o.y, 0), k.heading + (side == LEFT ? 9 : -9), 0};
}

// Each foot in turn is planted for one stride (two steps) where the body will be in the middle of it; a foot whose
// target does not change stays on the floor.
static struct footing footing_at(const struct named_motion *m, const struct physique *p, int side, double t)
{
    double step = m->step_s, stride = 2 * step, swing = 0.42 * stride;
    double k = floor(t / stride - 0.5 * side);
    double down = (k + 0.5 * side) * stride;
    struct footing here = planted(m, p, side, down + step), next = planted(m, p, side, down + stride + step);
    double u = (t - (down + stride - swing)) / swing;
    if (u <= 0)
        return here;
    double go = u * u * (3 - 2 * u);
    double way = v3_distance(here.at, next.at) + fabs(here.yaw - next.yaw) * DEGREE * 0.3;
    double lift = least(1, way / 0.2) * 4 * u * (1 - u);
    struct footing f = {v3_mix(here.at, next.at, go), here.yaw + (next.yaw - here.yaw) * go, 0};
    f.at.z = 0.075 * lift;
    f.pitch = least(1, way / 0.3) * (u < 0.5 ? 34 : 14) * sin(u * 6.283185307179586) * (u < 0.5 ? 1 : 1);
    return f;
}

static void place_foot(const struct physique *p, const struct key *k, struct footing f, int side, struct stance *s)
{
    double scale = p->figure.height_m / 1.75;
    const struct vec3 *kick = side == LEFT ? &k->left_foot : &k->right_foot;
    double pitch = f.pitch + (side == LEFT ? k->left_toes : k->right_toes);
    struct quat heading = rotation_of(k->heading, 0, 0);
    struct vec3 ankle = v3(f.at.x, f.at.y, p->bind_joint[JOINT_LEFT_FOOT].z + f.at.z * scale);
    ankle = v3_add(ankle, quat_rotate(heading, v3_scale(*kick, scale)));
    s->foot[side] = rotation_of(f.yaw, pitch, 0);
    // The heel (positive pitch: raised) or the toes must not go through the floor.
    double toe = 0.115 * p->figure.height_m, heel = 0.035 * p->figure.height_m, sole = p->bind_joint[JOINT_LEFT_FOOT].z;
    double tip =
        least(quat_rotate(s->foot[side], v3(0, -toe, -sole)).z, quat_rotate(s->foot[side], v3(0, heel, -sole)).z);
    s->ankle[side] = v3(ankle.x, ankle.y, most(ankle.z, -tip));
    struct vec3 forward = quat_rotate(rotation_of(f.yaw + (side == LEFT ? 4 : -4), 0, 0), v3(0, -1, 0));
    s->knee[side] = v3_add(forward, v3(0, 0, 0.25)); // upwards too, for a leg stretched forward
}

static struct stance named_at(const struct named_motion *m, const struct physique *p, double t)
{
    struct key k = key_at(m, t);
    double scale = p->figure.height_m / 1.75;
    double breath = sin(t * 1.7), sway = sin(t * 0.9);
    struct stance s = {0};
    // The pelvis shifts over the supporting foot.
    struct footing feet[2] = {footing_at(m, p, LEFT, t), footing_at(m, p, RIGHT, t)};
    double carry = (feet[RIGHT].at.z - feet[LEFT].at.z) / 0.075; // 1: on the left foot
    struct vec3 shift = quat_rotate(rotation_of(k.heading, 0, 0), v3(0.022 * carry + 0.004 * sway, 0.003 * breath, 0));
    s.waist = v3_add(v3(k.x, k.y, p->bind_joint[JOINT_WAIST].z - (k.sink + 0.012) * scale), v3_scale(shift, scale));
    s.waist = v3_add(s.waist, quat_rotate(rotation_of(k.heading, 0, 0), v3_scale(k.hips, scale)));
    s.pelvis = rotation_of(k.heading + k.pelvis_yaw, k.pelvis_pitch, 2.2 * carry);
    s.chest = rotation_of(k.heading + k.chest_yaw, k.chest_pitch + 0.6 * breath, k.chest_roll - 1.5 * carry);
    s.head = rotation_of(k.heading + k.head_yaw, k.head_pitch, 0.4 * k.chest_roll);
    for (int side = LEFT; side <= RIGHT; side++) {
        const struct arm_key *arm = side == LEFT ? &k.left_arm : &k.right_arm;
        // Right-arm keys are written as if for the left, mirrored.
        double x = side == LEFT ? 1 : -1;
        s.upper_arm[side] = quat_rotate(s.chest, v3_unit(v3(x * arm->upper.x, arm->upper.y, arm->upper.z)));
        s.forearm[side] = quat_rotate(s.chest, v3_unit(v3(x * arm->fore.x, arm->fore.y, arm->fore.z)));
        place_foot(p, &k, feet[side], side, &s);
    }
    return s;
}

// "push-up", or of another seed than 1 "push-up:7".
static bool open_posture(struct figure_motion *m, const char *name)
{
    char kind[32];
    enum posture posture;
    const size_t length = strcspn(name, ":");
    if (length >= sizeof kind)
        return false;
    memcpy(kind, name, length);
    kind[length] = 0;
    if (!posture_named(kind, &posture))
        return false;
    const char *seed = name[length] ? name + length + 1 : "1";
    if (!*seed || strspn(seed, "0123456789") != strlen(seed))
        return false;
    m->posture = posture_motion_draw(posture, strtoull(seed, NULL, 10));
    return true;
}

enum status world_motion_open(struct figure_motion **out, const char *name, const struct physique *p, bool whole)
{
    *out = NULL;
    struct figure_motion *m = calloc(1, sizeof *m);
    if (!m)
        return fail(ERR_MEMORY, "out of memory for a motion");
    size_t length = strlen(name);
    enum status status = OK;
    if (strchr(name, '/') || (length > 4 && !strcmp(name + length - 4, ".bvh"))) {
        status = retarget_open(&m->file, name, p, whole);
    } else {
        for (size_t i = 0; i < named_motion_count; i++)
            if (!strcmp(name, named_motions[i].name))
                m->named = &named_motions[i];
        if (!m->named && !open_posture(m, name))
            status = fail(ERR_INPUT, "there is no motion '%s'; take %s or a .bvh file", name, world_motion_names());
    }
    if (status) {
        free(m);
        return status;
    }
    *out = m;
    return OK;
}

void world_motion_close(struct figure_motion **m)
{
    if (*m) {
        retarget_close(&(*m)->file);
        free(*m);
        *m = NULL;
    }
}

double motion_seconds(const struct figure_motion *m)
{
    if (m->file)
        return retarget_seconds(m->file);
    return m->named ? m->named->keys[m->named->count - 1].t : posture_motion_seconds();
}

struct stance world_motion_at(const struct figure_motion *m, const struct physique *p, double time_s)
{
    double t = least(most(time_s, 0), motion_seconds(m));
    if (m->file)
        return retarget_at(m->file, p, t);
    return m->named ? named_at(m->named, p, t) : posture_motion_at(&m->posture, p, t);
}
