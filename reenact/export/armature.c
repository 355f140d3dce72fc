#include "reenact/export/armature.h"

#include "formats/bvh_printer.h"

#include <stdlib.h>
#include <string.h>

// ---------------------------------------------------------------- the tree

enum { NO_PARENT = -1, NO_TIP = -1 };

// part: whose rotation the bone has before it is pointed; PART_COUNT: its parent's. tip: the bone whose beginning it is
// pointed at.
static const struct bone_rule {
    int parent, tip;
    enum joint joint;
    enum part part;
} rules[ARMATURE_BONES] = {
    [ARMATURE_HIPS] = {NO_PARENT, NO_TIP, JOINT_WAIST, PART_LOWER_TORSO},
    [ARMATURE_SPINE] = {ARMATURE_HIPS, ARMATURE_CHEST, JOINT_COUNT, PART_LOWER_TORSO},
    [ARMATURE_CHEST] = {ARMATURE_SPINE, ARMATURE_NECK, JOINT_TORSO, PART_UPPER_TORSO},
    [ARMATURE_UPPER_CHEST] = {ARMATURE_CHEST, NO_TIP, JOINT_COUNT, PART_COUNT},
    [ARMATURE_NECK] = {ARMATURE_UPPER_CHEST, ARMATURE_HEAD, JOINT_NECK, PART_HEAD},
    [ARMATURE_HEAD] = {ARMATURE_NECK, NO_TIP, JOINT_HEAD, PART_COUNT},
    [ARMATURE_LEFT_CLAVICLE] = {ARMATURE_UPPER_CHEST, ARMATURE_LEFT_UPPER_ARM, JOINT_COUNT, PART_COUNT},
    [ARMATURE_LEFT_UPPER_ARM] = {ARMATURE_LEFT_CLAVICLE, ARMATURE_LEFT_FOREARM, JOINT_LEFT_SHOULDER,
                                 PART_LEFT_UPPER_ARM},
    [ARMATURE_LEFT_FOREARM] = {ARMATURE_LEFT_UPPER_ARM, ARMATURE_LEFT_HAND, JOINT_LEFT_ELBOW, PART_LEFT_FOREARM},
    [ARMATURE_LEFT_HAND] = {ARMATURE_LEFT_FOREARM, NO_TIP, JOINT_LEFT_HAND, PART_COUNT},
    [ARMATURE_RIGHT_CLAVICLE] = {ARMATURE_UPPER_CHEST, ARMATURE_RIGHT_UPPER_ARM, JOINT_COUNT, PART_COUNT},
    [ARMATURE_RIGHT_UPPER_ARM] = {ARMATURE_RIGHT_CLAVICLE, ARMATURE_RIGHT_FOREARM, JOINT_RIGHT_SHOULDER,
                                  PART_RIGHT_UPPER_ARM},
    [ARMATURE_RIGHT_FOREARM] = {ARMATURE_RIGHT_UPPER_ARM, ARMATURE_RIGHT_HAND, JOINT_RIGHT_ELBOW, PART_RIGHT_FOREARM},
    [ARMATURE_RIGHT_HAND] = {ARMATURE_RIGHT_FOREARM, NO_TIP, JOINT_RIGHT_HAND, PART_COUNT},
    [ARMATURE_LEFT_THIGH] = {ARMATURE_HIPS, ARMATURE_LEFT_SHIN, JOINT_LEFT_HIP, PART_LEFT_THIGH},
    [ARMATURE_LEFT_SHIN] = {ARMATURE_LEFT_THIGH, ARMATURE_LEFT_FOOT, JOINT_LEFT_KNEE, PART_LEFT_SHIN},
    [ARMATURE_LEFT_FOOT] = {ARMATURE_LEFT_SHIN, NO_TIP, JOINT_LEFT_FOOT, PART_COUNT},
    [ARMATURE_LEFT_TOES] = {ARMATURE_LEFT_FOOT, NO_TIP, JOINT_COUNT, PART_COUNT},
    [ARMATURE_RIGHT_THIGH] = {ARMATURE_HIPS, ARMATURE_RIGHT_SHIN, JOINT_RIGHT_HIP, PART_RIGHT_THIGH},
    [ARMATURE_RIGHT_SHIN] = {ARMATURE_RIGHT_THIGH, ARMATURE_RIGHT_FOOT, JOINT_RIGHT_KNEE, PART_RIGHT_SHIN},
    [ARMATURE_RIGHT_FOOT] = {ARMATURE_RIGHT_SHIN, NO_TIP, JOINT_RIGHT_FOOT, PART_COUNT},
    [ARMATURE_RIGHT_TOES] = {ARMATURE_RIGHT_FOOT, NO_TIP, JOINT_COUNT, PART_COUNT},
};

// Mixamo's and HumanIK's are the same words; Unreal's are those of its mannequin.
static const char *const names[ARMATURE_NAMINGS][ARMATURE_BONES] = {
    [ARMATURE_OURS] = {"waist",          "spine",          "torso",         "upper_chest", "neck",
                       "head",           "left_clavicle",  "left_shoulder", "left_elbow",  "left_hand",
                       "right_clavicle", "right_shoulder", "right_elbow",   "right_hand",  "left_hip",
                       "left_knee",      "left_foot",      "left_toes",     "right_hip",   "right_knee",
                       "right_foot",     "right_toes"},
    [ARMATURE_MIXAMO] = {"mixamorig:Hips",         "mixamorig:Spine",         "mixamorig:Spine1",
                         "mixamorig:Spine2",       "mixamorig:Neck",          "mixamorig:Head",
                         "mixamorig:LeftShoulder", "mixamorig:LeftArm",       "mixamorig:LeftForeArm",
                         "mixamorig:LeftHand",     "mixamorig:RightShoulder", "mixamorig:RightArm",
                         "mixamorig:RightForeArm", "mixamorig:RightHand",     "mixamorig:LeftUpLeg",
                         "mixamorig:LeftLeg",      "mixamorig:LeftFoot",      "mixamorig:LeftToeBase",
                         "mixamorig:RightUpLeg",   "mixamorig:RightLeg",      "mixamorig:RightFoot",
                         "mixamorig:RightToeBase"},
    [ARMATURE_UNREAL] = {"pelvis",     "spine_01",   "spine_02",   "spine_03", "neck_01",    "head",
                         "clavicle_l", "upperarm_l", "lowerarm_l", "hand_l",   "clavicle_r", "upperarm_r",
                         "lowerarm_r", "hand_r",     "thigh_l",    "calf_l",   "foot_l",     "ball_l",
                         "thigh_r",    "calf_r",     "foot_r",     "ball_r"},
    [ARMATURE_HUMANIK] = {"Hips",         "Spine",     "Spine1",      "Spine2",      "Neck",          "Head",
                          "LeftShoulder", "LeftArm",   "LeftForeArm", "LeftHand",    "RightShoulder", "RightArm",
                          "RightForeArm", "RightHand", "LeftUpLeg",   "LeftLeg",     "LeftFoot",      "LeftToeBase",
                          "RightUpLeg",   "RightLeg",  "RightFoot",   "RightToeBase"},
};

const char *armature_bone_name(enum armature_naming naming, enum armature_bone bone) { return names[naming][bone]; }
int armature_parent(enum armature_bone bone) { return rules[bone].parent; }
enum joint armature_joint(enum armature_bone bone) { return rules[bone].joint; }

// ---------------------------------------------------------------- joints

static bool is_known(const float *joints, enum joint joint) { return isfinite(joints[3 * joint]); }

static struct vec3 joint_at(const float *joints, enum joint joint)
{
    return v3((double)joints[3 * joint], (double)joints[3 * joint + 1], (double)joints[3 * joint + 2]);
}

static struct skeleton skeleton_of(const float *joints)
{
    struct skeleton s = {.confidence = {0}};
    for (int j = 0; j < JOINT_COUNT; j++)
        if (is_known(joints, (enum joint)j)) {
            s.joint[j] = joint_at(joints, (enum joint)j);
            s.confidence[j] = 1;
        }
    return s;
}

// ---------------------------------------------------------------- lengths

static int compare_values(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

// NaN of none.
static double find_median(double *values, int64_t count)
{
    qsort(values, (size_t)count, sizeof *values, compare_values);
    return count ? values[count / 2] : NAN;
}

struct joint_rows {
    const struct markers *markers;
    double *scratch; // [count]
};

static double median_length(const struct joint_rows *rows, enum joint from, enum joint to)
{
    int64_t count = 0;
    for (int64_t i = 0; i < rows->markers->count; i++)
        if (is_known(rows->markers->at[i][0], from) && is_known(rows->markers->at[i][0], to))
            rows->scratch[count++] =
                v3_distance(joint_at(rows->markers->at[i][0], from), joint_at(rows->markers->at[i][0], to));
    return find_median(rows->scratch, count);
}

// The hips' own axes: x exactly along the hips, so that both keep their places in them; y along the spine as far as
// that allows.
static bool hips_rotation(const float *joints, struct quat *out)
{
    if (!is_known(joints, JOINT_LEFT_HIP) || !is_known(joints, JOINT_RIGHT_HIP) || !is_known(joints, JOINT_WAIST) ||
        !is_known(joints, JOINT_TORSO))
        return false;
    const struct vec3 x = v3_unit(v3_sub(joint_at(joints, JOINT_LEFT_HIP), joint_at(joints, JOINT_RIGHT_HIP))),
                      up = v3_sub(joint_at(joints, JOINT_TORSO), joint_at(joints, JOINT_WAIST)),
                      z = v3_unit(v3_cross(x, up)), y = v3_cross(z, x);
    double m[3][3] = {{x.x, y.x, z.x}, {x.y, y.y, z.y}, {x.z, y.z, z.z}};
    *out = quat_from_matrix(m);
    return v3_dot(x, x) > 0 && v3_dot(z, z) > 0;
}

// The chest's axes: y along the spine, x across the shoulders as far as that allows.
static bool chest_rotation(const float *joints, struct quat *out)
{
    const struct skeleton s = skeleton_of(joints);
    struct bone_frame f;
    if (!bone_frame_body_aligned(&s, PART_UPPER_TORSO, &f))
        return false;
    const struct vec3 x = f.x, y = v3_scale(f.z, -1), z = f.y; // f: z down, y to the front
    double m[3][3] = {{x.x, y.x, z.x}, {x.y, y.y, z.y}, {x.z, y.z, z.z}};
    *out = quat_from_matrix(m);
    return true;
}

// The median place of `to` seen from `from` in the axes that `rotation_of` gives.
static struct vec3 median_offset(const struct joint_rows *rows, enum joint from, enum joint to,
                                 bool (*rotation_of)(const float *joints, struct quat *out))
{
    double median[3];
    for (int axis = 0; axis < 3; axis++) {
        int64_t count = 0;
        for (int64_t i = 0; i < rows->markers->count; i++) {
            struct quat q;
            if (!is_known(rows->markers->at[i][0], from) || !is_known(rows->markers->at[i][0], to) ||
                !rotation_of(rows->markers->at[i][0], &q))
                continue;
            const struct vec3 bone = v3_sub(joint_at(rows->markers->at[i][0], to),
                                            joint_at(rows->markers->at[i][0], from)),
                              in = quat_rotate(quat_conjugate(q), bone);
            rows->scratch[count++] = (&in.x)[axis];
        }
        median[axis] = find_median(rows->scratch, count);
    }
    return v3(median[0], median[1], median[2]);
}

// Left and right as mirror images: the mean of both. *left, *right: offsets from the middle.
static void make_symmetric(struct vec3 *left, struct vec3 *right)
{
    const struct vec3 mean = v3_scale(v3_add(*left, v3(-right->x, right->y, right->z)), 0.5);
    *left = mean;
    *right = v3(-mean.x, mean.y, mean.z);
}

// Shares of a line at which bones without a joint begin: by hand, about as in Mixamo's figures.
static const double SPINE_SHARE = 0.2, UPPER_CHEST_SHARE = 0.5, CLAVICLE_SHARE = 0.2;
// From an ankle to the ball of the foot, the ball to the sole, and beyond it to the tips: usual lengths.
static const struct vec3 TOES_FROM_FOOT = {0, -0.06, 0.12}, TOE_TIPS = {0, 0, 0.06};

static void set_trunk(struct armature *out, const struct joint_rows *rows)
{
    const double lower_m = median_length(rows, JOINT_WAIST, JOINT_TORSO),
                 upper_m = median_length(rows, JOINT_TORSO, JOINT_NECK),
                 neck_m = median_length(rows, JOINT_NECK, JOINT_HEAD);
    struct vec3 left = median_offset(rows, JOINT_NECK, JOINT_LEFT_SHOULDER, chest_rotation),
                right = median_offset(rows, JOINT_NECK, JOINT_RIGHT_SHOULDER, chest_rotation);
    make_symmetric(&left, &right);
    out->offset[ARMATURE_SPINE] = v3(0, SPINE_SHARE * lower_m, 0);
    out->offset[ARMATURE_CHEST] = v3(0, (1 - SPINE_SHARE) * lower_m, 0);
    out->offset[ARMATURE_UPPER_CHEST] = v3(0, UPPER_CHEST_SHARE * upper_m, 0);
    out->offset[ARMATURE_NECK] = v3(0, (1 - UPPER_CHEST_SHARE) * upper_m, 0);
    out->offset[ARMATURE_HEAD] = v3(0, isfinite(neck_m) ? neck_m : 0.2, 0); // a head is often out of the picture
    out->offset[ARMATURE_LEFT_CLAVICLE] = v3_add(out->offset[ARMATURE_NECK], v3_scale(left, CLAVICLE_SHARE));
    out->offset[ARMATURE_RIGHT_CLAVICLE] = v3_add(out->offset[ARMATURE_NECK], v3_scale(right, CLAVICLE_SHARE));
    out->offset[ARMATURE_LEFT_UPPER_ARM] = v3_scale(left, 1 - CLAVICLE_SHARE);
    out->offset[ARMATURE_RIGHT_UPPER_ARM] = v3_scale(right, 1 - CLAVICLE_SHARE);
}

static void set_limbs(struct armature *out, const struct joint_rows *rows)
{
    struct vec3 left = median_offset(rows, JOINT_WAIST, JOINT_LEFT_HIP, hips_rotation),
                right = median_offset(rows, JOINT_WAIST, JOINT_RIGHT_HIP, hips_rotation);
    make_symmetric(&left, &right);
    out->offset[ARMATURE_LEFT_THIGH] = left;
    out->offset[ARMATURE_RIGHT_THIGH] = right;
    out->offset[ARMATURE_LEFT_FOREARM] = v3(median_length(rows, JOINT_LEFT_SHOULDER, JOINT_LEFT_ELBOW), 0, 0);
    out->offset[ARMATURE_LEFT_HAND] = v3(median_length(rows, JOINT_LEFT_ELBOW, JOINT_LEFT_HAND), 0, 0);
    out->offset[ARMATURE_RIGHT_FOREARM] = v3(-median_length(rows, JOINT_RIGHT_SHOULDER, JOINT_RIGHT_ELBOW), 0, 0);
    out->offset[ARMATURE_RIGHT_HAND] = v3(-median_length(rows, JOINT_RIGHT_ELBOW, JOINT_RIGHT_HAND), 0, 0);
    out->offset[ARMATURE_LEFT_SHIN] = v3(0, -median_length(rows, JOINT_LEFT_HIP, JOINT_LEFT_KNEE), 0);
    out->offset[ARMATURE_LEFT_FOOT] = v3(0, -median_length(rows, JOINT_LEFT_KNEE, JOINT_LEFT_FOOT), 0);
    out->offset[ARMATURE_RIGHT_SHIN] = v3(0, -median_length(rows, JOINT_RIGHT_HIP, JOINT_RIGHT_KNEE), 0);
    out->offset[ARMATURE_RIGHT_FOOT] = v3(0, -median_length(rows, JOINT_RIGHT_KNEE, JOINT_RIGHT_FOOT), 0);
    out->offset[ARMATURE_LEFT_TOES] = out->offset[ARMATURE_RIGHT_TOES] = TOES_FROM_FOOT;
}

// Where the bones begin at rest, the toes on the floor, and the parts' frames there.
static void set_rest(struct armature *out)
{
    struct skeleton s = {.confidence = {0}};
    double low = 0;
    out->offset[ARMATURE_HIPS] = v3(0, 0, 0);
    for (int pass = 0; pass < 2; pass++) {
        for (int b = 0; b < ARMATURE_BONES; b++) {
            const int parent = rules[b].parent;
            out->rest[b] = v3_add(parent == NO_PARENT ? v3(0, 0, 0) : out->rest[parent], out->offset[b]);
            low = fmin(low, out->rest[b].y);
        }
        if (!pass)
            out->offset[ARMATURE_HIPS] = v3(0, -low, 0);
    }
    for (int b = 0; b < ARMATURE_BONES; b++)
        if (rules[b].joint < JOINT_COUNT) {
            s.joint[rules[b].joint] = out->rest[b];
            s.confidence[rules[b].joint] = 1;
        }
    for (int p = 0; p < PART_COUNT; p++) {
        struct bone_frame f;
        out->part_rest[p] =
            bone_frame_body_aligned(&s, (enum part)p, &f) ? bone_frame_rotation(&f) : (struct quat){0, 0, 0, 1};
    }
}

enum status armature_make(struct armature *out, const struct markers *markers)
{
    *out = (struct armature){.offset = {{0, 0, 0}}};
    struct joint_rows rows = {markers, malloc(sizeof(double) * (size_t)(markers->count ? markers->count : 1))};
    if (!rows.scratch)
        return fail(ERR_MEMORY, "no memory for the lengths of bones");
    set_trunk(out, &rows);
    set_limbs(out, &rows);
    free(rows.scratch);
    for (int b = 0; b < ARMATURE_BONES; b++)
        if (!v3_finite(out->offset[b]))
            return fail(ERR_INPUT, "the bone to the %s is never seen, so it has no length; export without --skeleton",
                        names[ARMATURE_OURS][b]);
    set_rest(out);
    return OK;
}

// ---------------------------------------------------------------- poses

struct armature_parts armature_parts_of(const struct armature *armature, const float *joints)
{
    const struct skeleton s = skeleton_of(joints);
    struct armature_parts parts;
    for (int p = 0; p < PART_COUNT; p++) {
        struct bone_frame f;
        parts.known[p] = bone_frame_body_aligned(&s, (enum part)p, &f);
        parts.rotation[p] = parts.known[p]
                                ? quat_multiply(bone_frame_rotation(&f), quat_conjugate(armature->part_rest[p]))
                                : (struct quat){0, 0, 0, 1};
    }
    return parts;
}

// The rotation of a bone at `at` before and after it is pointed at its tip, in the joints' axes.
static struct quat point_bone(const struct armature *armature, int bone, struct quat rotation, struct vec3 at,
                              const float *joints)
{
    const int tip = rules[bone].tip;
    if (tip == NO_TIP || !is_known(joints, rules[tip].joint))
        return rotation;
    const struct vec3 is = quat_rotate(rotation, v3_sub(armature->rest[tip], armature->rest[bone])),
                      wanted = v3_sub(joint_at(joints, rules[tip].joint), at);
    return quat_unit(quat_multiply(quat_between(is, wanted), rotation));
}

void armature_pose_move(struct armature_pose *pose, const struct armature *armature, const struct armature_parts *parts,
                        const float *joints)
{
    struct quat world[ARMATURE_BONES], hips;
    struct vec3 at[ARMATURE_BONES];
    if (!pose->known) {
        pose->root = armature->rest[ARMATURE_HIPS];
        for (int b = 0; b < ARMATURE_BONES; b++)
            pose->rotation[b] = (struct quat){0, 0, 0, 1};
    }
    if (is_known(joints, JOINT_WAIST)) {
        pose->root = joint_at(joints, JOINT_WAIST);
        pose->known = true;
    }
    for (int b = 0; b < ARMATURE_BONES; b++) {
        const int parent = rules[b].parent;
        const enum part part = rules[b].part;
        const struct quat above = parent == NO_PARENT ? (struct quat){0, 0, 0, 1} : world[parent];
        at[b] = parent == NO_PARENT ? pose->root : v3_add(at[parent], quat_rotate(above, armature->offset[b]));
        const bool pointed = rules[b].tip != NO_TIP && is_known(joints, rules[rules[b].tip].joint);
        if (b == ARMATURE_HIPS && hips_rotation(joints, &hips))
            world[b] = hips;
        else if (part < PART_COUNT && parts->known[part])
            world[b] = parts->rotation[part];
        else
            world[b] = part == PART_COUNT && pointed ? above : quat_multiply(above, pose->rotation[b]);
        world[b] = point_bone(armature, b, world[b], at[b], joints);
        pose->rotation[b] = quat_unit(quat_multiply(quat_conjugate(above), world[b]));
    }
}

void armature_positions(const struct armature *armature, const struct armature_pose *pose,
                        struct vec3 out[ARMATURE_BONES])
{
    struct quat world[ARMATURE_BONES];
    for (int b = 0; b < ARMATURE_BONES; b++) {
        const int parent = rules[b].parent;
        world[b] = parent == NO_PARENT ? pose->rotation[b] : quat_multiply(world[parent], pose->rotation[b]);
        out[b] =
            parent == NO_PARENT ? pose->root : v3_add(out[parent], quat_rotate(world[parent], armature->offset[b]));
    }
}

// ---------------------------------------------------------------- BVH

static struct vec3 end_of(int bone)
{
    if (bone == ARMATURE_HEAD)
        return v3(0, 0.12, 0);
    if (bone == ARMATURE_LEFT_TOES || bone == ARMATURE_RIGHT_TOES)
        return TOE_TIPS;
    return v3(bone == ARMATURE_LEFT_HAND ? 0.1 : -0.1, 0, 0);
}

struct fit_sum {
    double sum_m, max_m;
    int64_t count;
};

static void add_fit(struct fit_sum *fit, const struct armature *armature, const struct armature_pose *pose,
                    const float *joints)
{
    struct vec3 at[ARMATURE_BONES];
    armature_positions(armature, pose, at);
    for (int b = 0; b < ARMATURE_BONES; b++) {
        const enum joint joint = rules[b].joint;
        if (joint == JOINT_COUNT || !is_known(joints, joint))
            continue;
        const double off_m = v3_distance(at[b], joint_at(joints, joint));
        fit->sum_m += off_m;
        fit->max_m = fmax(fit->max_m, off_m);
        fit->count++;
    }
}

static void print_frames(const struct markers *markers, const struct armature *armature,
                         const struct bvh_bone bones[ARMATURE_BONES], struct fit_sum *fit, FILE *out)
{
    struct armature_pose pose = {.known = false};
    for (int64_t i = 0; i < markers->count && !pose.known; i++) { // the first that is seen stands before it, too
        const struct armature_parts parts = armature_parts_of(armature, markers->at[i][0]);
        armature_pose_move(&pose, armature, &parts, markers->at[i][0]);
    }
    for (int64_t i = 0; i < markers->count; i++) {
        const struct armature_parts parts = armature_parts_of(armature, markers->at[i][0]);
        armature_pose_move(&pose, armature, &parts, markers->at[i][0]);
        add_fit(fit, armature, &pose, markers->at[i][0]);
        for (int b = 0; b < ARMATURE_BONES; b++)
            bvh_print_bone(&bones[b], pose.root, pose.rotation[b], out);
        fputc('\n', out);
    }
}

enum status armature_bvh_print(const struct markers *markers, enum armature_naming naming, FILE *out,
                               struct armature_fit *fit)
{
    struct armature armature;
    struct bvh_bone bones[ARMATURE_BONES];
    struct fit_sum sum = {0};
    const enum status status = armature_make(&armature, markers);
    if (status != OK)
        return status;
    for (int b = 0; b < ARMATURE_BONES; b++)
        bones[b] = (struct bvh_bone){.name = names[naming][b],
                                     .parent = rules[b].parent,
                                     .offset = b == ARMATURE_HIPS ? v3(0, 0, 0) : armature.offset[b],
                                     .end = end_of(b)};
    bvh_print_hierarchy(bones, ARMATURE_BONES, out);
    bvh_print_motion(markers->count, 1 / markers->rate_hz, out);
    print_frames(markers, &armature, bones, &sum, out);
    *fit = (struct armature_fit){sum.count ? sum.sum_m / (double)sum.count : 0, sum.max_m};
    return OK;
}
