#include "capture/body/body_prior.h"

// Standard deviations in radians. neutral: of a joint's rotation from the standing pose with elbows slightly bent;
// step: of its rotation against constant speed one frame later, at 30 Hz; twist: the same about the segment's own axis,
// which depth hardly shows of a round limb. Chosen by hand, wide enough for kicks and punches (test_tracker's kata).
struct rotation_prior {
    double neutral, neutral_twist, step, step_twist;
};

#define ARM_PRIORS(side)                                                                                               \
    [SEG_##side##_CLAVICLE] = {0.16, 0.16, 0.08, 0.08}, [SEG_##side##_UPPER_ARM] = {1.6, 0.8, 0.30, 0.15},             \
    [SEG_##side##_FOREARM] = {1.6, 0.8, 0.35, 0.15}, [SEG_##side##_HAND] = {0.35, 0.35, 0.30, 0.15}
#define LEG_PRIORS(side)                                                                                               \
    [SEG_##side##_THIGH] = {0.9, 0.35, 0.22, 0.10}, [SEG_##side##_SHIN] = {1.0, 0.25, 0.28, 0.10},                     \
    [SEG_##side##_FOOT] = {0.35, 0.30, 0.20, 0.10}

static const struct rotation_prior rotation_prior[SEG_COUNT] = {
    [SEG_PELVIS] = {1e3, 1e3, 0.10, 0.10},
    [SEG_ABDOMEN] = {0.22, 0.18, 0.07, 0.07},
    [SEG_CHEST] = {0.22, 0.18, 0.07, 0.07},
    [SEG_HEAD] = {0.35, 0.60, 0.18, 0.15},
    ARM_PRIORS(LEFT),
    ARM_PRIORS(RIGHT),
    LEG_PRIORS(LEFT),
    LEG_PRIORS(RIGHT),
};

// Of `neutral`, for legs in a skirt or a coat, which restricts them and hides where they are.
#define SKIRT_SIGMA_RATE 0.5
#define ELBOW_BEND       0.6 // radians, the usual bend: a hidden forearm is not stretched out but in front of the trunk
#define ROOT_STEP_M      0.03 // the waist's standard deviation against constant speed one frame later, at 30 Hz

// A rotation's target and its standard deviations across and about the segment's axis.
struct rotation_target {
    struct quat rotation;
    double sigma, sigma_twist;
};

// dot(direction of the segment, normal) is at most cosine_max; normal in the parent's axes.
struct direction_limit {
    struct vec3 normal;
    double cosine_max, sigma;
};

static void add_block(double *h, int at, double block[3][3])
{
    for (int r = 0; r < 3; r++)
        for (int c = 0; c <= r; c++)
            h[(at + r) * FIT_COUNT + at + c] += block[r][c];
}

// Draws the rotation of segment s to a target, in the parent's axes, where the unknowns are.
static double add_rotation_prior(int s, struct quat now, const struct rotation_target *target, double *h, double *g)
{
    const double sigma = target->sigma, sigma_twist = target->sigma_twist;
    struct vec3 off = quat_to_rotation_vector(quat_multiply(target->rotation, quat_conjugate(now)));
    struct vec3 axis = quat_rotate(now, v3(0, 1, 0));
    double swing = 1 / (sigma * sigma), twist = 1 / (sigma_twist * sigma_twist), about = v3_dot(axis, off);
    double a[3] = {axis.x, axis.y, axis.z}, o[3] = {off.x, off.y, off.z}, block[3][3];
    for (int r = 0; r < 3; r++)
        for (int c = 0; c < 3; c++)
            block[r][c] = (r == c ? swing : 0) + (twist - swing) * a[r] * a[c];
    if (h) {
        add_block(h, 3 + 3 * s, block);
        for (int r = 0; r < 3; r++)
            g[3 + 3 * s + r] += swing * o[r] + (twist - swing) * about * a[r];
    }
    return 0.5 * (swing * v3_dot(off, off) + (twist - swing) * about * about);
}

// A one-sided quadratic penalty beyond the limit.
static double add_limit(int s, struct quat now, struct direction_limit limit, double *h, double *g)
{
    const struct vec3 n = limit.normal;
    const double sigma = limit.sigma;
    struct vec3 d = quat_rotate(now, v3(0, -1, 0));
    double over = v3_dot(d, n) - limit.cosine_max;
    if (over <= 0)
        return 0;
    double w = 1 / (sigma * sigma);
    struct vec3 j = v3_cross(d, n); // derivative of the dot product by a rotation
    if (h) {
        double v[3] = {j.x, j.y, j.z}, block[3][3];
        for (int r = 0; r < 3; r++) {
            g[3 + 3 * s + r] -= w * over * v[r];
            for (int c = 0; c < 3; c++)
                block[r][c] = w * v[r] * v[c];
        }
        add_block(h, 3 + 3 * s, block);
    }
    return 0.5 * w * over * over;
}

double body_prior_joint_limits(const struct body_shape *shape, const struct body_pose *pose, double *h, double *g)
{
    double energy = 0;
    const struct quat neutral = {0, 0, 0, 1}, bent = quat_from_rotation_vector(v3(-ELBOW_BEND, 0, 0));
    for (int s = 1; s < SEG_COUNT; s++) {
        bool hides = s == SEG_LEFT_THIGH || s == SEG_LEFT_SHIN || s == SEG_RIGHT_THIGH || s == SEG_RIGHT_SHIN;
        double held = shape->hem_m > 0 && hides ? SKIRT_SIGMA_RATE : 1;
        struct quat usual = s == SEG_LEFT_FOREARM || s == SEG_RIGHT_FOREARM ? bent : neutral;
        const struct rotation_target target = {usual, held * rotation_prior[s].neutral,
                                               held * rotation_prior[s].neutral_twist};
        energy += add_rotation_prior(s, pose->rotation[s], &target, h, g);
    }
    for (int side = 0; side < 2; side++) {
        int shin = side ? SEG_RIGHT_SHIN : SEG_LEFT_SHIN, forearm = side ? SEG_RIGHT_FOREARM : SEG_LEFT_FOREARM,
            thigh = side ? SEG_RIGHT_THIGH : SEG_LEFT_THIGH, arm = side ? SEG_RIGHT_UPPER_ARM : SEG_LEFT_UPPER_ARM;
        double out = side ? -1 : 1;
        // A knee bends backwards, and hardly to the sides.
        energy += add_limit(shin, pose->rotation[shin], (struct direction_limit){v3(0, 0, 1), 0.02, 0.08}, h, g);
        energy += add_limit(shin, pose->rotation[shin], (struct direction_limit){v3(1, 0, 0), 0.05, 0.10}, h, g);
        energy += add_limit(shin, pose->rotation[shin], (struct direction_limit){v3(-1, 0, 0), 0.05, 0.10}, h, g);
        energy += add_limit(shin, pose->rotation[shin], (struct direction_limit){v3(0, 1, 0), 0.85, 0.10}, h, g);
        energy += add_limit(forearm, pose->rotation[forearm], (struct direction_limit){v3(0, 1, 0), 0.85, 0.10}, h, g);
        // A thigh goes far ahead, little back, little across.
        energy += add_limit(thigh, pose->rotation[thigh], (struct direction_limit){v3(0, 0, -1), 0.40, 0.10}, h, g);
        // In a skirt still less: hidden legs are not to be fitted crossed.
        bool skirt = shape->hem_m > 0;
        energy += add_limit(thigh, pose->rotation[thigh],
                            (struct direction_limit){v3(-out, 0, 0), skirt ? 0.10 : 0.35, 0.10}, h, g);
        // An arm goes across the chest, but not through the back.
        energy +=
            add_limit(arm, pose->rotation[arm], (struct direction_limit){v3_unit(v3(-out, 0, -0.6)), 0.45, 0.15}, h, g);
        energy += add_limit(arm, pose->rotation[arm], (struct direction_limit){v3(0, 0, -1), 0.85, 0.15}, h, g);
    }
    return energy;
}

double body_prior_motion(const struct body_pose *pose, const struct body_pose *expected, double sigma, double *h,
                         double *g)
{
    double energy = 0, w = 1 / (ROOT_STEP_M * sigma * ROOT_STEP_M * sigma);
    struct vec3 off = v3_sub(expected->root, pose->root);
    double o[3] = {off.x, off.y, off.z};
    for (int k = 0; k < 3; k++) {
        energy += 0.5 * w * o[k] * o[k];
        if (h) {
            h[k * FIT_COUNT + k] += w;
            g[k] += w * o[k];
        }
    }
    for (int s = 0; s < SEG_COUNT; s++) {
        const struct rotation_target target = {expected->rotation[s], rotation_prior[s].step * sigma,
                                               rotation_prior[s].step_twist * sigma};
        energy += add_rotation_prior(s, pose->rotation[s], &target, h, g);
    }
    return energy;
}
