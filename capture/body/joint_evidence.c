#include "capture/body/joint_evidence.h"

#include "capture/body/normal_equations.h"
#include "capture/body/two_bone_ik.h"

#include <math.h>
#include <stdlib.h>

// A network that errs errs in neighbouring joints, and frame after frame: an image's joints count as so many
// independent ones, as the points of the colour image do (point_evidence.h).
#define JOINTS_INDEPENDENT 5.0
enum { BONES_MIN = 3 };    // that tell a height
#define KERNEL         3.0 // standard deviations: the kernel's c
#define UPRIGHT_COSINE 0.8 // of the chest, below which a limb that was not found does not hang

// The segment that a joint is rigidly on.
static const enum segment segment_of[JOINT_COUNT] = {
    [JOINT_HEAD] = SEG_HEAD,
    [JOINT_NECK] = SEG_CHEST,
    [JOINT_LEFT_SHOULDER] = SEG_LEFT_CLAVICLE,
    [JOINT_LEFT_ELBOW] = SEG_LEFT_UPPER_ARM,
    [JOINT_LEFT_HAND] = SEG_LEFT_FOREARM,
    [JOINT_RIGHT_SHOULDER] = SEG_RIGHT_CLAVICLE,
    [JOINT_RIGHT_ELBOW] = SEG_RIGHT_UPPER_ARM,
    [JOINT_RIGHT_HAND] = SEG_RIGHT_FOREARM,
    [JOINT_TORSO] = SEG_CHEST,
    [JOINT_WAIST] = SEG_PELVIS,
    [JOINT_LEFT_HIP] = SEG_PELVIS,
    [JOINT_LEFT_KNEE] = SEG_LEFT_THIGH,
    [JOINT_LEFT_FOOT] = SEG_LEFT_SHIN,
    [JOINT_RIGHT_HIP] = SEG_PELVIS,
    [JOINT_RIGHT_KNEE] = SEG_RIGHT_THIGH,
    [JOINT_RIGHT_FOOT] = SEG_RIGHT_SHIN,
};

void joint_evidence_read(struct joint_evidence *out, const struct found_body *found)
{
    out->left = found->left;
    for (int j = 0; j < JOINT_COUNT; j++) {
        out->joint[j] = found->joint[j];
        out->sigma_m[j] = found->sigma_m[j];
    }
}

// ---------------------------------------------------------------- energy

static double joint_energy(const struct joint_evidence *evidence, const struct body_build *build, enum joint joint,
                           struct normal_equations *system)
{
    const double c2 = KERNEL * KERNEL, share = JOINTS_INDEPENDENT / JOINT_COUNT,
                 information = 1 / (evidence->sigma_m[joint] * evidence->sigma_m[joint]);
    const struct vec3 off = v3_sub(evidence->joint[joint], build->joint[joint]);
    const double e2 = v3_dot(off, off) * information, fade = c2 / (c2 + e2), way[3] = {off.x, off.y, off.z};
    for (int k = 0; system && k < 3; k++)
        normal_equations_add(system, build,
                             &(struct point_residual){.segment = segment_of[joint],
                                                      .point = build->joint[joint],
                                                      .normal = v3(k == 0, k == 1, k == 2),
                                                      .residual = way[k],
                                                      .weight = share * fade * fade * information});
    return 0.5 * share * e2 * fade;
}

double joint_evidence_energy(const struct joint_evidence *evidence, const struct body_build *build,
                             struct normal_equations *system)
{
    double energy = 0;
    for (int j = 0; evidence && j < JOINT_COUNT; j++)
        energy += joint_energy(evidence, build, (enum joint)j, system);
    return energy;
}

struct joint_evidence joint_evidence_mirrored(const struct joint_evidence *evidence)
{
    struct joint_evidence out = *evidence;
    out.left = v3_scale(evidence->left, -1);
    for (int k = 0; k < LIMB_COUNT; k++) {
        const struct body_limb *to = &body_limbs[k], *from = &body_limbs[k ^ 1];
        const enum joint tos[3] = {to->root, to->bend, to->tip}, froms[3] = {from->root, from->bend, from->tip};
        for (int i = 0; i < 3; i++) {
            out.joint[tos[i]] = evidence->joint[froms[i]];
            out.sigma_m[tos[i]] = evidence->sigma_m[froms[i]];
        }
    }
    return out;
}

// ---------------------------------------------------------------- pose

// Axes of the trunk: x to the left, y along the spine, as far as the two can be told.
static struct quat trunk_axes(struct vec3 left, struct vec3 spine)
{
    const struct vec3 y = v3_unit(spine), across = v3_sub(left, v3_scale(y, v3_dot(left, y))),
                      x = v3_length(across) > 1e-6 ? v3_unit(across) : v3_perpendicular(y), z = v3_cross(x, y);
    double m[3][3] = {{x.x, y.x, z.x}, {x.y, y.y, z.y}, {x.z, y.z, z.z}};
    return quat_from_matrix(m);
}

struct trunk {
    struct quat pelvis, chest;
};

// Where the spine's middle parts the trunk in two.
static struct trunk trunk_of(const struct vec3 joint[JOINT_COUNT])
{
    const struct vec3 shoulders = v3_mix(joint[JOINT_LEFT_SHOULDER], joint[JOINT_RIGHT_SHOULDER], 0.5),
                      hips = v3_mix(joint[JOINT_LEFT_HIP], joint[JOINT_RIGHT_HIP], 0.5), torso = joint[JOINT_TORSO],
                      shoulders_left = v3_sub(joint[JOINT_LEFT_SHOULDER], joint[JOINT_RIGHT_SHOULDER]),
                      hips_left = v3_sub(joint[JOINT_LEFT_HIP], joint[JOINT_RIGHT_HIP]);
    const struct vec3 both = v3_add(shoulders_left, hips_left);
    return (struct trunk){trunk_axes(v3_add(hips_left, both), v3_sub(torso, hips)),
                          trunk_axes(v3_add(shoulders_left, both), v3_sub(shoulders, torso))};
}

static struct quat rotation_from_to(struct quat from, struct quat to)
{
    return quat_unit(quat_multiply(to, quat_conjugate(from)));
}

static bool is_found(const struct joint_evidence *evidence, enum joint joint)
{
    return evidence->sigma_m[joint] < (double)INFINITY;
}

static const enum joint trunk_joints[] = {JOINT_NECK,  JOINT_LEFT_SHOULDER, JOINT_RIGHT_SHOULDER, JOINT_TORSO,
                                          JOINT_WAIST, JOINT_LEFT_HIP,      JOINT_RIGHT_HIP};
enum { TRUNK_JOINTS = COUNT_OF(trunk_joints) };

// From the found one of a pair, or middle, of `low` to that of `high`; false: there is none of either.
static bool found_way(const struct joint_evidence *evidence, const enum joint low[3], const enum joint high[3],
                      struct vec3 *out)
{
    struct vec3 end[2];
    for (int which = 0; which < 2; which++) {
        const enum joint *of = which ? high : low;
        int count = 0;
        end[which] = v3(0, 0, 0);
        for (int i = 0; i < 3; i++)
            if (is_found(evidence, of[i])) {
                end[which] = v3_add(end[which], evidence->joint[of[i]]);
                count++;
            }
        if (!count)
            return false;
        end[which] = v3_scale(end[which], 1.0 / count);
    }
    *out = v3_sub(end[1], end[0]);
    return true;
}

// A straight trunk's axes, as far as its joints were found: else upright, and turned as `left` is.
static struct quat found_trunk_axes(const struct joint_evidence *evidence, struct vec3 up)
{
    static const enum joint hips[3] = {JOINT_LEFT_HIP, JOINT_RIGHT_HIP, JOINT_WAIST},
                            shoulders[3] = {JOINT_LEFT_SHOULDER, JOINT_RIGHT_SHOULDER, JOINT_NECK};
    struct vec3 spine, left = evidence->left;
    if (!found_way(evidence, hips, shoulders, &spine))
        spine = up;
    for (int k = 0; k < LIMB_COUNT; k += 2) {
        const enum joint of_left = body_limbs[k].root, of_right = body_limbs[k + 1].root;
        if (is_found(evidence, of_left) && is_found(evidence, of_right))
            left = v3_add(left, v3_scale(v3_sub(evidence->joint[of_left], evidence->joint[of_right]), 10));
    }
    return trunk_axes(left, spine);
}

struct joint_evidence joint_evidence_complete(const struct joint_evidence *evidence, const struct body_shape *shape,
                                              struct vec3 up)
{
    struct joint_evidence out = *evidence;
    struct body_pose straight = {.root = v3(0, 0, 0)};
    struct body_build build;
    struct vec3 at = v3(0, 0, 0);
    int count = 0;
    for (int s = 0; s < SEG_COUNT; s++)
        straight.rotation[s] = (struct quat){0, 0, 0, 1};
    straight.rotation[SEG_PELVIS] = found_trunk_axes(evidence, up);
    body_forward_kinematics(shape, &straight, &build);
    for (int i = 0; i < TRUNK_JOINTS; i++)
        if (is_found(evidence, trunk_joints[i])) {
            at = v3_add(at, v3_sub(evidence->joint[trunk_joints[i]], build.joint[trunk_joints[i]]));
            count++;
        }
    for (int i = 0; i < TRUNK_JOINTS && count; i++)
        if (!is_found(evidence, trunk_joints[i]))
            out.joint[trunk_joints[i]] = v3_add(build.joint[trunk_joints[i]], v3_scale(at, 1.0 / count));
    return out;
}

// Bent in abdomen and chest alike, with shoulders and hips in the mean where they were found.
static struct body_pose trunk_pose(const struct joint_evidence *evidence, const struct body_shape *shape)
{
    static const enum joint corner[4] = {JOINT_LEFT_SHOULDER, JOINT_RIGHT_SHOULDER, JOINT_LEFT_HIP, JOINT_RIGHT_HIP};
    static const struct quat none = {0, 0, 0, 1};
    struct body_pose pose = {.root = v3(0, 0, 0)};
    struct body_build build;
    for (int s = 0; s < SEG_COUNT; s++)
        pose.rotation[s] = none;
    body_forward_kinematics(shape, &pose, &build);
    const struct trunk straight = trunk_of(build.joint), found = trunk_of(evidence->joint);
    const struct quat pelvis = rotation_from_to(straight.pelvis, found.pelvis),
                      chest = rotation_from_to(straight.chest, found.chest);
    pose.rotation[SEG_PELVIS] = pelvis;
    pose.rotation[SEG_ABDOMEN] = pose.rotation[SEG_CHEST] =
        quat_slerp(none, quat_multiply(quat_conjugate(pelvis), chest), 0.5);
    body_forward_kinematics(shape, &pose, &build);
    for (int i = 0; i < 4; i++)
        pose.root = v3_add(pose.root, v3_scale(v3_sub(evidence->joint[corner[i]], build.joint[corner[i]]), 0.25));
    return pose;
}

// To be called where the trunk is placed. One that was not found hangs down of an upright trunk, and goes on as another
// one lies.
static void place_limb(const struct joint_evidence *evidence, const struct body_shape *shape, struct vec3 up, int k,
                       struct body_pose *pose)
{
    const struct body_limb *limb = &body_limbs[k];
    struct body_build build;
    body_forward_kinematics(shape, pose, &build);
    if (!is_found(evidence, limb->bend)) {
        if (v3_dot(body_axis(&build, SEG_CHEST, 1), up) > UPRIGHT_COSINE)
            body_aim_segment(shape, pose, limb->upper, v3_scale(up, -1));
        return;
    }
    const struct vec3 root = build.joint[limb->root], bend = evidence->joint[limb->bend],
                      tip = evidence->joint[limb->tip];
    if (!is_found(evidence, limb->tip)) {
        body_aim_segment(shape, pose, limb->upper, v3_sub(bend, root));
        return;
    }
    const double beyond_m = v3_distance(build.joint[limb->tip], build.origin[limb->end]); // of a hand: the palm
    const struct vec3 end = v3_sub(tip, v3_scale(v3_unit(v3_sub(tip, bend)), beyond_m));
    two_bone_ik(shape, pose, limb->upper, end, v3_sub(bend, v3_mix(root, end, 0.5)));
}

struct body_pose joint_evidence_pose(const struct joint_evidence *evidence, const struct body_shape *shape,
                                     struct vec3 up)
{
    const struct joint_evidence complete = joint_evidence_complete(evidence, shape, up);
    struct body_pose pose = trunk_pose(&complete, shape);
    for (int k = 0; k < LIMB_COUNT; k++)
        place_limb(&complete, shape, up, k, &pose);
    return pose;
}

static int compare_doubles(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

double joint_evidence_height_m(const struct joint_evidence *evidence)
{
    static const enum joint bone[][2] = {
        {JOINT_LEFT_SHOULDER, JOINT_LEFT_HIP},       {JOINT_RIGHT_SHOULDER, JOINT_RIGHT_HIP},
        {JOINT_LEFT_SHOULDER, JOINT_LEFT_ELBOW},     {JOINT_RIGHT_SHOULDER, JOINT_RIGHT_ELBOW},
        {JOINT_LEFT_ELBOW, JOINT_LEFT_HAND},         {JOINT_RIGHT_ELBOW, JOINT_RIGHT_HAND},
        {JOINT_LEFT_HIP, JOINT_LEFT_KNEE},           {JOINT_RIGHT_HIP, JOINT_RIGHT_KNEE},
        {JOINT_LEFT_KNEE, JOINT_LEFT_FOOT},          {JOINT_RIGHT_KNEE, JOINT_RIGHT_FOOT},
        {JOINT_LEFT_SHOULDER, JOINT_RIGHT_SHOULDER},
    };
    const struct body_shape average = {{0}, 0, 0};
    const struct body_pose any = body_standing_pose(v3(0, 0, 2), v3(0, -1, 0), 0);
    struct body_build build;
    double rate[COUNT_OF(bone)];
    size_t count = 0;
    body_forward_kinematics(&average, &any, &build);
    for (size_t i = 0; i < COUNT_OF(bone); i++)
        if (is_found(evidence, bone[i][0]) && is_found(evidence, bone[i][1]))
            rate[count++] = v3_distance(evidence->joint[bone[i][0]], evidence->joint[bone[i][1]]) /
                            v3_distance(build.joint[bone[i][0]], build.joint[bone[i][1]]);
    qsort(rate, count, sizeof *rate, compare_doubles);
    return count < BONES_MIN ? BODY_AVERAGE_HEIGHT_M : BODY_AVERAGE_HEIGHT_M * rate[count / 2];
}
