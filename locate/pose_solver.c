#include "locate/pose_solver.h"

#include "base/linear_algebra.h"
#include "locate/pose_residuals.h"

#include <string.h>

// The problem at one state of the estimate; projection.motion is the velocity's.
struct linear_system {
    const struct pose_problem *problem;
    struct pnp_projection projection;
    struct corner_information information[PNP_MAX_TAGS];
};

// The prior of the velocity.
static void add_velocity_prior(struct pnp_equations *n, const struct shutter_motion *m)
{
    for (int i = 0; i < 6; i++)
        for (int j = 0; j < 6; j++) {
            double off_i = m->velocity[i] - m->expected[i], off_j = m->velocity[j] - m->expected[j];
            n->cost += off_i * m->information[i * 6 + j] * off_j;
            n->g[POSE_DOF + i] -= m->information[i * 6 + j] * off_j;
            n->a[(POSE_DOF + i) * n->size + POSE_DOF + j] += m->information[i * 6 + j];
        }
}

// The information of the corners is computed once, at the starting pose.
static void init_system(const struct pose_problem *problem, const struct pose *camera_from_world,
                        struct linear_system *all)
{
    all->problem = problem;
    all->projection = (struct pnp_projection){problem->fx, problem->fy, problem->motion};
    for (int i = 0; i < problem->tag_count; i++)
        pnp_corner_information(&problem->tags[i], problem->tag_px, camera_from_world, &all->projection,
                               &all->information[i]);
}

static void build_normal_equations(const struct linear_system *all, const struct pose *camera_from_world,
                                   struct pnp_equations *n)
{
    const struct pose_problem *problem = all->problem;
    const struct shutter_motion *motion = all->projection.motion;
    // Beside corners of little weight, depth would bend the pose at will.
    const bool with_depth = problem->tag_px == 0;
    memset(n, 0, sizeof *n);
    n->size = motion ? POSE_VELOCITY_DOF : POSE_DOF;
    if (motion)
        add_velocity_prior(n, motion);
    for (int i = 0; i < problem->tag_count; i++)
        if (problem->tags[i].used)
            n->cost += pnp_add_tag(n, &problem->tags[i], &all->information[i], &all->projection, camera_from_world,
                                   with_depth);
    for (int i = 0; i < problem->point_count; i++)
        n->cost += pnp_add_point(n, &problem->points[i], problem->point_px, &all->projection, camera_from_world);
}

static void apply_step(struct pose *p, struct shutter_motion *motion, const double d[POSE_VELOCITY_DOF])
{
    for (int i = 0; i < 6 && motion; i++)
        motion->velocity[i] += d[POSE_DOF + i];
    struct pose small = {quat_from_rotation_vector(v3(d[0], d[1], d[2])), {d[3], d[4], d[5]}};
    *p = pose_multiply(small, *p);
}

double pnp_refine(const struct pose_problem *problem, struct pose *pose)
{
    struct shutter_motion next_motion, *motion = problem->motion;
    struct linear_system all;
    struct pnp_equations n, after;
    double damping = 1e-6;
    init_system(problem, pose, &all);
    build_normal_equations(&all, pose, &n);
    for (int round = 0; round < 20; round++) {
        double a[POSE_VELOCITY_DOF * POSE_VELOCITY_DOF], d[POSE_VELOCITY_DOF];
        memcpy(a, n.a, sizeof a);
        memcpy(d, n.g, sizeof d);
        for (int i = 0; i < n.size; i++)
            a[i * n.size + i] *= 1 + damping;
        if (!cholesky_factor(a, n.size))
            break;
        cholesky_solve(a, n.size, d);
        struct pose next = *pose;
        if (motion) {
            next_motion = *motion;
            all.projection.motion = &next_motion;
        }
        apply_step(&next, motion ? &next_motion : NULL, d);
        if (!pose_finite(next))
            break;
        build_normal_equations(&all, &next, &after);
        if (!(after.cost < n.cost)) {
            damping = fmax(damping * 10, 1e-4);
            if (damping > 1e4)
                break;
            continue;
        }
        bool converged = n.cost - after.cost < 1e-7 * (1 + n.cost);
        *pose = next;
        if (motion)
            *motion = next_motion;
        n = after;
        damping *= 0.1;
        if (converged)
            break;
    }
    return n.cost;
}

// The normal equations at the solution, both triangles.
static void final_normal_equations(const struct pose_problem *problem, const struct pose *camera_from_world,
                                   struct pnp_equations *n)
{
    struct pose_problem exact = *problem;
    struct linear_system all;
    exact.tag_px = exact.point_px = 0;
    init_system(&exact, camera_from_world, &all);
    build_normal_equations(&all, camera_from_world, n);
    for (int i = 0; i < n->size; i++)
        for (int j = 0; j < i; j++)
            n->a[j * n->size + i] = n->a[i * n->size + j];
}

// Of the pose, the velocity marginalised: its prior always leaves it finite.
static void pose_information(const struct pnp_equations *n, double out[36])
{
    if (n->size == POSE_DOF)
        memcpy(out, n->a, 36 * sizeof *out);
    else if (!marginal_information(n->a, 6, false, out))
        memset(out, 0, 36 * sizeof *out);
}

void pnp_update_velocity_prior(const struct pose_problem *problem, const struct pose *camera_from_world)
{
    struct pnp_equations n;
    struct shutter_motion *motion = problem->motion;
    double information[36];
    final_normal_equations(problem, camera_from_world, &n);
    if (!marginal_information(n.a, 6, true, information))
        return;
    for (int i = 0; i < 36; i++) // symmetric
        motion->information[i] = (information[i] + information[i % 6 * 6 + i / 6]) / 2;
    memcpy(motion->expected, motion->velocity, sizeof motion->expected);
}

void pnp_information(const struct pose_problem *problem, const struct pose *camera_from_world, double information[36])
{
    struct pnp_equations n;
    final_normal_equations(problem, camera_from_world, &n);
    pose_information(&n, information);
}

// What normally distributed errors cost: how many numbers are observed, the mean of their robust cost and its
// variance.
struct cost_statistics {
    double numbers, cost, variance;
};

static void add_expected_cost(struct cost_statistics *all, double times, struct cost_statistics one)
{
    all->numbers += times * one.numbers;
    all->cost += times * one.cost;
    all->variance += times * one.variance;
}

bool pnp_covariance(const struct pose_problem *problem, const struct pose *camera_from_world, double covariance[36])
{
    // Of one depth sample, a point, a point with depth, a tag: mean and variance of b ln(1 + x / b) where x is chi
    // squared with k degrees of freedom, that is
    //     m = integral over x > 0 of b ln(1 + x / b) x^(k/2 - 1) e^(-x/2) / (2^(k/2) Gamma(k/2)) dx
    // and the same of the square, less m^2. Numerically, with c = CAUCHY_SCALE: k = 1, 2, 3 with b = c^2, k = 8 with
    // b = 8 c^2.
    static const struct cost_statistics DEPTH_SAMPLE = {1, 0.874, 1.222}, POINT = {2, 1.680, 2.112},
                                        DEEP_POINT = {3, 2.426, 2.760}, TAG = {8, 7.499, 12.42};
    const struct pnp_tag *tags = problem->tags;
    struct pnp_equations n;
    double information[36];
    struct cost_statistics all = {0};
    for (int i = 0; i < problem->tag_count; i++) {
        add_expected_cost(&all, tags[i].used, TAG);
        if (tags[i].used && tags[i].depth)
            add_expected_cost(&all, tags[i].depth->share * tags[i].depth->count, DEPTH_SAMPLE);
    }
    for (int i = 0; i < problem->point_count; i++)
        add_expected_cost(&all, 1, problem->points[i].z > 0 ? DEEP_POINT : POINT);
    final_normal_equations(problem, camera_from_world, &n);
    pose_information(&n, information);
    if (!invert_symmetric(information, 6, covariance))
        return false;
    // The residuals' cost against its mean plus one standard deviation, which chance exceeds in one case of six. The
    // pose itself takes up six numbers.
    double left = fmax(1, all.numbers - 6) / fmax(1, all.numbers);
    double grow = fmax(1, n.cost / (left * all.cost + sqrt(left * all.variance)));
    for (int i = 0; i < 36; i++)
        covariance[i] *= grow;
    return true;
}
