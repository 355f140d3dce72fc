#include "tests/world/figure.h"

#include "tests/world/numbers.h"

#include <stdlib.h>
#include <string.h>

// Bones that share skin with each bone.
static const int8_t neighbours[BONE_COUNT][5] = {
    [BONE_PELVIS] = {BONE_BELLY, BONE_LEFT_THIGH, BONE_RIGHT_THIGH, -1},
    [BONE_BELLY] = {BONE_PELVIS, BONE_CHEST, -1},
    [BONE_CHEST] = {BONE_BELLY, BONE_NECK, BONE_LEFT_UPPER_ARM, BONE_RIGHT_UPPER_ARM, -1},
    [BONE_NECK] = {BONE_CHEST, BONE_HEAD, -1},
    [BONE_HEAD] = {BONE_NECK, -1},
    [BONE_LEFT_UPPER_ARM] = {BONE_CHEST, BONE_LEFT_FOREARM, -1},
    [BONE_LEFT_FOREARM] = {BONE_LEFT_UPPER_ARM, BONE_LEFT_HAND, -1},
    [BONE_LEFT_HAND] = {BONE_LEFT_FOREARM, -1},
    [BONE_RIGHT_UPPER_ARM] = {BONE_CHEST, BONE_RIGHT_FOREARM, -1},
    [BONE_RIGHT_FOREARM] = {BONE_RIGHT_UPPER_ARM, BONE_RIGHT_HAND, -1},
    [BONE_RIGHT_HAND] = {BONE_RIGHT_FOREARM, -1},
    [BONE_LEFT_THIGH] = {BONE_PELVIS, BONE_LEFT_SHIN, -1},
    [BONE_LEFT_SHIN] = {BONE_LEFT_THIGH, BONE_LEFT_FOOT, -1},
    [BONE_LEFT_FOOT] = {BONE_LEFT_SHIN, -1},
    [BONE_RIGHT_THIGH] = {BONE_PELVIS, BONE_RIGHT_SHIN, -1},
    [BONE_RIGHT_SHIN] = {BONE_RIGHT_THIGH, BONE_RIGHT_FOOT, -1},
    [BONE_RIGHT_FOOT] = {BONE_RIGHT_SHIN, -1},
};

static float ramp(float from, float to, float x)
{
    float t = minf(1, maxf(0, (x - from) / (to - from)));
    return t * t * (3 - 2 * t);
}

static void keep_best(const float weight[BONE_COUNT], struct binding *b)
{
    bool used[BONE_COUNT] = {false};
    float sum = 0;
    for (int i = 0; i < BONES_A_VERTEX; i++) {
        int best = -1;
        for (int k = 0; k < BONE_COUNT; k++)
            if (!used[k] && (best < 0 || weight[k] > weight[best]))
                best = k;
        used[best] = true;
        b->bone[i] = (uint8_t)best;
        b->weight[i] = weight[best];
        sum += weight[best];
    }
    for (int i = 0; i < BONES_A_VERTEX; i++)
        b->weight[i] /= sum;
}

// A vertex follows the bones whose shapes are nearest; weights fall off over two centimetres.
static void bind(const struct form *form, const struct physique *p, struct vec3f at, struct binding *b)
{
    float distance[BONE_COUNT], hanging = 10, closest = 10;
    int nearest = 0;
    for (int k = 0; k < BONE_COUNT; k++)
        distance[k] = 10;
    for (int i = 0; i < form->count; i++) {
        const struct shape *s = &form->shapes[i];
        float d = shape_distance(s, at);
        if (s->hangs)
            hanging = minf(hanging, d);
        else
            distance[s->bone] = minf(distance[s->bone], d);
    }
    for (int k = 0; k < BONE_COUNT; k++)
        if (distance[k] < closest)
            closest = distance[k], nearest = k;
    float weight[BONE_COUNT] = {0};
    if (hanging < closest) { // a skirt: from the hips down increasingly with the thigh of its side
        float hip = (float)p->bind_joint[JOINT_LEFT_HIP].z, knee = (float)p->bind_joint[JOINT_LEFT_KNEE].z;
        float leg = 0.85f * ramp(hip + 0.02f, knee, at.z), left = ramp(-0.10f * form->scale, 0.10f * form->scale, at.x);
        weight[BONE_PELVIS] = 1 - leg;
        weight[BONE_LEFT_THIGH] = leg * left;
        weight[BONE_RIGHT_THIGH] = leg * (1 - left);
    } else {
        weight[nearest] = 1;
        for (int i = 0; neighbours[nearest][i] >= 0 && i < 5; i++) {
            int k = neighbours[nearest][i];
            weight[k] = expf(-(distance[k] - closest) / (0.020f * form->scale));
        }
    }
    keep_best(weight, b);
}

// Ambient visibility: how much of the light from all directions passes the body itself.
static float openness(const struct form *form, struct vec3f at, struct vec3f n, struct shape_subset *subset)
{
    static const float steps[2] = {0.035f, 0.11f};
    float lost = 0;
    form_select_shapes(form, at, 0.12f * form->scale, 0.16f * form->scale, subset);
    for (int i = 0; i < 2; i++) {
        float r = steps[i] * form->scale;
        struct vec3f q = {at.x + r * n.x, at.y + r * n.y, at.z + r * n.z};
        float d = form_distance(form, q, subset);
        lost += 0.40f * maxf(0, (r - d) / r);
    }
    return maxf(0.15f, 1 - lost);
}

// Distance from a joint to the surface along -y and y; the longer of the two.
static double radius_at(const struct form *form, struct vec3 joint)
{
    double longest = 0;
    for (int way = -1; way <= 1; way += 2) {
        struct vec3f q = {(float)joint.x, (float)joint.y, (float)joint.z};
        double gone = 0;
        for (int i = 0; i < 64; i++) {
            float d = -form_distance(form, q, NULL);
            if (d < 0.0005f)
                break;
            q.y += (float)way * d;
            gone += (double)d;
        }
        longest = most(longest, gone);
    }
    return longest;
}

enum status figure_build(struct figure *f, const struct physique *p, bool plain)
{
    memset(f, 0, sizeof *f);
    f->physique = *p;
    struct form form = form_of(p);
    form.smooth = plain;
    enum status status = mesh_of(&f->mesh, &form, (plain ? 0.011f : 0.008f) * form.scale);
    if (status)
        return status;
    f->bindings = malloc((size_t)f->mesh.vertex_count * sizeof *f->bindings);
    if (!f->bindings) {
        figure_free(f);
        return fail(ERR_MEMORY, "out of memory for the figure's skin");
    }
    struct shape_subset subset = {.reach = 0};
    for (int i = 0; i < f->mesh.vertex_count; i++) {
        bind(&form, p, f->mesh.at[i], &f->bindings[i]);
        f->bindings[i].open = openness(&form, f->mesh.at[i], f->mesh.normal[i], &subset);
    }
    for (int j = 0; j < JOINT_COUNT; j++)
        f->joint_radius[j] = radius_at(&form, p->bind_joint[j]);
    return OK;
}

void figure_free(struct figure *f)
{
    mesh_free(&f->mesh);
    free(f->bindings);
    memset(f, 0, sizeof *f);
}

// A rigid motion as a dual quaternion: real part r, dual part d. Blending these instead of matrices keeps elbows and
// twisted sleeves from collapsing (Kavan 2008).
struct dual {
    struct quat r, d;
};

static struct dual dual_of(struct pose p)
{
    struct quat t = {p.translation.x / 2, p.translation.y / 2, p.translation.z / 2, 0};
    return (struct dual){p.rotation, quat_multiply(t, p.rotation)};
}

static void add_scaled(struct quat *sum, struct quat q, double s)
{
    sum->x += s * q.x, sum->y += s * q.y, sum->z += s * q.z, sum->w += s * q.w;
}

void figure_pose(const struct figure *f, const struct posed *posed, int first, int count, struct vec3 *at,
                 struct vec3f *normal)
{
    struct dual bone[BONE_COUNT];
    for (int k = 0; k < BONE_COUNT; k++)
        bone[k] = dual_of(posed->world_from_bind[k]);
    for (int i = first; i < first + count; i++) {
        const struct binding *b = &f->bindings[i];
        struct dual sum = {{0, 0, 0, 0}, {0, 0, 0, 0}};
        const struct quat lead = bone[b->bone[0]].r;
        for (int k = 0; k < BONES_A_VERTEX; k++) {
            const struct dual *q = &bone[b->bone[k]];
            double same = lead.x * q->r.x + lead.y * q->r.y + lead.z * q->r.z + lead.w * q->r.w;
            double w = same < 0 ? -(double)b->weight[k] : (double)b->weight[k];
            add_scaled(&sum.r, q->r, w);
            add_scaled(&sum.d, q->d, w);
        }
        double n = sqrt(sum.r.x * sum.r.x + sum.r.y * sum.r.y + sum.r.z * sum.r.z + sum.r.w * sum.r.w);
        struct quat r = {sum.r.x / n, sum.r.y / n, sum.r.z / n, sum.r.w / n};
        struct quat d = {sum.d.x / n, sum.d.y / n, sum.d.z / n, sum.d.w / n};
        struct quat t = quat_multiply(d, quat_conjugate(r)); // half the translation
        struct vec3f p = f->mesh.at[i], m = f->mesh.normal[i];
        at[i] = v3_add(quat_rotate(r, v3((double)p.x, (double)p.y, (double)p.z)), v3(2 * t.x, 2 * t.y, 2 * t.z));
        struct vec3 turned = quat_rotate(r, v3((double)m.x, (double)m.y, (double)m.z));
        normal[i] = (struct vec3f){(float)turned.x, (float)turned.y, (float)turned.z};
    }
}
