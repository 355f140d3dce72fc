#include "capture/tracking/point_pose.h"

#include "capture/body/two_bone_ik.h"
#include "capture/tracking/point_hypotheses.h"

// A joint lies about this much behind the surface on its ray; chosen by hand.
#define TRUNK_DEEP_M 0.10
#define LIMB_DEEP_M  0.04

static const enum body_point_name trunk_point[4] = {BODY_POINT_LEFT_SHOULDER, BODY_POINT_RIGHT_SHOULDER,
                                                    BODY_POINT_LEFT_HIP, BODY_POINT_RIGHT_HIP};

static struct vec3 on_ray(const struct point_evidence *evidence, enum body_point_name name, double far_m)
{
    return v3_add(evidence->eye, v3_scale(evidence->ray[evidence->index[name]].along, far_m));
}

// The joint that two points of the trunk have between them, from their rays and the depth behind these. False: there is
// no depth.
static bool find_middle(const struct fit_task *task, enum body_point_name left, enum body_point_name right,
                        double *far_m)
{
    const struct point_evidence *e = task->points;
    double sum = 0;
    int count = 0;
    for (int i = 0; i < 2; i++) {
        const double surface =
            point_surface_m(e, i ? right : left, &task->evidence->lens, task->evidence->depth, task->evidence->mask);
        sum += surface;
        count += surface > 0;
    }
    *far_m = count ? sum / count + TRUNK_DEEP_M : 0;
    return count > 0;
}

// A body's trunk whose shoulders and hips are at these places as nearly as it can be.
static struct body_pose place_trunk(const struct body_shape *shape, struct vec3 left, struct vec3 shoulders,
                                    struct vec3 hips)
{
    const struct vec3 y = v3_unit(v3_sub(shoulders, hips)), x = v3_unit(v3_sub(left, v3_scale(y, v3_dot(left, y)))),
                      z = v3_cross(x, y);
    double m[3][3] = {{x.x, y.x, z.x}, {x.y, y.y, z.y}, {x.z, y.z, z.z}};
    struct body_pose pose = {.root = v3(0, 0, 0)};
    for (int s = 0; s < SEG_COUNT; s++)
        pose.rotation[s] = (struct quat){0, 0, 0, 1};
    pose.rotation[SEG_PELVIS] = quat_from_matrix(m);
    struct body_build build;
    body_forward_kinematics(shape, &pose, &build);
    struct vec3 middle = v3(0, 0, 0);
    for (int k = 0; k < 4; k++)
        middle = v3_add(middle, v3_scale(body_point_on(&build, trunk_point[k]), 0.25));
    pose.root = v3_sub(v3_mix(shoulders, hips, 0.5), middle);
    return pose;
}

// How far a limb's middle joint and end are from the depth behind their points.
static double off_depth_m(const struct fit_task *task, int k, const struct body_build *build)
{
    double off = 0;
    for (int i = 0; i < 2; i++) {
        const enum body_point_name name = point_of_limb(k, i);
        const double surface =
            point_surface_m(task->points, name, &task->evidence->lens, task->evidence->depth, task->evidence->mask);
        if (surface > 0)
            off += v3_distance(on_ray(task->points, name, surface + LIMB_DEEP_M), body_point_on(build, name));
    }
    return off;
}

static void place_limb(const struct fit_task *task, int k, struct body_pose *pose)
{
    const struct body_shape *shape = &task->shape.mean;
    struct limb_target target[LIMB_TARGETS_MAX];
    struct body_build build;
    body_forward_kinematics(shape, pose, &build);
    const int count = point_limb_targets(task->points, &build, k, target);
    const struct body_pose hanging = *pose;
    double min = 1e9;
    for (int i = 0; i < count; i++) {
        struct body_pose tried = hanging;
        two_bone_ik(shape, &tried, body_limbs[k].upper, target[i].end, target[i].pole);
        body_forward_kinematics(shape, &tried, &build);
        const double off = off_depth_m(task, k, &build);
        if (off < min) {
            min = off;
            *pose = tried;
        }
    }
}

int point_poses(const struct fit_task *task, struct body_pose out[POINT_POSES])
{
    const struct point_evidence *e = task->points;
    double shoulders_m, hips_m;
    for (int k = 0; k < 4; k++)
        if (!e || e->index[trunk_point[k]] < 0)
            return 0;
    if (!find_middle(task, trunk_point[0], trunk_point[1], &shoulders_m) ||
        !find_middle(task, trunk_point[2], trunk_point[3], &hips_m))
        return 0;
    struct body_build build; // of any pose: for the distance of the shoulders
    const struct body_pose any = body_standing_pose(v3(0, 0, 2), v3(0, -1, 0), 0);
    body_forward_kinematics(&task->shape.mean, &any, &build);
    const double wide = v3_distance(body_point_on(&build, trunk_point[0]), body_point_on(&build, trunk_point[1]));
    const struct vec3 left = on_ray(e, trunk_point[0], shoulders_m), right = on_ray(e, trunk_point[1], shoulders_m),
                      shoulders = v3_mix(left, right, 0.5), across = v3_sub(left, right),
                      hips = v3_mix(on_ray(e, trunk_point[2], hips_m), on_ray(e, trunk_point[3], hips_m), 0.5),
                      view = v3_unit(v3_sub(shoulders, e->eye));
    const double deep = sqrt(fmax(0, wide * wide - v3_dot(across, across)));
    for (int i = 0; i < POINT_POSES; i++) {
        out[i] = place_trunk(&task->shape.mean, v3_add(across, v3_scale(view, i ? deep : -deep)), shoulders, hips);
        for (int k = 0; k < LIMB_COUNT; k++)
            place_limb(task, k, &out[i]);
    }
    return POINT_POSES;
}
