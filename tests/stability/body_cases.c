// The body model's fit: folded and stretched limbs, unconstrained normal equations, covariances, the pose filter.
#include "base/linear_algebra.h"
#include "capture/body/body_prior.h"
#include "capture/body/joint_posterior.h"
#include "capture/body/normal_equations.h"
#include "capture/body/pose_filter.h"
#include "capture/body/solid_distance.h"
#include "capture/body/two_bone_ik.h"
#include "capture/tracking/joint_covariance.h"
#include "capture/tracking/joint_error.h"
#include "tests/stability/stability.h"

#include <stdlib.h>
#include <string.h>

static const struct body_shape average = {{0}, 0, 0};

static struct body_pose standing(void) { return body_standing_pose(v3(0, 0, 2.5), v3(0, -1, 0), 0); }

static bool pose_is_finite(const struct body_pose *pose)
{
    bool finite = v3_finite(pose->root);
    for (int s = 0; s < SEG_COUNT; s++) {
        const struct quat q = pose->rotation[s];
        finite = finite && isfinite(q.x + q.y + q.z + q.w);
    }
    return finite;
}

// in: target from the shoulder, in lengths of the arm along x, y, z; the pole along x, y, z -> how far the wrist ends
// from the target, in lengths of the arm beyond what the arm can reach.
static struct answer ask_reach(const double *in)
{
    struct body_pose pose = standing();
    struct body_build build;
    body_forward_kinematics(&average, &pose, &build);
    const struct vec3 root = build.origin[SEG_LEFT_UPPER_ARM];
    const double upper = v3_distance(root, build.origin[SEG_LEFT_FOREARM]),
                 lower = v3_distance(build.origin[SEG_LEFT_FOREARM], build.origin[SEG_LEFT_HAND]), arm = upper + lower;
    const struct vec3 to = v3_scale(v3(in[0], in[1], in[2]), arm);
    two_bone_ik(&average, &pose, SEG_LEFT_UPPER_ARM, v3_add(root, to), v3(in[3], in[4], in[5]));
    if (!pose_is_finite(&pose))
        return answer_of(ANSWER_UNKNOWN);
    body_forward_kinematics(&average, &pose, &build);
    const double d = v3_length(to), reach = fmin(fmax(d, fabs(upper - lower)), arm);
    const struct vec3 nearest = d > 0 ? v3_add(root, v3_scale(to, reach / d)) : root;
    const double off = v3_distance(build.origin[SEG_LEFT_HAND], nearest);
    return answer_value(fmax(0, off - (d > 0 ? 0 : fabs(upper - lower)) - 0.021)); // its slack when folded
}

// in: as ask_reach -> how far the wrist moves.
static struct answer ask_stays(const double *in)
{
    struct body_pose pose = standing();
    struct body_build before, after;
    body_forward_kinematics(&average, &pose, &before);
    two_bone_ik(&average, &pose, SEG_LEFT_UPPER_ARM, v3_add(before.origin[SEG_LEFT_UPPER_ARM], v3(in[0], in[1], in[2])),
                v3(in[3], in[4], in[5]));
    body_forward_kinematics(&average, &pose, &after);
    return answer_value(v3_distance(before.origin[SEG_LEFT_HAND], after.origin[SEG_LEFT_HAND]));
}

// The elbow's angle by the law of cosines.
static struct answer elbow_by_cosines(const double *in)
{
    const double d = sqrt(in[0] * in[0] + in[1] * in[1] + in[2] * in[2]), lengths[3] = {0.54, 0.46, d};
    double angle;
    plain_elbow.in_double(lengths, &angle);
    return answer_value(angle);
}

// in: direction -> how far the upper arm then points beside it.
static struct answer ask_aim(const double *in)
{
    struct body_pose pose = standing();
    struct body_build build;
    body_aim_segment(&average, &pose, SEG_LEFT_UPPER_ARM, v3(in[0], in[1], in[2]));
    if (!pose_is_finite(&pose))
        return answer_of(ANSWER_UNKNOWN);
    body_forward_kinematics(&average, &pose, &build);
    const struct vec3 now = v3_unit(v3_sub(build.origin[SEG_LEFT_FOREARM], build.origin[SEG_LEFT_UPPER_ARM]));
    return answer_value(v3_distance(now, v3_unit(v3(in[0], in[1], in[2]))));
}

static struct answer aim_by_cross(const double *in)
{
    const double from[6] = {0, 1, 0, in[0], in[1], in[2]}; // it hangs: y down
    double turned[3];
    plain_turn_between.in_double(from, turned);
    return answer_value(v3_distance(v3(turned[0], turned[1], turned[2]), v3_unit(v3(in[0], in[1], in[2]))));
}

// in: up -> what a standing person's head is above the waist, along up.
static struct answer ask_standing(const double *in)
{
    const struct vec3 up = v3(in[0], in[1], in[2]);
    const struct body_pose pose = body_standing_pose(v3(0, 0, 2.5), up, in[3]);
    struct body_build build;
    body_forward_kinematics(&average, &pose, &build);
    const double above = v3_dot(v3_sub(build.joint[JOINT_HEAD], build.joint[JOINT_WAIST]), up);
    return isfinite(above) ? answer_value(above > 0.5) : answer_of(ANSWER_UNKNOWN);
}

// The axes by cross products with the view, as they come.
static struct answer standing_by_cross(const double *in)
{
    const struct vec3 up = v3(in[0], in[1], in[2]);
    struct vec3 ahead = v3_sub(v3(0, 0, -1), v3_scale(up, v3_dot(up, v3(0, 0, -1))));
    ahead = v3_scale(ahead, 1 / v3_length(ahead));
    return answer_value(v3_length(ahead) > 0.5);
}

// One residual of weight in[0], size in[1], on the left hand; all other limbs have none -> the step of the right hand.
static struct answer ask_unconstrained(const double *in)
{
    static struct normal_equations n;
    const struct body_pose pose = standing();
    struct body_build build;
    double x[FIT_COUNT];
    body_forward_kinematics(&average, &pose, &build);
    normal_equations_reset(&n, false);
    const struct point_residual r = {.segment = SEG_LEFT_HAND,
                                     .point = build.origin[SEG_LEFT_HAND],
                                     .normal = v3(0, 0, 1),
                                     .residual = in[1],
                                     .weight = in[0]};
    normal_equations_add(&n, &build, &r);
    normal_equations_assemble(&n, &build);
    if (!normal_equations_solve(&n, 0, x))
        return answer_of(ANSWER_UNKNOWN);
    double step = 0;
    for (int k = 0; k < 3; k++)
        step = fmax(step, fabs(x[3 + 3 * SEG_RIGHT_HAND + k]));
    for (int k = 0; k < FIT_POSE_COUNT; k++)
        if (!isfinite(x[k]))
            step = NAN;
    return answer_value(step);
}

// One unknown: information 0, right-hand side 0.
static struct answer nothing_by_nothing(const double *in)
{
    double h = in[0] * 0, g = in[0] * in[1] * 0;
    gauss_solve(&h, 1, &g);
    return answer_value(g);
}

// The standard deviation of a joint of which nothing is known: in[0] is every limb's information.
static struct answer ask_posterior(const double *in)
{
    static struct pose_information information;
    const struct body_pose pose = standing();
    struct body_build build;
    struct covariance3 joint[JOINT_COUNT];
    body_forward_kinematics(&average, &pose, &build);
    memset(&information, 0, sizeof information);
    for (int i = 0; i < FIT_POSE_COUNT; i++)
        information.h[i][i] = in[0];
    if (!find_joint_posteriors(&build, &information, joint))
        return answer_of(ANSWER_UNKNOWN);
    const double sigma = sqrt(covariance3_trace(&joint[JOINT_LEFT_HAND]) / 3);
    return sigma <= KNOWN_SIGMA_MAX_M ? answer_value(sigma) : answer_of(ANSWER_UNKNOWN);
}

static struct answer sigma_of_a_seen_joint(const double *in) { return answer_value(in[0] > 0 ? sqrt(1 / in[0]) : 0); }

// in: sigma, seen -> the confidence of a joint; 0 is unknown.
static struct answer ask_confidence(const double *in)
{
    const float c = confidence_of(in[0], in[1] > 0);
    return c > 0 ? answer_value((double)c) : answer_of(ANSWER_UNKNOWN);
}

static struct answer seen_is_sure(const double *in) { return answer_value(in[1] > 0 ? 1 : 0.5); }

// in: as plain_variance_along; packed into half floats and back -> the least variance.
static struct answer ask_packed(const double *in)
{
    const struct vec3 u = v3(0.6, 0.8, 0), v = v3(-0.8, 0.6, 0);
    const struct covariance3 along = covariance3_outer(u), across = covariance3_outer(v);
    const struct covariance3 a = covariance3_scale(&along, in[0] * in[0]),
                             b = covariance3_scale(&across, in[1] * in[1]);
    const struct covariance3 sum = covariance3_add(&a, &b), back = covariance_unpack(covariance_pack(&sum));
    return answer_value(back.xx * back.yy - back.xy * back.xy >= 0 &&
                        fabs(covariance3_along(&back, u) - in[0] * in[0]) < 2e-3 * in[0] * in[0]);
}

// Its elements in half floats, each for itself.
static struct answer packed_elements(const double *in)
{
    const double a2 = in[0] * in[0], b2 = in[1] * in[1];
    const double xx = half_to_double(half_from_double(0.36 * a2 + 0.64 * b2)),
                 xy = half_to_double(half_from_double(0.48 * (a2 - b2))),
                 yy = half_to_double(half_from_double(0.64 * a2 + 0.36 * b2));
    return answer_value(xx * yy - xy * xy >= 0 && fabs(0.36 * xx + 0.96 * xy + 0.64 * yy - a2) < 2e-3 * a2);
}

static struct answer ask_half(const double *in) { return answer_value(half_to_double(half_from_double(in[0]))); }

// The bits cut off, the exponent as it is.
static struct answer half_by_shifting(const double *in)
{
    const float single = (float)in[0];
    uint32_t bits;
    memcpy(&bits, &single, sizeof bits);
    return answer_value(
        half_to_double((uint16_t)((((bits >> 23 & 255) - 112) << 10 | (bits & 0x7fffff) >> 13) & 0x7fff)));
}

// A solid whose axis has no length, and a point at its very middle: in: length, distance of the point.
static struct answer ask_solid(const double *in)
{
    const struct body_solid ball = {.segment = SEG_CHEST,
                                    .a = v3(0, 0, 2),
                                    .b = v3(0, in[0], 2),
                                    .side = v3(1, 0, 0),
                                    .radius_a = 0.1,
                                    .radius_b = 0.1};
    struct vec3 normal;
    const double d = solid_distance(&ball, v3(0, 0, 2 - in[1]), &normal);
    return v3_finite(normal) ? answer_values((double[]){d, v3_length(normal)}, 2) : answer_of(ANSWER_UNKNOWN);
}

static struct answer solid_by_projection(const double *in)
{
    const struct vec3 axis = v3(0, in[0], 0), off = v3(0, 0, -in[1]);
    const double t = v3_dot(off, axis) / v3_dot(axis, axis);
    const struct vec3 from = v3_sub(off, v3_scale(axis, t));
    const double length = v3_length(from);
    return answer_values((double[]){length - 0.1, v3_length(v3_scale(from, 1 / length))}, 2);
}

// in: seconds between fits, jump of the fit along x -> the filtered waist.
static struct answer ask_filter(const double *in)
{
    struct pose_filter f;
    struct body_pose pose = standing();
    pose_filter_start(&f, &average, &pose);
    pose.root.x += in[1];
    pose_filter_update(&f, &average, &pose, in[0]);
    return pose_is_finite(&f.pose) ? answer_value(f.pose.root.x >= 0 && f.pose.root.x <= in[1] + 1e-9)
                                   : answer_of(ANSWER_UNKNOWN);
}

static struct answer speed_times_time(const double *in)
{
    const double speed = in[1] / in[0];
    return answer_value(speed * in[0] >= 0 && isfinite(speed)); // infinite times nothing
}

static struct answer ask_growth(const double *in)
{
    const struct covariance3 known = covariance3_isotropic(in[1] * in[1]);
    const struct joint_error e = {.log_widening = (float)in[0], .log_scale = (float)in[0]};
    const double factor = joint_error_factor(&e, &known), sigma = in[1] * sqrt(factor);
    return answer_value(isfinite(sigma) && sigma <= KNOWN_SIGMA_MAX_M + 1e-9);
}

static struct answer growth_as_it_comes(const double *in)
{
    return answer_value(in[1] * exp(in[0] / 2) <= KNOWN_SIGMA_MAX_M);
}

static const struct stability_case cases[] = {
    {"wrist to where the shoulder is", "never folds completely", ANSWER_VALUE, ask_reach, NULL, elbow_by_cosines,
     .in = {0, 0, 0, 0, 0, 1}, .exact = {0}, .exact_count = 1, .tolerance = 0.01, .unit = "m"},
    {"wrist to twice the arm's length", "never stretches completely", ANSWER_VALUE, ask_reach, NULL, elbow_by_cosines,
     .in = {0, 2, 0, 0, 0, 1}, .exact = {0}, .exact_count = 1, .tolerance = 0.01, .unit = "m"},
    {"wrist to the arm's very length", "never stretches completely", ANSWER_VALUE, ask_reach, NULL, elbow_by_cosines,
     .in = {0, 0, -1, 0, 1, 0}, .exact = {0}, .exact_count = 1, .tolerance = 0.01, .unit = "m"},
    {"wrist ahead, elbow towards the wrist", "a pole along the limb has no say", ANSWER_VALUE, ask_reach, NULL,
     elbow_by_cosines, .in = {0, 0, -0.7, 0, 0, -1}, .exact = {0}, .exact_count = 1, .tolerance = 0.4, .unit = "m"},
    {"wrist to a point that is NaN", "the limb stays as it is", ANSWER_VALUE, ask_stays, NULL, elbow_by_cosines,
     .in = {NAN, 0, 0, 0, 0, 1}, .exact = {0}, .exact_count = 1, .unit = "m"},
    {"wrist ahead, elbow towards NaN", "the limb stays as it is", ANSWER_VALUE, ask_stays, NULL, elbow_by_cosines,
     .in = {0, 0, -0.5, 0, NAN, 0}, .exact = {0}, .exact_count = 1, .unit = "m"},
    {"arm to the opposite of where it points", "half a turn about any axis", ANSWER_VALUE, ask_aim, NULL, aim_by_cross,
     .in = {0, -1, 0}, .exact = {0}, .exact_count = 1, .tolerance = 3e-6, .unit = "rad"},
    {"arm to where it points", "1 + cosine", ANSWER_VALUE, ask_aim, NULL, aim_by_cross, .in = {0, 1, 0}, .exact = {0},
     .exact_count = 1, .tolerance = 1e-12, .unit = "rad"},
    {"person seen straight from above", "any direction ahead", ANSWER_VALUE, ask_standing, NULL, standing_by_cross,
     .in = {0, 0, -1, 0}, .exact = {1}, .exact_count = 1},
    {"step of a limb that nothing constrains", "least information", ANSWER_VALUE, ask_unconstrained, NULL,
     nothing_by_nothing, .in = {1e6, 0.01}, .exact = {0}, .exact_count = 1, .unit = "rad"},
    {"step of a body that nothing constrains", "least information", ANSWER_VALUE, ask_unconstrained, NULL,
     nothing_by_nothing, .in = {0, 0}, .exact = {0}, .exact_count = 1, .unit = "rad"},
    {"step by a residual that is NaN", "finite pivots and steps", ANSWER_UNKNOWN, ask_unconstrained, NULL,
     nothing_by_nothing, .in = {1e6, NAN}, .unit = "rad"},
    {"step by a weight that is NaN", "finite pivots and steps", ANSWER_UNKNOWN, ask_unconstrained, NULL,
     nothing_by_nothing, .in = {NAN, 0.01}, .unit = "rad"},
    {"step by an infinite weight", "finite pivots and steps", ANSWER_UNKNOWN, ask_unconstrained, NULL,
     nothing_by_nothing, .in = {INFINITY, 0.01}, .unit = "rad"},
    {"where a hand is that nothing determines", "30 m is not known", ANSWER_UNKNOWN, ask_posterior, NULL,
     sigma_of_a_seen_joint, .in = {0}, .unit = "m"},
    {"where a hand is with information of NaN", "Cholesky's pivots", ANSWER_UNKNOWN, ask_posterior, NULL,
     sigma_of_a_seen_joint, .in = {NAN}, .unit = "m"},
    {"where a hand is with information below 0", "Cholesky's pivots", ANSWER_UNKNOWN, ask_posterior, NULL,
     sigma_of_a_seen_joint, .in = {-1}, .unit = "m"},
    {"confidence of a joint unsure by 1 m", "a bound on sigma", ANSWER_UNKNOWN, ask_confidence, NULL, seen_is_sure,
     .in = {1, 1}},
    {"confidence of a joint infinitely unsure", "a bound on sigma", ANSWER_UNKNOWN, ask_confidence, NULL, seen_is_sure,
     .in = {INFINITY, 1}},
    {"covariance of 0.9 m along, 0.3 mm across, stored", "Cholesky factor in half floats", ANSWER_VALUE, ask_packed,
     NULL, packed_elements, .in = {0.9, 0.0003}, .exact = {1}, .exact_count = 1},
    {"covariance of 1 mm and 0.1 mm, stored", "Cholesky factor in half floats", ANSWER_VALUE, ask_packed, NULL,
     packed_elements, .in = {0.001, 0.0001}, .exact = {1}, .exact_count = 1},
    {"half float of 1e-6", "denormal half floats", ANSWER_VALUE, ask_half, NULL, half_by_shifting, .in = {1e-6},
     .exact = {1e-6}, .exact_count = 1, .tolerance = 3e-8},
    {"half float of 1e9", "the largest one", ANSWER_VALUE, ask_half, NULL, half_by_shifting, .in = {1e9},
     .exact = {65504}, .exact_count = 1},
    {"half float of 1.0017", "rounded to nearest", ANSWER_VALUE, ask_half, NULL, half_by_shifting, .in = {1.0017},
     .exact = {1.0017}, .exact_count = 1, .tolerance = 4.9e-4},
    {"distance of a solid without length", "1 / length only where there is one", ANSWER_VALUE, ask_solid, NULL,
     solid_by_projection, .in = {0, 0.5}, .exact = {0.4, 1}, .exact_count = 2, .tolerance = 1e-12, .unit = "m"},
    {"distance of a point in a solid's very middle", "along the ray behind the middle", ANSWER_VALUE, ask_solid, NULL,
     solid_by_projection, .in = {0.3, 0}, .exact = {-0.1, 1}, .exact_count = 2, .tolerance = 1e-9, .unit = "m"},
    {"filter of two fits at one instant", "gains in 0..1", ANSWER_VALUE, ask_filter, NULL, speed_times_time,
     .in = {0, 0.5}, .exact = {1}, .exact_count = 1},
    {"a known joint whose error grows a million times", "a known joint stays known", ANSWER_VALUE, ask_growth, NULL,
     growth_as_it_comes, .in = {13.8, 0.05}, .exact = {1}, .exact_count = 1},
};
const struct stability_stage stability_body = {"skeleton", cases, COUNT_OF(cases)};
