#include "capture/tracking/joint_covariance.h"

#include "base/portable_math.h"

// Standard deviations in metres, rates in m^2/s, per axis. hidden_m: how far a joint that is not seen may be from where
// it is thought, however long. Chosen by hand: about 2 cm of error a joint on rendered people (docs/results.md), and
// the reach of each joint from the one it hangs on.
struct joint_kind {
    double floor_across_m, floor_along_m, hidden_m, hidden_rate;
};

#define KIND(across, along, hidden, rate)                                                                              \
    {                                                                                                                  \
        across, along, hidden, rate                                                                                    \
    }
static const struct joint_kind joint_kind[JOINT_COUNT] = {
    [JOINT_HEAD] = KIND(0.015, 0.020, 0.08, 0.005),          [JOINT_NECK] = KIND(0.015, 0.020, 0.06, 0.002),
    [JOINT_LEFT_SHOULDER] = KIND(0.018, 0.022, 0.07, 0.003), [JOINT_RIGHT_SHOULDER] = KIND(0.018, 0.022, 0.07, 0.003),
    [JOINT_LEFT_ELBOW] = KIND(0.018, 0.022, 0.13, 0.015),    [JOINT_RIGHT_ELBOW] = KIND(0.018, 0.022, 0.13, 0.015),
    [JOINT_LEFT_HAND] = KIND(0.015, 0.020, 0.22, 0.040),     [JOINT_RIGHT_HAND] = KIND(0.015, 0.020, 0.22, 0.040),
    [JOINT_TORSO] = KIND(0.015, 0.022, 0.05, 0.002),         [JOINT_WAIST] = KIND(0.018, 0.025, 0.05, 0.002),
    [JOINT_LEFT_HIP] = KIND(0.020, 0.025, 0.06, 0.002),      [JOINT_RIGHT_HIP] = KIND(0.020, 0.025, 0.06, 0.002),
    [JOINT_LEFT_KNEE] = KIND(0.018, 0.022, 0.12, 0.015),     [JOINT_RIGHT_KNEE] = KIND(0.018, 0.022, 0.12, 0.015),
    [JOINT_LEFT_FOOT] = KIND(0.018, 0.022, 0.20, 0.030),     [JOINT_RIGHT_FOOT] = KIND(0.018, 0.022, 0.20, 0.030),
};
#undef KIND

// After a second outside the image a joint is not known any more (KNOWN_SIGMA_MAX_M), nor is one that was never seen.
static const double ABSENT_RATE = KNOWN_SIGMA_MAX_M * KNOWN_SIGMA_MAX_M, ABSENT_MAX_M2 = 1;
static const double NEVER_SEEN_M2 = 1.2 * KNOWN_SIGMA_MAX_M * KNOWN_SIGMA_MAX_M;

// The point's error along the ray through it and across.
static struct covariance3 along_and_across(struct vec3 position, double along_m, double across_m)
{
    const struct covariance3 across = covariance3_isotropic(across_m * across_m),
                             ray = covariance3_outer(v3_unit(position)),
                             more = covariance3_scale(&ray, along_m * along_m - across_m * across_m);
    return covariance3_add(&across, &more);
}

struct joint_uncertainty_terms joint_uncertainty(enum joint joint, struct vec3 position, const struct covariance3 *fit,
                                                 const struct joint_sight *sight)
{
    const struct joint_kind *kind = &joint_kind[joint];
    const double max_m2 = kind->hidden_m * kind->hidden_m;
    struct joint_uncertainty_terms terms = {
        .scale = 1, .fit = *fit, .floor = along_and_across(position, kind->floor_along_m, kind->floor_across_m)};
    terms.hidden_m2 = max_m2 * (1 - portable_exp(-kind->hidden_rate * sight->hidden_s / max_m2));
    terms.absent_m2 = sight->seen_ever ? fmin(ABSENT_MAX_M2, ABSENT_RATE * sight->out_of_image_s) : NEVER_SEEN_M2;
    return terms;
}

struct covariance3 joint_uncertainty_sum(const struct joint_uncertainty_terms *terms)
{
    const struct covariance3 away = covariance3_isotropic(terms->hidden_m2 + terms->absent_m2),
                             seen = covariance3_add(&terms->fit, &terms->floor);
    const struct covariance3 all = covariance3_add(&seen, &away);
    return covariance3_scale(&all, terms->scale);
}

struct covariance3 joint_merge_covariance(const struct covariance3 *a, const struct covariance3 *b,
                                          struct vec3 disagreement, double share)
{
    const struct covariance3 of_a = covariance3_scale(a, 1 - share), of_b = covariance3_scale(b, share),
                             both = covariance3_add(&of_a, &of_b), squared = covariance3_outer(disagreement),
                             apart = covariance3_scale(&squared, 2 * share * (1 - share));
    return covariance3_add(&both, &apart);
}
