#include "tests/world/shapes.h"

#include "tests/world/numbers.h"
#include "tests/world/texture.h"

#include <string.h>

const struct ellipsoid head_skull = {{0, 0.012f, 0.024f}, {0.077f, 0.098f, 0.104f}};
const struct ellipsoid head_hair = {{0, 0.025f, 0.036f}, {0.087f, 0.103f, 0.107f}};
const struct ellipsoid head_long_hair = {{0, 0.050f, -0.035f}, {0.094f, 0.072f, 0.130f}};

static struct vec3f vf(double x, double y, double z) { return (struct vec3f){(float)x, (float)y, (float)z}; }
static struct vec3f sub(struct vec3f a, struct vec3f b) { return (struct vec3f){a.x - b.x, a.y - b.y, a.z - b.z}; }
static float dot(struct vec3f a, struct vec3f b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
static struct vec3f f_of(struct vec3 v) { return vf(v.x, v.y, v.z); }

float ellipsoid_distance(struct ellipsoid e, struct vec3f p)
{
    struct vec3f q = sub(p, e.at);
    struct vec3f n = {q.x / e.radii.x, q.y / e.radii.y, q.z / e.radii.z};
    struct vec3f m = {n.x / e.radii.x, n.y / e.radii.y, n.z / e.radii.z};
    float k0 = sqrtf(dot(n, n)), k1 = sqrtf(dot(m, m));
    if (!(k1 > 1e-6f))
        return -minf(e.radii.x, minf(e.radii.y, e.radii.z));
    return k0 * (k0 - 1) / k1;
}

float shape_distance(const struct shape *s, struct vec3f p)
{
    if (s->kind == SHAPE_ELLIPSOID)
        return ellipsoid_distance((struct ellipsoid){s->a, s->b}, p);
    struct vec3f q = sub(p, s->a), axis = sub(s->b, s->a);
    q.y /= s->flat, axis.y /= s->flat;
    float length2 = dot(axis, axis), t = dot(q, axis) / length2;
    float shrink = minf(1, s->flat);
    if (s->kind == SHAPE_ROUND_CONE) {
        t = minf(1, maxf(0, t));
        struct vec3f d = {q.x - t * axis.x, q.y - t * axis.y, q.z - t * axis.z};
        return shrink * (sqrtf(dot(d, d)) - (s->ra + (s->rb - s->ra) * t));
    }
    struct vec3f d = {q.x - t * axis.x, q.y - t * axis.y, q.z - t * axis.z};
    float inside = minf(1, maxf(0, t));
    float out = sqrtf(dot(d, d)) - (s->ra + (s->rb - s->ra) * inside);
    float beyond = (fabsf(t - 0.5f) - 0.5f) * sqrtf(length2);
    if (out > 0 && beyond > 0)
        return shrink * sqrtf(out * out + beyond * beyond);
    return shrink * maxf(out, beyond);
}

// Quadratic smooth minimum (Quilez): blends over a width of k.
static float smooth_min(float a, float b, float k)
{
    float h = maxf(k - fabsf(a - b), 0) / k;
    return minf(a, b) - h * h * k * 0.25f;
}

static float plain_distance(const struct form *f, struct vec3f p, const struct shape_subset *n, bool *cloth)
{
    float d = 10, covered = 10;
    int count = n ? n->count : f->count;
    for (int i = 0; i < count; i++) {
        const struct shape *s = &f->shapes[n ? n->some[i] : i];
        float e = shape_distance(s, p);
        d = smooth_min(d, e, s->blend);
        if (s->cloth)
            covered = minf(covered, e);
    }
    *cloth = covered < d + 0.01f;
    return d;
}

float form_distance(const struct form *f, struct vec3f p, const struct shape_subset *n)
{
    bool cloth;
    return maxf(plain_distance(f, p, n, &cloth), -p.z); // soles are flat
}

float form_folded(const struct form *f, struct vec3f p, const struct shape_subset *n)
{
    bool cloth;
    float d = plain_distance(f, p, n, &cloth);
    if (cloth && !f->smooth) { // folds run mostly lengthwise
        float k = 1 / f->scale;
        d += 0.007f * f->scale * (noise3(p.x * 19 * k, p.y * 19 * k, p.z * 8 * k, 41) - 0.5f);
    }
    return maxf(d, -p.z);
}

struct vec3f form_normal(const struct form *f, struct vec3f p, const struct shape_subset *n)
{
    const float e = 0.003f;
    static const float k[4][3] = {{1, -1, -1}, {-1, -1, 1}, {-1, 1, -1}, {1, 1, 1}};
    struct vec3f sum = {0, 0, 0};
    for (int i = 0; i < 4; i++) {
        float d = form_folded(f, (struct vec3f){p.x + e * k[i][0], p.y + e * k[i][1], p.z + e * k[i][2]}, n);
        sum.x += k[i][0] * d, sum.y += k[i][1] * d, sum.z += k[i][2] * d;
    }
    float l = sqrtf(dot(sum, sum));
    return l > 1e-12f ? (struct vec3f){sum.x / l, sum.y / l, sum.z / l} : (struct vec3f){0, 0, 1};
}

void form_select_shapes(const struct form *f, struct vec3f p, float need, float reach, struct shape_subset *n)
{
    assert(reach >= need);
    struct vec3f moved = sub(p, n->middle);
    if (n->reach > 0 && sqrtf(dot(moved, moved)) + need <= n->reach)
        return;
    n->middle = p;
    n->reach = reach;
    float d[MAX_SHAPES], closest = 10;
    for (int i = 0; i < f->count; i++) {
        d[i] = shape_distance(&f->shapes[i], p);
        closest = minf(closest, d[i]);
    }
    n->count = 0;
    for (int i = 0; i < f->count; i++)
        if (d[i] < closest + 2.2f * reach + f->shapes[i].blend) // 2 for exact distances
            n->some[n->count++] = i;
}

// ---------------------------------------------------------------- the body, for 1.75 m

struct maker {
    struct form *form;
    const struct physique *p;
    float s, g, limb; // scale; girth of the trunk; of the limbs
    struct vec3f joint[JOINT_COUNT];
};

struct thickness { // for 1.75 m
    double ra, rb, blend;
};

static struct shape *add(struct maker *m, enum shape_kind kind, enum bone bone, struct vec3f a, struct vec3f b,
                         struct thickness t)
{
    assert(m->form->count < MAX_SHAPES);
    struct shape *s = &m->form->shapes[m->form->count++];
    *s = (struct shape){kind,  bone, a, b, (float)t.ra * m->s, (float)t.rb * m->s, 1, (float)t.blend * m->s,
                        false, false};
    return s;
}

// An ellipsoid beside a joint.
static struct shape *blob(struct maker *m, enum bone bone, struct vec3f at, struct vec3 offset, struct vec3 radii,
                          double blend)
{
    struct vec3f c = {at.x + (float)offset.x * m->s, at.y + (float)offset.y * m->s, at.z + (float)offset.z * m->s};
    const double k = (double)m->s;
    return add(m, SHAPE_ELLIPSOID, bone, c, vf(radii.x * k, radii.y * k, radii.z * k), (struct thickness){0, 0, blend});
}

static struct vec3f beside(const struct maker *m, struct vec3f at, double dx, double dy, double dz)
{
    return (struct vec3f){at.x + (float)dx * m->s, at.y + (float)dy * m->s, at.z + (float)dz * m->s};
}

static void add_trunk(struct maker *m)
{
    bool woman = m->p->figure.woman, coat = m->p->figure.clothes == CLOTHES_COAT;
    double g = (double)m->g * (coat ? 1.07 : 1), heavy = most(0, m->p->figure.build - 0.5);
    struct vec3f waist = m->joint[JOINT_WAIST], torso = m->joint[JOINT_TORSO];
    struct vec3f l = m->joint[JOINT_LEFT_SHOULDER], r = m->joint[JOINT_RIGHT_SHOULDER];
    double wide = l.x / m->s; // the chest is as wide as the shoulders are apart
    blob(m, BONE_CHEST, torso, v3(0, 0.004, 0.065), v3(0.90 * wide * (0.5 + 0.5 * g), 0.112 * g, 0.185), 0.01)->cloth =
        true;
    blob(m, BONE_BELLY, waist, v3(0, -0.002 - 0.05 * heavy, 0.115),
         v3((woman ? 0.122 : 0.142) * g, (0.100 + 0.10 * heavy) * g, 0.165), 0.10)
        ->cloth = true;
    blob(m, BONE_PELVIS, waist, v3(0, 0.006, -0.03), v3((woman ? 0.166 : 0.156) * g, 0.115 * g, 0.125), 0.09)->cloth =
        true;
    add(m, SHAPE_ROUND_CONE, BONE_CHEST, l, r,
        (struct thickness){0.052 * (0.5 + 0.5 * g), 0.052 * (0.5 + 0.5 * g), 0.06})
        ->cloth = true;
    struct vec3f neck = m->joint[JOINT_NECK];
    for (int side = -1; side <= 1; side += 2) {
        struct vec3f shoulder = side > 0 ? l : r;
        add(m, SHAPE_ROUND_CONE, BONE_CHEST, beside(m, neck, 0.022 * side, 0.010, 0.030),
            beside(m, shoulder, -0.025 * side, 0.004, 0.012), (struct thickness){0.043, 0.044, 0.045})
            ->cloth = false;
        if (woman)
            blob(m, BONE_CHEST, torso, v3(0.068 * side, -0.082 * g, 0.035), v3(0.062, 0.050 * g, 0.060), 0.05)->cloth =
                true;
        else
            blob(m, BONE_CHEST, torso, v3(0.070 * side, -0.070 * g, 0.095), v3(0.075, 0.035, 0.060), 0.06)->cloth =
                true;
        blob(m, BONE_PELVIS, waist, v3(0.070 * side, 0.062 * g, -0.072), v3(0.083 * g, 0.070 * g, 0.088), 0.05)->cloth =
            true;
    }
    if (coat) { // a collar
        struct shape *c = add(m, SHAPE_TUBE, BONE_CHEST, beside(m, neck, 0, 0.002, -0.01),
                              beside(m, neck, 0, 0.002, 0.045), (struct thickness){0.078, 0.066, 0.02});
        c->flat = 0.95f;
    }
}

static void add_head(struct maker *m)
{
    bool woman = m->p->figure.woman;
    struct vec3f neck = m->joint[JOINT_NECK], head = m->joint[JOINT_HEAD], skull = f_of(m->p->skull);
    // Heads vary less than heights: a child's is larger relative to its height.
    float k = m->s, big = 1 + 0.28f * maxf(0, 1 - m->s);
    m->s *= big;
    double thick = (woman ? 0.049 : 0.057) * (0.6 + 0.4 * (double)m->g);
    add(m, SHAPE_ROUND_CONE, BONE_NECK, beside(m, neck, 0, 0.006, -0.03), beside(m, skull, 0, 0.006, 0.01),
        (struct thickness){thick * 1.12, thick, 0.035});
    const struct ellipsoid *e = &head_skull;
    blob(m, BONE_HEAD, head, v3((double)e->at.x, (double)e->at.y, (double)e->at.z),
         v3((double)e->radii.x, (double)e->radii.y, (double)e->radii.z), 0.03);
    blob(m, BONE_HEAD, head, v3(0, -0.026, -0.046), v3(woman ? 0.051 : 0.056, 0.064, 0.058), 0.035);
    add(m, SHAPE_ROUND_CONE, BONE_HEAD, beside(m, head, 0, -0.082, 0.018), beside(m, head, 0, -0.100, -0.018),
        (struct thickness){0.007, 0.011, 0.014});
    for (int side = -1; side <= 1; side += 2)
        blob(m, BONE_HEAD, head, v3(0.077 * side, 0.012, -0.004), v3(0.010, 0.020, 0.030), 0.008);
    e = &head_hair;
    blob(m, BONE_HEAD, head, v3((double)e->at.x, (double)e->at.y, (double)e->at.z),
         v3((double)e->radii.x, (double)e->radii.y, (double)e->radii.z), 0.006);
    e = &head_long_hair;
    if (woman)
        blob(m, BONE_HEAD, head, v3((double)e->at.x, (double)e->at.y, (double)e->at.z),
             v3((double)e->radii.x, (double)e->radii.y, (double)e->radii.z), 0.012);
    m->s = k;
}

static void add_arm(struct maker *m, int side)
{
    double x = side == LEFT ? 1 : -1, t = (double)m->limb;
    int a = side == LEFT ? JOINT_LEFT_SHOULDER : JOINT_RIGHT_SHOULDER;
    enum bone upper = side == LEFT ? BONE_LEFT_UPPER_ARM : BONE_RIGHT_UPPER_ARM, fore = (enum bone)(upper + 1),
              hand = (enum bone)(upper + 2);
    struct vec3 d = v3(x * m->p->arm.x, m->p->arm.y, m->p->arm.z), across = v3(0, 1, 0),
                thick = v3_cross(d, v3(0, x, 0));
    struct vec3f shoulder = m->joint[a], elbow = m->joint[a + 1], wrist = f_of(m->p->wrist[side]);
    add(m, SHAPE_ROUND_CONE, upper, shoulder, elbow, (struct thickness){0.052 * t, 0.038 * t, 0.04});
    add(m, SHAPE_ROUND_CONE, fore, elbow, wrist, (struct thickness){0.039 * t, 0.027 * t, 0.02});
    struct vec3 s3 = m->p->bind_joint[a], e3 = m->p->bind_joint[a + 1], w3 = m->p->wrist[side];
    if (m->p->figure.clothes == CLOTHES_COAT) {
        add(m, SHAPE_TUBE, upper, shoulder, elbow, (struct thickness){0.066 * t, 0.055 * t, 0.04})->cloth = true;
        struct shape *s = add(m, SHAPE_TUBE, fore, f_of(v3_mix(s3, e3, 0.96)), f_of(v3_mix(e3, w3, 0.96)),
                              (struct thickness){0.055 * t, 0.044 * t, 0.02});
        s->cloth = true;
    } else {
        add(m, SHAPE_TUBE, upper, f_of(v3_mix(s3, e3, 0.04)), f_of(v3_mix(s3, e3, 0.66)),
            (struct thickness){0.061 * t, 0.056 * t, 0.035})
            ->cloth = true;
    }
    // The palm and fingers lie side by side along y, the thumb in front (-y).
    double k = (double)m->s, h = least(1.08, 0.55 + 0.45 * (double)m->limb) * k;
    for (int i = 0; i < 4; i++) {
        double off = (-0.028 + 0.0185 * i) * h, length = (0.078 - 0.008 * fabs(i - 1.3)) * h;
        struct vec3 knuckle = v3_add(v3_add(w3, v3_scale(d, 0.088 * h)), v3_scale(across, off));
        struct vec3 root = v3_add(v3_add(w3, v3_scale(d, 0.012 * h)), v3_scale(across, 0.55 * off));
        struct vec3 tip = v3_add(v3_add(knuckle, v3_scale(d, length)),
                                 v3_add(v3_scale(thick, -0.012 * h), v3_scale(across, 0.12 * off)));
        add(m, SHAPE_ROUND_CONE, hand, f_of(root), f_of(knuckle),
            (struct thickness){0.0165 * h / k, 0.0120 * h / k, 0.018});
        add(m, SHAPE_ROUND_CONE, hand, f_of(knuckle), f_of(tip),
            (struct thickness){0.0100 * h / k, 0.0078 * h / k, 0.004});
    }
    struct vec3 base = v3_add(v3_add(w3, v3_scale(d, 0.025 * h)), v3_scale(across, -0.016 * h));
    struct vec3 tip = v3_add(v3_add(w3, v3_scale(d, 0.092 * h)), v3_scale(across, -0.056 * h));
    add(m, SHAPE_ROUND_CONE, hand, f_of(base), f_of(tip), (struct thickness){0.0155 * h / k, 0.0095 * h / k, 0.012});
}

static void add_leg(struct maker *m, int side)
{
    double x = side == LEFT ? 1 : -1, t = (double)m->limb;
    int l = side == LEFT ? JOINT_LEFT_HIP : JOINT_RIGHT_HIP;
    enum bone thigh = side == LEFT ? BONE_LEFT_THIGH : BONE_RIGHT_THIGH, shin = (enum bone)(thigh + 1),
              foot = (enum bone)(thigh + 2);
    struct vec3f hip = m->joint[l], knee = m->joint[l + 1], ankle = m->joint[l + 2];
    struct vec3 k3 = m->p->bind_joint[l + 1], a3 = m->p->bind_joint[l + 2];
    bool bare = m->p->figure.clothes == CLOTHES_SKIRT;
    double wide = bare ? 0 : 0.008;                                      // of the trousers
    double top = least(0.084 * t, (double)(fabsf(hip.x) / m->s) * 0.96); // thighs must not merge into one
    add(m, SHAPE_ROUND_CONE, thigh, beside(m, hip, 0.006 * x, 0, -0.03), beside(m, knee, 0, -0.004, 0.01),
        (struct thickness){top + wide * 0.3, 0.054 * t + wide, 0.028})
        ->cloth = !bare;
    add(m, SHAPE_ROUND_CONE, shin, beside(m, knee, 0, -0.002, 0), beside(m, ankle, 0, 0, 0.03),
        (struct thickness){0.052 * t + wide, 0.036 * t + wide, 0.02})
        ->cloth = !bare;
    struct vec3f calf = f_of(v3_mix(k3, a3, 0.30));
    blob(m, shin, calf, v3(0, 0.014, 0), v3(0.047 * t + wide, 0.048 * t + wide, 0.105), 0.03)->cloth = !bare;
    if (!bare)
        add(m, SHAPE_TUBE, shin, f_of(v3_mix(k3, a3, 0.35)), beside(m, ankle, 0, 0.002, -0.012),
            (struct thickness){0.060 * t, 0.058 * t, 0.02})
            ->cloth = true;
    // Shoe: heel, ball, toes, and a collar round the ankle.
    double sole = ankle.z / m->s;
    add(m, SHAPE_ROUND_CONE, foot, beside(m, ankle, 0, 0.020, 0.012), beside(m, ankle, 0, 0.024, 0.034 - sole),
        (struct thickness){0.040, 0.040, 0.012});
    add(m, SHAPE_ROUND_CONE, foot, beside(m, ankle, 0, 0.014, 0.030 - sole),
        beside(m, ankle, 0.006 * x, -0.105, 0.022 - sole), (struct thickness){0.038, 0.043, 0.02});
    add(m, SHAPE_ROUND_CONE, foot, beside(m, ankle, 0.004 * x, -0.105, 0.018 - sole),
        beside(m, ankle, 0.002 * x, -0.150, 0.018 - sole), (struct thickness){0.040, 0.032, 0.02});
    add(m, SHAPE_ROUND_CONE, foot, beside(m, ankle, 0, -0.004, 0.0), beside(m, ankle, 0, -0.075, 0.045 - sole),
        (struct thickness){0.038, 0.030, 0.03});
}

static void add_tails(struct maker *m)
{
    enum world_clothes c = m->p->figure.clothes;
    struct vec3f waist = m->joint[JOINT_WAIST], knee = m->joint[JOINT_LEFT_KNEE];
    struct vec3f top = beside(m, waist, 0, 0.004, 0.02),
                 low = {0, waist.y + 0.01f * m->s, knee.z + (c == CLOTHES_SKIRT ? 0.08f : 0.02f) * m->s};
    double g = (double)m->g;
    struct shape *s = NULL;
    if (c == CLOTHES_SKIRT)
        s = add(m, SHAPE_TUBE, BONE_PELVIS, top, low, (struct thickness){0.130 * g, 0.262 * (0.4 + 0.6 * g), 0.03});
    if (c == CLOTHES_COAT)
        s = add(m, SHAPE_TUBE, BONE_PELVIS, top, low, (struct thickness){0.155 * g, 0.225 * (0.4 + 0.6 * g), 0.03});
    if (s) {
        s->flat = 0.80f;
        s->hangs = s->cloth = true;
    }
}

struct form form_of(const struct physique *p)
{
    struct form form = {.count = 0};
    struct maker m = {&form, p, (float)(p->figure.height_m / 1.75), (float)p->girth, 0, {{0, 0, 0}}};
    form.scale = m.s;
    m.limb = (0.55f + 0.45f * m.g) * (p->figure.woman ? 0.94f : 1.03f);
    for (int j = 0; j < JOINT_COUNT; j++)
        m.joint[j] = f_of(p->bind_joint[j]);
    add_trunk(&m);
    for (int side = LEFT; side <= RIGHT; side++) {
        add_arm(&m, side);
        add_leg(&m, side);
    }
    add_tails(&m);
    add_head(&m);
    return form;
}
