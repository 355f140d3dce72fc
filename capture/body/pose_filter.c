#include "capture/body/pose_filter.h"

#include "base/portable_math.h"
#include "capture/body/two_bone_ik.h"

#include <string.h>

// Time constants and thresholds, chosen by hand; test_pose_filter measures jitter and lag.
#define JITTER_S         0.5   // averaging time of the jitter's variance
#define JITTER_INITIAL_M 0.008 // before any measurement
#define JITTER_MIN_M     0.002
#define JITTER_MAX_M     0.015 // more is motion
#define FULL_GAIN_SIGMAS 12.0  // an innovation of so many standard deviations has gain 1
#define FULL_GAIN_M_S    0.30  // and so has this speed of the fits
#define SPEED_S          0.25  // averaging time of the speed
#define STATIC_S         2.0   // averaging time of a static limb; at first, over all fits so far
#define SPEED_MAX_M_S    6.5   // of a thrown punch (McGill et al. 2010 report 6 to 10 m/s)

// limit_speed approaches the bound from below, in a few rounds.
#define LIMIT_SLACK 0.97
enum { LIMIT_ROUNDS = 4 };

// Groups of segments with one gain: the trunk and four limbs.
enum { TRUNK, GROUPS = 1 + LIMB_COUNT };

static int group_of(int segment)
{
    return segment >= SEG_LEFT_UPPER_ARM && segment <= SEG_LEFT_HAND     ? 1
           : segment >= SEG_RIGHT_UPPER_ARM && segment <= SEG_RIGHT_HAND ? 2
           : segment >= SEG_LEFT_THIGH && segment <= SEG_LEFT_FOOT       ? 3
           : segment >= SEG_RIGHT_THIGH                                  ? 4
                                                                         : TRUNK;
}

static const struct body_limb *limb_of(int group) { return &body_limbs[group - 1]; }

void pose_filter_start(struct pose_filter *filter, const struct body_shape *shape, const struct body_pose *pose)
{
    struct body_build build;
    body_forward_kinematics(shape, pose, &build);
    *filter = (struct pose_filter){.pose = *pose, .fits = 1};
    memcpy(filter->joint, build.joint, sizeof filter->joint);
    memcpy(filter->fit[0], build.joint, sizeof filter->fit[0]);
    for (int j = 0; j < JOINT_COUNT; j++)
        filter->jitter_m2[j] = JITTER_INITIAL_M * JITTER_INITIAL_M;
}

// The deviation of three consecutive fits from a straight line is jitter, but for acceleration, which JITTER_MAX_M
// bounds.
static void measure_jitter(struct pose_filter *filter, const struct body_build *is, double dt_s)
{
    for (int j = 0; j < JOINT_COUNT; j++) {
        struct vec3 p = is->joint[j];
        if (filter->fits >= 2) {
            struct vec3 bend = v3_add(v3_sub(p, v3_scale(filter->fit[0][j], 2)), filter->fit[1][j]);
            double now = fmin(v3_dot(bend, bend) / 6, JITTER_MAX_M * JITTER_MAX_M); // 1 + 4 + 1 variances
            filter->jitter_m2[j] += (now - filter->jitter_m2[j]) * (1 - portable_exp(-dt_s / JITTER_S));
        }
        filter->speed[j] = v3_mix(filter->speed[j], v3_scale(v3_sub(p, filter->fit[0][j]), 1 / dt_s),
                                  1 - portable_exp(-dt_s / SPEED_S));
        filter->fit[1][j] = filter->fit[0][j];
        filter->fit[0][j] = p;
    }
    filter->fits += filter->fits < 1000;
}

// The gain of each group, from STATIC_S to 1.
static void find_gains(const struct pose_filter *filter, const struct body_build *is, double dt_s, double gain[GROUPS])
{
    double max[GROUPS] = {0}, min = fmax(1 - portable_exp(-dt_s / STATIC_S), 1.0 / filter->fits);
    int group[JOINT_COUNT] = {0};
    for (int g = 1; g < GROUPS; g++)
        group[limb_of(g)->bend] = group[limb_of(g)->tip] = g;
    for (int j = 0; j < JOINT_COUNT; j++) {
        double off = v3_distance(is->joint[j], filter->joint[j]) /
                     (FULL_GAIN_SIGMAS * fmax(JITTER_MIN_M, sqrt(filter->jitter_m2[j]))),
               fast = v3_length(filter->speed[j]) / FULL_GAIN_M_S;
        max[group[j]] = fmax(max[group[j]], off * off + fast * fast);
    }
    for (int g = 0; g < GROUPS; g++)
        gain[g] = min + (1 - min) * fmin(1, max[g] * max[g]);
}

// Slerp of each segment's rotation in the camera, not in its parent: jitter of the trunk and the opposite jitter of a
// limb against the trunk cancel out.
static void blend_poses(const struct body_pose *from, const struct body_pose *to, const double gain[GROUPS],
                        struct body_pose *out)
{
    struct quat a[SEG_COUNT], b[SEG_COUNT], mixed[SEG_COUNT];
    for (int i = 0; i < SEG_COUNT; i++) {
        int parent = body_parent((enum segment)i);
        a[i] = parent < 0 ? from->rotation[i] : quat_multiply(a[parent], from->rotation[i]);
        b[i] = parent < 0 ? to->rotation[i] : quat_multiply(b[parent], to->rotation[i]);
        mixed[i] = quat_slerp(a[i], b[i], gain[group_of(i)]);
        out->rotation[i] = parent < 0 ? mixed[i] : quat_unit(quat_multiply(quat_conjugate(mixed[parent]), mixed[i]));
    }
    out->root = v3_mix(from->root, to->root, gain[TRUNK]);
}

// A standing foot, or a hand, must not move with the trunk's correction: each limb is aimed at the positions of its
// joints between the last filtered and the fitted ones.
static void preserve_limb_ends(const struct pose_filter *filter, const struct body_shape *shape,
                               const struct body_build *is, const double gain[GROUPS], struct body_pose *pose)
{
    for (int g = 1; g < GROUPS; g++) {
        const struct body_limb *l = limb_of(g);
        struct body_build build;
        struct vec3 tip = v3_mix(filter->joint[l->tip], is->joint[l->tip], gain[g]),
                    bend = v3_mix(filter->joint[l->bend], is->joint[l->bend], gain[g]);
        body_forward_kinematics(shape, pose, &build);
        body_aim_segment(shape, pose, l->upper, v3_sub(bend, build.origin[l->upper]));
        body_forward_kinematics(shape, pose, &build);
        body_aim_segment(shape, pose, l->lower, v3_sub(tip, build.origin[l->lower]));
    }
}

// Bounds the speed of a limb that was found again in another place.
static void limit_speed(const struct body_pose *was_pose, const struct body_build *was, const struct body_shape *shape,
                        const struct body_pose *wanted, double dt_s, struct body_pose *out)
{
    struct body_build is;
    double limit = SPEED_MAX_M_S * dt_s, share[GROUPS] = {1, 1, 1, 1, 1};
    *out = *wanted;
    for (int round = 0; round < LIMIT_ROUNDS; round++) { // rotations and distances are not quite proportional
        body_forward_kinematics(shape, out, &is);
        for (int g = 1; g < GROUPS; g++) {
            const struct body_limb *l = limb_of(g);
            double far = fmax(v3_distance(was->origin[l->lower], is.origin[l->lower]),
                              v3_distance(was->origin[l->end], is.origin[l->end]));
            if (far <= limit)
                continue;
            share[g] *= LIMIT_SLACK * limit / far;
            for (int i = (int)l->upper; i <= (int)l->end; i++)
                out->rotation[i] = quat_slerp(was_pose->rotation[i], wanted->rotation[i], share[g]);
        }
    }
}

void pose_filter_update(struct pose_filter *filter, const struct body_shape *shape, const struct body_pose *pose,
                        double dt_s)
{
    struct body_build was, is;
    struct body_pose before = filter->pose, wanted;
    double gain[GROUPS];
    body_forward_kinematics(shape, &before, &was);
    body_forward_kinematics(shape, pose, &is);
    measure_jitter(filter, &is, dt_s);
    find_gains(filter, &is, dt_s, gain);
    blend_poses(&before, pose, gain, &wanted);
    preserve_limb_ends(filter, shape, &is, gain, &wanted);
    limit_speed(&before, &was, shape, &wanted, dt_s, &filter->pose);
    body_forward_kinematics(shape, &filter->pose, &is);
    memcpy(filter->joint, is.joint, sizeof filter->joint);
}
