#include "capture/body/two_bone_ik.h"

// Bounds of the distance from root to end, inside the reach of the limb: it never folds up or stretches completely.
static const double FOLDED_SLACK_M = 0.02, STRETCHED_SLACK_M = 0.005;

static struct vec3 camera_to_segment(double m[3][3], struct vec3 v)
{
    return v3(m[0][0] * v.x + m[1][0] * v.y + m[2][0] * v.z, m[0][1] * v.x + m[1][1] * v.y + m[2][1] * v.z,
              m[0][2] * v.x + m[1][2] * v.y + m[2][2] * v.z);
}

void body_aim_segment(const struct body_shape *shape, struct body_pose *pose, enum segment segment,
                      struct vec3 direction)
{
    struct body_build build;
    body_forward_kinematics(shape, pose, &build);
    struct vec3 now = quat_rotate(pose->rotation[segment], v3(0, -1, 0)),
                wanted = v3_unit(camera_to_segment(build.parent_axes[segment], direction));
    pose->rotation[segment] = quat_unit(quat_multiply(quat_between(now, wanted), pose->rotation[segment]));
}

void two_bone_ik(const struct body_shape *shape, struct body_pose *pose, enum segment upper, struct vec3 target,
                 struct vec3 pole)
{
    struct body_build build;
    if (!v3_finite(target) || !v3_finite(pole))
        return;
    body_forward_kinematics(shape, pose, &build);
    enum segment lower = upper + 1, end = upper + 2;
    struct vec3 base = build.origin[upper], way = v3_sub(target, base), along = v3_unit(way);
    double a = v3_distance(base, build.origin[lower]), b = v3_distance(build.origin[lower], build.origin[end]),
           d = v3_length(way);
    d = fmin(fmax(d, fabs(a - b) + FOLDED_SLACK_M), a + b - STRETCHED_SLACK_M);
    double at = (a * a - b * b + d * d) / (2 * d), high = sqrt(fmax(0, a * a - at * at));
    struct vec3 off = v3_unit(v3_sub(pole, v3_scale(along, v3_dot(pole, along))));
    struct vec3 middle = v3_add(v3_scale(along, at), v3_scale(off, high));
    body_aim_segment(shape, pose, upper, middle);
    body_aim_segment(shape, pose, lower, v3_sub(v3_scale(along, d), middle));
}
