#include "tests/world/body.h"

#include "tests/world/numbers.h"

#include <string.h>

// Proportions after Winter, "Biomechanics and Motor Control of Human Movement" (segment lengths as fractions of
// stature); joints as motion capture defines them.
struct physique physique_of(const struct world_figure *figure)
{
    struct physique p = {.figure = *figure};
    double h = figure->height_m;
    // Children have larger heads and shorter legs for their height.
    double young = least(1, most(0, (1.55 - h) / 0.35));
    double legs = 1 - 0.05 * young;
    p.girth = 0.84 + 0.42 * figure->build + 0.05 * young;
    double hip_x = (figure->woman ? 0.054 : 0.051) * h;
    double shoulder_x = (figure->woman ? 0.098 : 0.108) * h * (0.96 + 0.08 * figure->build);
    double ankle_x = 0.050 * h;
    double spread = 0.80; // of the arms from the vertical, radians
    p.arm = v3(sin(spread), 0, -cos(spread));
    p.upper_arm_m = 0.168 * h;
    p.forearm_m = 0.146 * h;
    p.bind_joint[JOINT_WAIST] = v3(0, 0.002 * h, 0.565 * legs * h);
    p.bind_joint[JOINT_TORSO] = v3(0, 0.002 * h, (0.565 * legs + 0.825) * h / 2);
    p.bind_joint[JOINT_NECK] = v3(0, 0.008 * h, (0.825 - 0.01 * young) * h);
    p.bind_joint[JOINT_HEAD] = v3(0, -0.004 * h, (0.928 - 0.012 * young) * h);
    p.skull = v3(0, 0.004 * h, (0.872 - 0.016 * young) * h);
    for (int side = LEFT; side <= RIGHT; side++) {
        double x = side == LEFT ? 1 : -1;
        struct vec3 arm = v3(x * p.arm.x, p.arm.y, p.arm.z);
        int a = side == LEFT ? JOINT_LEFT_SHOULDER : JOINT_RIGHT_SHOULDER;
        int l = side == LEFT ? JOINT_LEFT_HIP : JOINT_RIGHT_HIP;
        p.bind_joint[a] = v3(x * shoulder_x, 0.006 * h, (0.803 - 0.01 * young) * h);
        p.bind_joint[a + 1] = v3_add(p.bind_joint[a], v3_scale(arm, p.upper_arm_m));
        p.wrist[side] = v3_add(p.bind_joint[a + 1], v3_scale(arm, p.forearm_m));
        p.bind_joint[a + 2] = v3_add(p.wrist[side], v3_scale(arm, 0.022 * h));
        p.bind_joint[l] = v3(x * hip_x, 0.002 * h, 0.52 * legs * h);
        p.bind_joint[l + 1] = v3(x * (hip_x + ankle_x) / 2, 0, 0.284 * legs * h);
        p.bind_joint[l + 2] = v3(x * ankle_x, 0.008 * h, 0.056 * h);
    }
    p.thigh_m = v3_distance(p.bind_joint[JOINT_LEFT_HIP], p.bind_joint[JOINT_LEFT_KNEE]);
    p.shin_m = v3_distance(p.bind_joint[JOINT_LEFT_KNEE], p.bind_joint[JOINT_LEFT_FOOT]);
    return p;
}

#define SPINE_RATE 0.028 // of body height behind the trunk's middle; chosen by hand

// The motion that rotates about `pivot` of the bind frame and moves it to `to`.
static struct pose rotation_about(struct quat rotation, struct vec3 pivot, struct vec3 to)
{
    return (struct pose){rotation, v3_sub(to, quat_rotate(rotation, pivot))};
}

// The rotation whose first column is `along` and whose third is as close to `side` as possible.
static struct quat frame_of(struct vec3 along, struct vec3 side)
{
    struct vec3 x = v3_unit(along);
    struct vec3 y = v3_unit(v3_cross(side, x));
    if (!(v3_dot(y, y) > 0.5))
        y = v3_perpendicular(x);
    struct vec3 z = v3_cross(x, y);
    double m[3][3] = {{x.x, y.x, z.x}, {x.y, y.y, z.y}, {x.z, y.z, z.z}};
    return quat_from_matrix(m);
}

static struct quat rotation_between(struct vec3 along0, struct vec3 side0, struct vec3 along, struct vec3 side)
{
    return quat_multiply(frame_of(along, side), quat_conjugate(frame_of(along0, side0)));
}

static double ramp(double from, double to, double x)
{
    double t = least(1, most(0, (x - from) / (to - from)));
    return t * t * (3 - 2 * t);
}

static void pose_arm(const struct physique *p, const struct stance *s, int side, struct posed *out)
{
    int a = side == LEFT ? JOINT_LEFT_SHOULDER : JOINT_RIGHT_SHOULDER;
    int bone = side == LEFT ? BONE_LEFT_UPPER_ARM : BONE_RIGHT_UPPER_ARM;
    double h = p->figure.height_m, x = side == LEFT ? 1 : -1;
    struct vec3 bind_arm = v3(x * p->arm.x, p->arm.y, p->arm.z);
    struct vec3 upper = v3_unit(s->upper_arm[side]), fore = v3_unit(s->forearm[side]);

    // The shoulder blade follows a raised arm: the joint rises and moves inwards.
    struct vec3 up = quat_rotate(s->chest, v3(0, 0, 1)), out_dir = quat_rotate(s->chest, v3(x, 0, 0));
    double lift = ramp(-0.2, 1, v3_dot(upper, up));
    double reach = ramp(0.2, 1, -v3_dot(upper, quat_rotate(s->chest, v3(0, 1, 0))));
    struct vec3 shoulder = pose_apply(out->world_from_bind[BONE_CHEST], p->bind_joint[a]);
    shoulder = v3_add(shoulder, v3_scale(up, 0.022 * h * lift));
    shoulder = v3_add(shoulder, v3_scale(out_dir, -0.012 * h * lift));
    shoulder = v3_add(shoulder, v3_scale(quat_rotate(s->chest, v3(0, -1, 0)), 0.012 * h * reach));

    // The elbow's hinge axis: normal to both directions where the arm is bent; where it is straight, the hanging arm's
    // axis under the shortest rotation.
    struct vec3 hinge0 = v3_unit(v3_cross(bind_arm, v3(0, -1, 0)));
    struct vec3 bind_world = quat_rotate(s->chest, bind_arm);
    struct vec3 easy = quat_rotate(quat_between(bind_world, upper), quat_rotate(s->chest, hinge0));
    struct vec3 bent = v3_cross(upper, fore);
    double sure = ramp(0.05, 0.4, v3_length(bent));
    struct vec3 hinge = v3_unit(v3_mix(easy, v3_unit(bent), sure));
    struct quat rotation = rotation_between(bind_arm, hinge0, upper, hinge);
    struct quat forearm_rotation = rotation_between(bind_arm, hinge0, fore, hinge);

    struct vec3 elbow = v3_add(shoulder, v3_scale(upper, p->upper_arm_m));
    struct vec3 wrist = v3_add(elbow, v3_scale(fore, p->forearm_m));
    out->world_from_bind[bone] = rotation_about(rotation, p->bind_joint[a], shoulder);
    out->world_from_bind[bone + 1] = rotation_about(forearm_rotation, p->bind_joint[a + 1], elbow);
    out->world_from_bind[bone + 2] = rotation_about(forearm_rotation, p->wrist[side], wrist);
    out->joints.joint[a] = shoulder;
    out->joints.joint[a + 1] = elbow;
    out->joints.joint[a + 2] = pose_apply(out->world_from_bind[bone + 2], p->bind_joint[a + 2]);
}

// Two-bone IK from the hip to the given ankle, the knee pointing to `s->knee`.
static void pose_leg(const struct physique *p, const struct stance *s, int side, struct posed *out)
{
    int l = side == LEFT ? JOINT_LEFT_HIP : JOINT_RIGHT_HIP;
    int bone = side == LEFT ? BONE_LEFT_THIGH : BONE_RIGHT_THIGH;
    struct vec3 hip = pose_apply(out->world_from_bind[BONE_PELVIS], p->bind_joint[l]);
    struct vec3 to = v3_sub(s->ankle[side], hip);
    double a = p->thigh_m, b = p->shin_m;
    double d = least(most(v3_length(to), fabs(a - b) + 0.02), (a + b) * 0.9995);
    struct vec3 straight = v3_unit(to);
    struct vec3 forward = v3_sub(s->knee[side], v3_scale(straight, v3_dot(s->knee[side], straight)));
    forward = v3_dot(forward, forward) > 1e-6 ? v3_unit(forward) : v3_perpendicular(straight);
    double along = (a * a - b * b + d * d) / (2 * d); // of the knee, law of cosines
    double off = sqrt(most(0, a * a - along * along));
    struct vec3 knee = v3_add(hip, v3_add(v3_scale(straight, along), v3_scale(forward, off)));
    struct vec3 ankle = v3_add(hip, v3_scale(straight, d));

    struct vec3 side_dir = v3_cross(straight, forward);
    struct vec3 bind_thigh = v3_sub(p->bind_joint[l + 1], p->bind_joint[l]),
                bind_shin = v3_sub(p->bind_joint[l + 2], p->bind_joint[l + 1]);
    struct vec3 side0 = v3(-1, 0, 0); // down x forward in the bind pose
    out->world_from_bind[bone] =
        rotation_about(rotation_between(bind_thigh, side0, v3_sub(knee, hip), side_dir), p->bind_joint[l], hip);
    out->world_from_bind[bone + 1] =
        rotation_about(rotation_between(bind_shin, side0, v3_sub(ankle, knee), side_dir), p->bind_joint[l + 1], knee);
    out->world_from_bind[bone + 2] = rotation_about(s->foot[side], p->bind_joint[l + 2], ankle);
    out->joints.joint[l] = hip;
    out->joints.joint[l + 1] = knee;
    out->joints.joint[l + 2] = ankle;
}

// How far the waist must move down for both legs to reach their ankles.
static double sink(const struct physique *p, const struct stance *s)
{
    double need = 0;
    for (int side = LEFT; side <= RIGHT; side++) {
        int l = side == LEFT ? JOINT_LEFT_HIP : JOINT_RIGHT_HIP;
        struct vec3 hip =
            v3_add(s->waist, quat_rotate(s->pelvis, v3_sub(p->bind_joint[l], p->bind_joint[JOINT_WAIST])));
        struct vec3 d = v3_sub(hip, s->ankle[side]);
        double reach = 0.997 * (p->thigh_m + p->shin_m);
        double flat = d.x * d.x + d.y * d.y;
        if (flat < reach * reach)
            need = most(need, d.z - sqrt(reach * reach - flat));
    }
    return need;
}

void physique_pose(const struct physique *p, const struct stance *stance, struct posed *out)
{
    struct stance s = *stance;
    s.waist.z -= sink(p, &s);
    memset(out, 0, sizeof *out);
    struct pose *bone = out->world_from_bind;
    struct quat belly = quat_slerp(s.pelvis, s.chest, 0.5), neck = quat_slerp(s.chest, s.head, 0.5);
    bone[BONE_PELVIS] = rotation_about(s.pelvis, p->bind_joint[JOINT_WAIST], s.waist);
    bone[BONE_BELLY] = rotation_about(belly, p->bind_joint[JOINT_WAIST], s.waist);
    struct vec3 torso = pose_apply(bone[BONE_BELLY], p->bind_joint[JOINT_TORSO]);
    bone[BONE_CHEST] = rotation_about(s.chest, p->bind_joint[JOINT_TORSO], torso);
    struct vec3 throat = pose_apply(bone[BONE_CHEST], p->bind_joint[JOINT_NECK]);
    bone[BONE_NECK] = rotation_about(neck, p->bind_joint[JOINT_NECK], throat);
    bone[BONE_HEAD] = rotation_about(s.head, p->skull, pose_apply(bone[BONE_NECK], p->skull));
    // Reported as motion capture does: in the spine, well behind the trunk's middle, and the head above it.
    struct vec3 back = v3(0, SPINE_RATE * p->figure.height_m, 0);
    out->joints.joint[JOINT_WAIST] = pose_apply(bone[BONE_BELLY], v3_add(p->bind_joint[JOINT_WAIST], back));
    out->joints.joint[JOINT_TORSO] = pose_apply(bone[BONE_BELLY], v3_add(p->bind_joint[JOINT_TORSO], back));
    out->joints.joint[JOINT_NECK] = throat;
    out->joints.joint[JOINT_HEAD] = pose_apply(bone[BONE_HEAD], v3_add(p->bind_joint[JOINT_HEAD], back));
    for (int side = LEFT; side <= RIGHT; side++) {
        pose_arm(p, &s, side, out);
        pose_leg(p, &s, side, out);
    }
    for (int j = 0; j < JOINT_COUNT; j++)
        out->joints.confidence[j] = 1;
}
