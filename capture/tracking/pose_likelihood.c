#include "capture/tracking/pose_likelihood.h"

#include "capture/tracking/occluded_shin.h"

// Chosen by hand; test_pose_likelihood measures the outcome.
#define DISTINCT_M  0.04       // two poses of a limb nearer than this are the same
#define PRIOR_SIGMA 2          // expected_sigma (body_fit.h) of the other pose in its refit
enum { REFIT_ITERATIONS = 8 }; // to adapt a pose that was fitted with another shape

// Energy of the body `on` with the limbs of the bit set `transferred` where `from` has them.
static double energy_with(const struct fit_task *task, const struct body_pose *on, const struct body_build *from,
                          unsigned transferred, struct fit_scratch *scratch)
{
    struct body_pose pose = *on;
    for (int k = 0; k < LIMB_COUNT; k++)
        if (transferred & 1u << k)
            limb_transfer(k, &task->shape.mean, from, &pose);
    body_evaluate(task, &pose, &task->shape.mean, &scratch->other);
    return scratch->other.energy;
}

// A pair of limbs, `first` and the next; the poses differ in those of the bit set `apart`. Legs may be exchanged, so
// that exchanging one alone would put both in one place: all combinations are evaluated, each on both bodies.
// scratch->trial is the other pose.
static void compare_pair(const struct fit_task *task, const struct body_pose *own, int first, unsigned apart,
                         struct fit_scratch *scratch, double against[2][2])
{
    const struct body_pose other = scratch->trial.pose;
    struct body_build here, there;
    body_forward_kinematics(&task->shape.mean, own, &here);
    body_forward_kinematics(&task->shape.mean, &other, &there);
    for (int i = 0; i < 4; i++) {
        unsigned taken = (unsigned)i << first & apart, left = apart & ~taken;
        double *energy = &against[i & 1][i >> 1];
        *energy =
            0.5 * (energy_with(task, own, &there, taken, scratch) + energy_with(task, &other, &here, left, scratch));
        for (int k = first; first >= FIRST_LEG && k < first + 2; k++)
            *energy += shin_outside_log_odds(task, k, taken & 1u << k ? &there : &here);
    }
    for (int i = 3; i >= 0; i--)
        against[i & 1][i >> 1] -= against[0][0];
}

struct pose_log_odds pose_compare(const struct fit_task *given, const struct body_pose *own,
                                  const struct body_pose *other, struct fit_scratch *scratch)
{
    struct pose_log_odds odds = {0};
    struct fit_task task = *given;
    struct body_build here, there;
    unsigned apart = 0;
    body_forward_kinematics(&task.shape.mean, own, &here);
    body_forward_kinematics(&task.shape.mean, other, &there);
    for (int k = 0; k < LIMB_COUNT; k++)
        if (limb_moved_m(k, &here, &there) > DISTINCT_M)
            apart |= 1u << k;
    if (!apart)
        return odds;
    task.expected = *other;
    task.expected_sigma = PRIOR_SIGMA;
    task.iterations = REFIT_ITERATIONS;
    body_fit(&task, other, &scratch->trial); // a fit is compared with a fit
    odds.whole_body = scratch->trial.energy - energy_with(&task, own, &here, 0, scratch);
    for (int first = 0; first < LIMB_COUNT; first += 2)
        if (apart & 3u << first)
            compare_pair(&task, own, first, apart & 3u << first, scratch, odds.pair[first / 2]);
    return odds;
}
