#include "tests/support/body_axes.h"

static bool hangs_on_pelvis(enum joint j)
{
    return j == JOINT_WAIST || j == JOINT_LEFT_HIP || j == JOINT_RIGHT_HIP || j == JOINT_LEFT_KNEE ||
           j == JOINT_RIGHT_KNEE || j == JOINT_LEFT_FOOT || j == JOINT_RIGHT_FOOT;
}

struct vec3 in_body_axes(const struct skeleton *truth, enum joint j, struct vec3 v)
{
    const bool pelvis = hangs_on_pelvis(j);
    const struct vec3 *at = truth->joint;
    struct vec3 x = pelvis ? v3_sub(at[JOINT_LEFT_HIP], at[JOINT_RIGHT_HIP])
                           : v3_sub(at[JOINT_LEFT_SHOULDER], at[JOINT_RIGHT_SHOULDER]);
    const struct vec3 down =
        pelvis ? v3_sub(at[JOINT_WAIST], at[JOINT_TORSO]) : v3_sub(at[JOINT_TORSO], at[JOINT_NECK]);
    const struct vec3 forward = v3_unit(v3_cross(down, x));
    x = v3_unit(x);
    return v3(v3_dot(x, v), v3_dot(v3_cross(x, forward), v), v3_dot(forward, v));
}
