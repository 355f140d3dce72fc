#include "recording/pose_score.h"

#include "base/portable_math.h"

// lambda of equation 3. Each of the two arm terms is at most theta * sin(theta), so together they reach 3.64. lambda is
// larger, so that a frame with crossed legs, in which neither thigh nor shin can be measured, never has a higher score
// than one without.
static const double LAMBDA = 4;

static bool known(const struct skeleton *s, enum joint a) { return s->confidence[a] > 0; }

// theta_n * a_n of equation 3 for one arm: the angle between torso and arm, times
// how parallel to the image plane the arm is.
static double arm_term(const struct skeleton *s, enum joint shoulder, enum joint hand)
{
    if (!known(s, shoulder) || !known(s, hand) || !known(s, JOINT_NECK) || !known(s, JOINT_TORSO))
        return 0;
    struct vec3 arm = v3_unit(v3_sub(s->joint[hand], s->joint[shoulder]));
    struct vec3 torso = v3_unit(v3_sub(s->joint[JOINT_TORSO], s->joint[JOINT_NECK]));
    double theta = portable_acos(fmax(-1, fmin(1, v3_dot(arm, torso))));
    return theta * fabs(arm.x);
}

// g of equation 2: 1 when the legs are not crossed. For a person seen from behind,
// left and right have changed sides in the image.
static double legs_uncrossed(const struct skeleton *s)
{
    const enum joint need[] = {JOINT_LEFT_HIP, JOINT_LEFT_FOOT, JOINT_RIGHT_HIP, JOINT_RIGHT_FOOT};
    for (size_t i = 0; i < COUNT_OF(need); i++)
        if (!known(s, need[i]))
            return 0;
    struct vec3 left = v3_unit(v3_sub(s->joint[JOINT_LEFT_FOOT], s->joint[JOINT_LEFT_HIP]));
    struct vec3 right = v3_unit(v3_sub(s->joint[JOINT_RIGHT_FOOT], s->joint[JOINT_RIGHT_HIP]));
    bool faces_camera = s->joint[JOINT_LEFT_HIP].x >= s->joint[JOINT_RIGHT_HIP].x;
    // phi is the angle to the x axis, so phi_R > phi_L means that the left leg leans more to +x.
    return faces_camera ? left.x > right.x : right.x > left.x;
}

double pose_score(const struct skeleton *s)
{
    return arm_term(s, JOINT_LEFT_SHOULDER, JOINT_LEFT_HAND) + arm_term(s, JOINT_RIGHT_SHOULDER, JOINT_RIGHT_HAND) +
           LAMBDA * legs_uncrossed(s);
}
