#include "recording/skeleton.h"

#include <string.h>

const struct part_ends part_ends[PART_COUNT] = {
    [PART_HEAD] = {JOINT_NECK, JOINT_HEAD},
    [PART_UPPER_TORSO] = {JOINT_NECK, JOINT_TORSO},
    [PART_LOWER_TORSO] = {JOINT_TORSO, JOINT_WAIST},
    [PART_LEFT_UPPER_ARM] = {JOINT_LEFT_SHOULDER, JOINT_LEFT_ELBOW},
    [PART_LEFT_FOREARM] = {JOINT_LEFT_ELBOW, JOINT_LEFT_HAND},
    [PART_RIGHT_UPPER_ARM] = {JOINT_RIGHT_SHOULDER, JOINT_RIGHT_ELBOW},
    [PART_RIGHT_FOREARM] = {JOINT_RIGHT_ELBOW, JOINT_RIGHT_HAND},
    [PART_LEFT_THIGH] = {JOINT_LEFT_HIP, JOINT_LEFT_KNEE},
    [PART_LEFT_SHIN] = {JOINT_LEFT_KNEE, JOINT_LEFT_FOOT},
    [PART_RIGHT_THIGH] = {JOINT_RIGHT_HIP, JOINT_RIGHT_KNEE},
    [PART_RIGHT_SHIN] = {JOINT_RIGHT_KNEE, JOINT_RIGHT_FOOT},
};

static const char *const joint_names[JOINT_COUNT] = {
    [JOINT_HEAD] = "head",
    [JOINT_NECK] = "neck",
    [JOINT_LEFT_SHOULDER] = "left_shoulder",
    [JOINT_LEFT_ELBOW] = "left_elbow",
    [JOINT_LEFT_HAND] = "left_hand",
    [JOINT_RIGHT_SHOULDER] = "right_shoulder",
    [JOINT_RIGHT_ELBOW] = "right_elbow",
    [JOINT_RIGHT_HAND] = "right_hand",
    [JOINT_TORSO] = "torso",
    [JOINT_WAIST] = "waist",
    [JOINT_LEFT_HIP] = "left_hip",
    [JOINT_LEFT_KNEE] = "left_knee",
    [JOINT_LEFT_FOOT] = "left_foot",
    [JOINT_RIGHT_HIP] = "right_hip",
    [JOINT_RIGHT_KNEE] = "right_knee",
    [JOINT_RIGHT_FOOT] = "right_foot",
};

const char *joint_name(enum joint joint)
{
    assert(joint >= 0 && joint < JOINT_COUNT);
    return joint_names[joint];
}

bool joint_from_name(const char *name, enum joint *out)
{
    for (int j = 0; j < JOINT_COUNT; j++)
        if (!strcmp(name, joint_names[j])) {
            *out = (enum joint)j;
            return true;
        }
    return false;
}

bool part_is_known(const struct body *body, const struct skeleton *skeleton, enum part part)
{
    return body->radius_rate[part] > 0 && skeleton->confidence[part_ends[part].from] > 0 &&
           skeleton->confidence[part_ends[part].to] > 0;
}

struct covariance3 joint_covariance(const struct skeleton *skeleton, enum joint joint)
{
    return covariance_unpack(skeleton->covariance[joint]);
}

void joint_set_covariance(struct skeleton *skeleton, enum joint joint, const struct covariance3 *m2)
{
    skeleton->covariance[joint] = covariance_pack(m2);
}

double joint_sigma_m(const struct skeleton *skeleton, enum joint joint)
{
    if (!covariance_is_known(skeleton->covariance[joint]))
        return (double)NAN;
    const struct covariance3 c = joint_covariance(skeleton, joint);
    return sqrt(covariance3_trace(&c) / 3);
}

float confidence_of(double sigma_m, bool observed)
{
    if (sigma_m > KNOWN_SIGMA_MAX_M)
        return 0;
    return observed && !(sigma_m > SEEN_SIGMA_MAX_M) ? 1 : 0.5F;
}

struct skeleton skeleton_transform(struct pose a_from_b, const struct skeleton *in_b)
{
    struct skeleton in_a = *in_b;
    for (int j = 0; j < JOINT_COUNT; j++) {
        in_a.joint[j] = pose_apply(a_from_b, in_b->joint[j]);
        if (!covariance_is_known(in_b->covariance[j]))
            continue;
        struct covariance3 c = joint_covariance(in_b, (enum joint)j);
        c = covariance3_rotate(a_from_b.rotation, &c);
        joint_set_covariance(&in_a, (enum joint)j, &c);
    }
    return in_a;
}

bool skeleton_is_in_range(const struct skeleton *skeleton)
{
    for (int j = 0; j < JOINT_COUNT; j++)
        if (!(skeleton->confidence[j] >= 0 && skeleton->confidence[j] <= 1))
            return false;
    return true;
}

static bool is_joint_known(const struct skeleton *skeleton, enum joint joint)
{
    return skeleton->confidence[joint] > 0;
}

static double cosine_between(struct vec3 a, struct vec3 b) { return v3_dot(v3_unit(a), v3_unit(b)); }

bool skeleton_standing_axis(const struct skeleton *skeleton, struct vec3 *axis)
{
    static const enum joint needed[] = {JOINT_NECK,      JOINT_LEFT_HIP,   JOINT_LEFT_KNEE, JOINT_LEFT_FOOT,
                                        JOINT_RIGHT_HIP, JOINT_RIGHT_KNEE, JOINT_RIGHT_FOOT};
    for (size_t i = 0; i < COUNT_OF(needed); i++)
        if (!is_joint_known(skeleton, needed[i]))
            return false;
    const struct vec3 *p = skeleton->joint;
    const struct vec3 hips = v3_mix(p[JOINT_LEFT_HIP], p[JOINT_RIGHT_HIP], 0.5),
                      feet = v3_mix(p[JOINT_LEFT_FOOT], p[JOINT_RIGHT_FOOT], 0.5), trunk = v3_sub(p[JOINT_NECK], hips);
    const double straight = 0.966; // 15 degrees
    for (int side = 0; side < 2; side++) {
        const struct vec3 hip = p[side ? JOINT_RIGHT_HIP : JOINT_LEFT_HIP],
                          knee = p[side ? JOINT_RIGHT_KNEE : JOINT_LEFT_KNEE],
                          foot = p[side ? JOINT_RIGHT_FOOT : JOINT_LEFT_FOOT];
        if (cosine_between(v3_sub(hip, knee), v3_sub(knee, foot)) < straight ||
            cosine_between(v3_sub(hip, foot), trunk) < straight)
            return false;
    }
    *axis = v3_unit(v3_sub(p[JOINT_NECK], feet));
    return true;
}
