#include "app/live/pose_figure.h"

#include "base/portable_math.h"

#include <math.h>

// A person's axes, world: x to the left, y ahead, z up.
struct axes {
    struct vec3 left, ahead;
};

static bool axes_of(const struct skeleton *skeleton, double turn_rad, struct axes *out)
{
    if (!(skeleton->confidence[JOINT_LEFT_HIP] > 0 && skeleton->confidence[JOINT_RIGHT_HIP] > 0))
        return false;
    struct vec3 left = v3_sub(skeleton->joint[JOINT_LEFT_HIP], skeleton->joint[JOINT_RIGHT_HIP]);
    left.z = 0;
    if (v3_length(left) < 0.02)
        return false;
    left = v3_unit(left);
    const double c = portable_cos(turn_rad), k = portable_sin(turn_rad);
    out->left = v3(c * left.x - k * left.y, k * left.x + c * left.y, 0);
    out->ahead = v3(out->left.y, -out->left.x, 0);
    return true;
}

static struct vec3 to_world(const struct axes *axes, double x, double y, double z)
{
    return v3_add(v3_add(v3_scale(axes->left, x), v3_scale(axes->ahead, y)), v3(0, 0, z));
}

// A vector turned from one person's axes to another's.
static struct vec3 turned(const struct axes *from, const struct axes *to, struct vec3 v)
{
    return to_world(to, v3_dot(v, from->left), v3_dot(v, from->ahead), v.z);
}

struct bone {
    enum joint from, to;
    enum part part;
    double usual_m; // where the person's own length is not known
};

// From the waist outwards; hips and shoulders are put in between.
static const struct bone trunk[] = {{JOINT_WAIST, JOINT_TORSO, PART_LOWER_TORSO, 0.2},
                                    {JOINT_TORSO, JOINT_NECK, PART_UPPER_TORSO, 0.25},
                                    {JOINT_NECK, JOINT_HEAD, PART_HEAD, 0.2}};
static const struct bone limbs[] = {{JOINT_LEFT_SHOULDER, JOINT_LEFT_ELBOW, PART_LEFT_UPPER_ARM, 0.3},
                                    {JOINT_LEFT_ELBOW, JOINT_LEFT_HAND, PART_LEFT_FOREARM, 0.26},
                                    {JOINT_RIGHT_SHOULDER, JOINT_RIGHT_ELBOW, PART_RIGHT_UPPER_ARM, 0.3},
                                    {JOINT_RIGHT_ELBOW, JOINT_RIGHT_HAND, PART_RIGHT_FOREARM, 0.26},
                                    {JOINT_LEFT_HIP, JOINT_LEFT_KNEE, PART_LEFT_THIGH, 0.42},
                                    {JOINT_LEFT_KNEE, JOINT_LEFT_FOOT, PART_LEFT_SHIN, 0.42},
                                    {JOINT_RIGHT_HIP, JOINT_RIGHT_KNEE, PART_RIGHT_THIGH, 0.42},
                                    {JOINT_RIGHT_KNEE, JOINT_RIGHT_FOOT, PART_RIGHT_SHIN, 0.42}};

static void put_bone(const struct skeleton *person, const struct movement_frame *pose, const struct axes *to,
                     const struct bone *bone, struct skeleton *out)
{
    const bool measured = person->confidence[bone->from] > 0 && person->confidence[bone->to] > 0;
    const double length_m = measured ? v3_distance(person->joint[bone->from], person->joint[bone->to]) : bone->usual_m;
    const float *d = pose->direction[bone->part];
    const bool known = (pose->known >> bone->part & 1) && out->confidence[bone->from] > 0;
    out->joint[bone->to] = v3_add(out->joint[bone->from], v3_scale(to_world(to, d[0], d[1], d[2]), length_m));
    out->confidence[bone->to] = known;
}

static void put_hips(const struct skeleton *person, const struct axes *from, const struct axes *to,
                     struct skeleton *out)
{
    const struct vec3 middle = v3_mix(person->joint[JOINT_LEFT_HIP], person->joint[JOINT_RIGHT_HIP], 0.5);
    const struct vec3 waist = person->confidence[JOINT_WAIST] > 0 ? person->joint[JOINT_WAIST] : middle;
    static const enum joint hips[2] = {JOINT_LEFT_HIP, JOINT_RIGHT_HIP};
    out->joint[JOINT_WAIST] = waist;
    out->confidence[JOINT_WAIST] = 1;
    for (int i = 0; i < 2; i++) {
        out->joint[hips[i]] = v3_add(waist, turned(from, to, v3_sub(person->joint[hips[i]], waist)));
        out->confidence[hips[i]] = 1;
    }
}

static void put_shoulders(const struct skeleton *person, const struct movement_frame *pose, const struct axes *to,
                          struct skeleton *out)
{
    const bool measured = person->confidence[JOINT_LEFT_SHOULDER] > 0 && person->confidence[JOINT_RIGHT_SHOULDER] > 0;
    const double width_m =
        measured ? v3_distance(person->joint[JOINT_LEFT_SHOULDER], person->joint[JOINT_RIGHT_SHOULDER]) : 0.36;
    // The shoulders' middle lies below the neck, along the trunk, by as much as the person's.
    const struct vec3 neck = out->joint[JOINT_NECK], down = v3_unit(v3_sub(out->joint[JOINT_TORSO], neck));
    double drop_m = 0;
    if (measured && person->confidence[JOINT_NECK] > 0)
        drop_m = v3_distance(person->joint[JOINT_NECK],
                             v3_mix(person->joint[JOINT_LEFT_SHOULDER], person->joint[JOINT_RIGHT_SHOULDER], 0.5));
    const struct vec3 middle = v3_add(neck, v3_scale(down, drop_m));
    const bool known = pose->known >> PART_COUNT & 1;
    const struct vec3 across =
        known ? to_world(to, pose->shoulders[0], pose->shoulders[1], pose->shoulders[2]) : to->left;
    out->joint[JOINT_LEFT_SHOULDER] = v3_add(middle, v3_scale(across, 0.5 * width_m));
    out->joint[JOINT_RIGHT_SHOULDER] = v3_add(middle, v3_scale(across, -0.5 * width_m));
    out->confidence[JOINT_LEFT_SHOULDER] = out->confidence[JOINT_RIGHT_SHOULDER] = out->confidence[JOINT_NECK];
}

// The height of the lower foot; false: neither is known.
static bool lower_foot(const struct skeleton *skeleton, double *z)
{
    const bool left = skeleton->confidence[JOINT_LEFT_FOOT] > 0, right = skeleton->confidence[JOINT_RIGHT_FOOT] > 0;
    *z = INFINITY;
    if (left)
        *z = skeleton->joint[JOINT_LEFT_FOOT].z;
    if (right)
        *z = fmin(*z, skeleton->joint[JOINT_RIGHT_FOOT].z);
    return left || right;
}

bool pose_figure_make(const struct skeleton *person, const struct movement_frame *now,
                      const struct movement_frame *pose, struct skeleton *out)
{
    struct axes from, to;
    if (!axes_of(person, 0, &from) || !axes_of(person, (double)pose->heading - now->heading, &to))
        return false;
    struct skeleton made = {0};
    put_hips(person, &from, &to, &made);
    for (size_t i = 0; i < COUNT_OF(trunk); i++)
        put_bone(person, pose, &to, &trunk[i], &made);
    put_shoulders(person, pose, &to, &made);
    for (size_t i = 0; i < COUNT_OF(limbs); i++)
        put_bone(person, pose, &to, &limbs[i], &made);
    double stands, floats;
    if (lower_foot(person, &stands) && lower_foot(&made, &floats))
        for (int j = 0; j < JOINT_COUNT; j++)
            made.joint[j].z += stands - floats;
    *out = made;
    return true;
}
