#include "tests/support/body_axes.h"

static bool hangs_on_pelvis(enum joint j)
{
    return j == JOINT_WAIST || j == JOINT_LEFT_HIP || j == JOINT_RIGHT_HIP || j == JOINT_LEFT_KNEE ||
           j == JOINT_RIGHT_KNEE || j == JOINT_LEFT_FOOT || j == JOINT_RIGHT_FOOT;
}

struct axes {
    struct vec3 x, y, z; // of unit length, at right angles
};

static struct axes axes_of(const struct skeleton *truth, enum joint j)
{
    const bool pelvis = hangs_on_pelvis(j);
    const struct vec3 *at = truth->joint;
    const struct vec3 x = v3_unit(pelvis ? v3_sub(at[JOINT_LEFT_HIP], at[JOINT_RIGHT_HIP])
                                         : v3_sub(at[JOINT_LEFT_SHOULDER], at[JOINT_RIGHT_SHOULDER]));
    const struct vec3 down =
        pelvis ? v3_sub(at[JOINT_WAIST], at[JOINT_TORSO]) : v3_sub(at[JOINT_TORSO], at[JOINT_NECK]);
    const struct vec3 forward = v3_unit(v3_cross(down, x));
    return (struct axes){x, v3_cross(x, forward), forward};
}

struct vec3 in_body_axes(const struct skeleton *truth, enum joint j, struct vec3 v)
{
    const struct axes a = axes_of(truth, j);
    return v3(v3_dot(a.x, v), v3_dot(a.y, v), v3_dot(a.z, v));
}

struct vec3 from_body_axes(const struct skeleton *truth, enum joint j, struct vec3 v)
{
    const struct axes a = axes_of(truth, j);
    return v3_add(v3_scale(a.x, v.x), v3_add(v3_scale(a.y, v.y), v3_scale(a.z, v.z)));
}
