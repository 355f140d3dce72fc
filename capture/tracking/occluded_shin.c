#include "capture/tracking/occluded_shin.h"

#include "base/portable_math.h"
#include "capture/body/silhouette_cost.h"
#include "capture/body/two_bone_ik.h"

#include <stdlib.h>

// Chosen by hand on rendered people; test_occluded_shin measures the outcome.
#define PATCH_LOG_ODDS 1.0 // of a patch outside the silhouette; low, since errors of neighbours are correlated
#define STEP_RADIANS   0.05
#define FOOT_YAW_MAX   1.0 // a foot points this far to the side at most, and the knee with it
#define TOE_SHARE      0.7 // of the foot's axis from heel to toe
enum { STEPS = 10, FEET = 2, FIRST_STEP = 2, CANDIDATES = 2 * FEET * (STEPS + 1 - FIRST_STEP) };

struct shin {
    enum segment lower, foot;
    int first; // of its two solids
};

static const struct shin shin[2] = {{SEG_LEFT_SHIN, SEG_LEFT_FOOT, SOLID_LEFT_LEG + 1},
                                    {SEG_RIGHT_SHIN, SEG_RIGHT_FOOT, SOLID_RIGHT_LEG + 1}};
enum { SHIN_SOLIDS = 2 };

// Rotates the foot about the shin so that it points to `toe` as well as it can.
static void point_foot(const struct body_shape *shape, struct body_pose *pose, enum segment foot, struct vec3 toe)
{
    struct body_build build;
    body_forward_kinematics(shape, pose, &build);
    struct vec3 to_toe = v3_sub(toe, build.origin[foot]), left = body_axis(&build, foot, 0),
                ahead = body_axis(&build, foot, 2);
    double yaw = portable_atan2(v3_dot(to_toe, left), v3_dot(to_toe, ahead));
    yaw = fmax(-FOOT_YAW_MAX, fmin(FOOT_YAW_MAX, yaw));
    pose->rotation[foot] = quat_multiply(pose->rotation[foot], quat_from_rotation_vector(v3(0, yaw, 0)));
}

double shin_outside_log_odds(const struct fit_task *task, int leg, const struct body_build *build)
{
    if (task->shape.mean.hem_m > 0)
        return 0;
    return PATCH_LOG_ODDS * silhouette_outside_patches(task, build, shin[leg - FIRST_LEG].first, SHIN_SOLIDS);
}

double shin_alternative_log_odds(const struct fit_task *task, int leg, struct fit_scratch *scratch,
                                 struct body_pose *out)
{
    const struct fit_result *best = &scratch->best;
    const struct shin *s = &shin[leg - FIRST_LEG];
    double outside = shin_outside_log_odds(task, leg, &best->build),
           chosen = portable_log(CANDIDATES); // log of the number of candidates, equally likely a priori
    if (outside <= chosen)                    // no candidate can win
        return 0;
    body_evaluate(task, &best->pose, &best->shape, &scratch->trial);
    const struct body_solid *foot = &best->build.solid[s->first + 1];
    struct vec3 knee = best->build.origin[s->lower], along = v3_unit(v3_sub(best->build.origin[s->foot], knee)),
                across = v3_unit(v3_cross(along, knee)), toe = v3_mix(foot->a, foot->b, TOE_SHARE);
    double now = scratch->trial.energy + outside, min = now;
    for (int i = -STEPS; i <= STEPS; i++)
        for (int f = 0; f < FEET && abs(i) >= FIRST_STEP; f++) {
            struct body_pose pose = best->pose;
            struct body_build build;
            double angle = i * STEP_RADIANS;
            body_aim_segment(&best->shape, &pose, s->lower,
                             v3_add(v3_scale(along, portable_cos(angle)), v3_scale(across, portable_sin(angle))));
            if (f)
                point_foot(&best->shape, &pose, s->foot, toe);
            body_forward_kinematics(&best->shape, &pose, &build);
            double there = shin_outside_log_odds(task, leg, &build);
            if (outside - there <= chosen)
                continue;
            body_evaluate(task, &pose, &best->shape, &scratch->trial);
            if (scratch->trial.energy + there < min) {
                min = scratch->trial.energy + there;
                *out = pose;
            }
        }
    return fmax(0, now - min - chosen);
}
