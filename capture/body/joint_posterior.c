#include "capture/body/joint_posterior.h"

// As in normal_equations.c: information that every unknown has beside the evidence, and the smallest pivot.
static const double DIAGONAL_MIN = 1e-3, PIVOT_MIN = 1e-9;

// The outermost segment whose rotations move the joint.
static const enum segment joint_segment[JOINT_COUNT] = {
    [JOINT_HEAD] = SEG_HEAD,
    [JOINT_NECK] = SEG_HEAD,
    [JOINT_LEFT_SHOULDER] = SEG_LEFT_CLAVICLE,
    [JOINT_LEFT_ELBOW] = SEG_LEFT_UPPER_ARM,
    [JOINT_LEFT_HAND] = SEG_LEFT_FOREARM,
    [JOINT_RIGHT_SHOULDER] = SEG_RIGHT_CLAVICLE,
    [JOINT_RIGHT_ELBOW] = SEG_RIGHT_UPPER_ARM,
    [JOINT_RIGHT_HAND] = SEG_RIGHT_FOREARM,
    [JOINT_TORSO] = SEG_CHEST,
    [JOINT_WAIST] = SEG_PELVIS,
    [JOINT_LEFT_HIP] = SEG_PELVIS,
    [JOINT_LEFT_KNEE] = SEG_LEFT_THIGH,
    [JOINT_LEFT_FOOT] = SEG_LEFT_SHIN,
    [JOINT_RIGHT_HIP] = SEG_PELVIS,
    [JOINT_RIGHT_KNEE] = SEG_RIGHT_THIGH,
    [JOINT_RIGHT_FOOT] = SEG_RIGHT_SHIN,
};

// The Cholesky factor of H with its unknowns in reverse, limbs from their ends inwards: no entry fills in then, and
// only unknowns of segments above or below each other have a common one (Featherstone, Rigid Body Dynamics
// Algorithms, 6.5).
struct pose_factor {
    double l[FIT_POSE_COUNT][FIT_POSE_COUNT];
};

static int segment_of(int row) // -1: the root's translation
{
    return (FIT_POSE_COUNT - 1 - row) / 3 - 1;
}

// The first row of each segment's outermost descendant; descendants are numbered without a gap.
static void find_first_rows(int first[SEG_COUNT + 1])
{
    int outermost[SEG_COUNT + 1]; // [s + 1] of segment s
    for (int s = -1; s < SEG_COUNT; s++)
        outermost[s + 1] = s;
    for (int s = SEG_COUNT - 1; s >= 0; s--) {
        const int up = body_parent((enum segment)s);
        if (outermost[s + 1] > outermost[up + 1])
            outermost[up + 1] = outermost[s + 1];
    }
    for (int s = -1; s < SEG_COUNT; s++)
        first[s + 1] = FIT_POSE_COUNT - 1 - (5 + 3 * outermost[s + 1]);
}

// False: not positive definite.
static bool factor(const struct pose_information *information, struct pose_factor *out)
{
    int first[SEG_COUNT + 1];
    find_first_rows(first);
    for (int i = 0; i < FIT_POSE_COUNT; i++) {
        const int from_i = first[segment_of(i) + 1], a = FIT_POSE_COUNT - 1 - i;
        for (int j = 0; j < from_i; j++)
            out->l[i][j] = 0;
        for (int j = from_i; j <= i; j++) {
            const int from_j = first[segment_of(j) + 1], from = from_i > from_j ? from_i : from_j;
            double sum = information->h[FIT_POSE_COUNT - 1 - j][a] + (i == j ? DIAGONAL_MIN : 0);
            for (int k = from; k < j; k++)
                sum -= out->l[i][k] * out->l[j][k];
            if (i == j && !(sum > PIVOT_MIN && isfinite(sum)))
                return false;
            out->l[i][j] = i == j ? sqrt(sum) : sum / out->l[j][j];
        }
    }
    return true;
}

enum { CHAIN_MAX = 3 + 3 * 6 }; // unknowns that move a joint: the root's and those of at most six segments

// A joint's derivative by the unknowns that move it, in the factor's order.
struct joint_jacobian {
    int count, row[CHAIN_MAX];
    struct vec3 by[CHAIN_MAX];
};

static void find_jacobian(const struct body_build *build, enum joint joint, struct joint_jacobian *out)
{
    out->count = 0;
    for (int s = joint_segment[joint]; s >= 0; s = body_parent((enum segment)s))
        for (int k = 2; k >= 0; k--) {
            const struct vec3 axis =
                v3(build->parent_axes[s][0][k], build->parent_axes[s][1][k], build->parent_axes[s][2][k]);
            out->row[out->count] = FIT_POSE_COUNT - 1 - (3 + 3 * s + k);
            out->by[out->count++] = v3_cross(axis, v3_sub(build->joint[joint], build->origin[s]));
        }
    for (int k = 2; k >= 0; k--) {
        out->row[out->count] = FIT_POSE_COUNT - 1 - k;
        out->by[out->count++] = v3(k == 0, k == 1, k == 2);
    }
}

// J H^-1 J' = Y' Y with L Y = J': nothing of Y outside the chain differs from 0.
static struct covariance3 joint_posterior(const struct pose_factor *factor, const struct joint_jacobian *jacobian)
{
    struct vec3 y[CHAIN_MAX];
    struct covariance3 sum = {0};
    for (int i = 0; i < jacobian->count; i++) {
        const double *l = factor->l[jacobian->row[i]];
        y[i] = jacobian->by[i];
        for (int k = 0; k < i; k++)
            y[i] = v3_sub(y[i], v3_scale(y[k], l[jacobian->row[k]]));
        y[i] = v3_scale(y[i], 1 / l[jacobian->row[i]]);
        const struct covariance3 term = covariance3_outer(y[i]);
        sum = covariance3_add(&sum, &term);
    }
    return sum;
}

bool find_joint_posteriors(const struct body_build *build, const struct pose_information *information,
                           struct covariance3 out[JOINT_COUNT])
{
    struct pose_factor f;
    if (!factor(information, &f))
        return false;
    for (int j = 0; j < JOINT_COUNT; j++) {
        struct joint_jacobian jacobian;
        find_jacobian(build, (enum joint)j, &jacobian);
        out[j] = joint_posterior(&f, &jacobian);
    }
    return true;
}
