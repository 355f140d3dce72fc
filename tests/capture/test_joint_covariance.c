// Covariances of tracked joints: the posterior is the scatter of refits under noise, nothing makes it indefinite,
// hidden joints are known ever less, and on rendered frames errors are of the stated size.
#include "tests/support/test.h"

#include "capture/body/joint_posterior.h"
#include "capture/body/normal_equations.h"
#include "capture/tracking/joint_covariance.h"
#include "tests/support/random.h"
#include "tests/support/tracked_film.h"

#include <stdio.h>
#include <string.h>

enum { SEED = 20261125, RESIDUALS = 400, REFITS = 3000 };

// Between every two of these directions the variances must agree; a covariance has six numbers.
static const struct vec3 directions[] = {
    {1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {0.6, 0.8, 0}, {0, -0.6, 0.8}, {0.8, 0, -0.6}, {0.577, 0.577, 0.577}};

static struct body_pose random_pose(struct rng *rng)
{
    struct body_pose pose = {.root = v3(0.2, -0.1, 2.5)};
    for (int s = 0; s < SEG_COUNT; s++)
        pose.rotation[s] = quat_from_rotation_vector(rng_normal3(rng, 0.5));
    return pose;
}

static struct body_pose move_pose(const struct body_pose *pose, const double x[FIT_COUNT])
{
    struct body_pose out = *pose;
    out.root = v3_add(out.root, v3(x[0], x[1], x[2]));
    for (int s = 0; s < SEG_COUNT; s++) {
        struct quat turn = quat_from_rotation_vector(v3(x[3 + 3 * s], x[4 + 3 * s], x[5 + 3 * s]));
        out.rotation[s] = quat_multiply(turn, pose->rotation[s]);
    }
    return out;
}

// Residuals of 1 mm on random points of all segments but `unseen`, and a prior of 0.01 on every unknown.
struct refit {
    struct body_build build;
    struct point_residual residual[RESIDUALS];
    double prior; // information
};

static void make_refit(struct refit *r, const struct body_pose *pose, int unseen, struct rng *rng)
{
    const struct body_shape shape = {{0}, 0, 0};
    body_forward_kinematics(&shape, pose, &r->build);
    r->prior = 1e4;
    for (int i = 0; i < RESIDUALS; i++) {
        const enum segment s = (enum segment)(i % SEG_COUNT);
        const struct vec3 beside = rng_within(rng, v3(0.2, 0.2, 0.2)), normal = v3_unit(rng_normal3(rng, 1));
        r->residual[i] = (struct point_residual){.segment = s,
                                                 .point = v3_add(r->build.origin[s], beside),
                                                 .normal = normal,
                                                 .weight = (int)s == unseen ? 0 : 1e6};
    }
}

// One fit with noise of the stated variances; the truth is 0.
static void solve_refit(struct refit *r, struct rng *rng, struct normal_equations *system, double x[FIT_COUNT])
{
    normal_equations_reset(system, false);
    for (int i = 0; i < RESIDUALS; i++) {
        const double weight = r->residual[i].weight;
        r->residual[i].residual = weight > 0 ? rng_normal(rng) / sqrt(weight) : 0;
        normal_equations_add(system, &r->build, &r->residual[i]);
    }
    normal_equations_assemble(system, &r->build);
    for (int i = 0; i < FIT_POSE_COUNT; i++) {
        system->h[i][i] += r->prior;
        system->g[i] += sqrt(r->prior) * rng_normal(rng);
    }
    EXPECT_TRUE(normal_equations_solve(system, 0, x));
}

static void copy_information(const struct normal_equations *system, struct pose_information *out)
{
    for (int i = 0; i < FIT_POSE_COUNT; i++)
        memcpy(out->h[i], system->h[i], sizeof out->h[i]);
}

static void test_posterior_is_scatter_of_refits(void **state)
{
    (void)state;
    static struct refit r;
    static struct normal_equations system;
    static struct pose_information information;
    struct rng rng = {SEED};
    const struct body_shape shape = {{0}, 0, 0};
    const struct body_pose pose = random_pose(&rng);
    struct covariance3 scatter[JOINT_COUNT] = {{0}}, posterior[JOINT_COUNT];
    make_refit(&r, &pose, SEG_LEFT_FOREARM, &rng);
    for (int n = 0; n < REFITS; n++) {
        double x[FIT_COUNT] = {0};
        struct body_build moved;
        solve_refit(&r, &rng, &system, x);
        const struct body_pose fitted = move_pose(&pose, x);
        body_forward_kinematics(&shape, &fitted, &moved);
        for (int j = 0; j < JOINT_COUNT; j++) {
            struct covariance3 one = covariance3_outer(v3_sub(moved.joint[j], r.build.joint[j]));
            one = covariance3_scale(&one, 1.0 / REFITS);
            scatter[j] = covariance3_add(&scatter[j], &one);
        }
    }
    copy_information(&system, &information);
    EXPECT_TRUE(find_joint_posteriors(&r.build, &information, posterior));
    double worst = 0;
    for (int j = 0; j < JOINT_COUNT; j++)
        for (size_t i = 0; i < COUNT_OF(directions); i++) {
            const double got = covariance3_along(&posterior[j], directions[i]),
                         wanted = covariance3_along(&scatter[j], directions[i]);
            worst = fmax(worst, fabs(got / wanted - 1));
            EXPECT_NEAR(got, wanted, 0.12 * wanted); // five standard errors of a variance of 3000 samples: 13 %
        }
    print_message("variances differ by up to %.1f %% from those of %d refits\n", 100 * worst, REFITS);
    // The unseen forearm is known by its prior alone, 0.01 rad.
    EXPECT_AT_LEAST(covariance3_trace(&posterior[JOINT_LEFT_HAND]),
                    2 * covariance3_trace(&posterior[JOINT_RIGHT_HAND]));
}

static void expect_positive(const struct covariance3 *c)
{
    EXPECT_TRUE(isfinite(covariance3_trace(c)));
    for (size_t i = 0; i < COUNT_OF(directions); i++)
        EXPECT_AT_LEAST(covariance3_along(c, directions[i]), 1e-12);
    EXPECT_TRUE(covariance_is_finite(covariance_pack(c)) && covariance_is_known(covariance_pack(c)));
}

static void test_with_little_information(void **state)
{
    (void)state;
    static struct refit r;
    static struct normal_equations system;
    static struct pose_information information;
    struct rng rng = {SEED};
    const struct body_pose pose = random_pose(&rng);
    struct covariance3 posterior[JOINT_COUNT];
    make_refit(&r, &pose, -1, &rng);
    for (int residuals = 0; residuals < RESIDUALS; residuals = 2 * residuals + 1) { // none, one, three, ...
        normal_equations_reset(&system, false);
        for (int i = 0; i < residuals; i++)
            normal_equations_add(&system, &r.build, &r.residual[i]);
        normal_equations_assemble(&system, &r.build);
        copy_information(&system, &information);
        EXPECT_TRUE(find_joint_posteriors(&r.build, &information, posterior));
        for (int j = 0; j < JOINT_COUNT; j++)
            expect_positive(&posterior[j]);
    }
    information.h[5][5] = -1;
    EXPECT_TRUE(!find_joint_posteriors(&r.build, &information, posterior));
    information.h[5][5] = (double)NAN;
    EXPECT_TRUE(!find_joint_posteriors(&r.build, &information, posterior));
}

static double sigma_of(const struct joint_sight *sight)
{
    const struct covariance3 fit = covariance3_isotropic(1e-4);
    const struct joint_uncertainty_terms terms = joint_uncertainty(JOINT_LEFT_HAND, v3(0.3, 0.2, 2), &fit, sight);
    const struct covariance3 c = joint_uncertainty_sum(&terms);
    expect_positive(&c);
    return sqrt(covariance3_trace(&c) / 3);
}

static void test_hidden_joints_are_known_ever_less(void **state)
{
    (void)state;
    struct joint_sight sight = {.seen_ever = true};
    double last = sigma_of(&sight);
    EXPECT_NEAR((double)confidence_of(last, true), 1, 0);
    for (sight.hidden_s = 0.1; sight.hidden_s < 100; sight.hidden_s *= 2) {
        const double sigma_m = sigma_of(&sight);
        EXPECT_AT_LEAST(sigma_m, last);
        last = sigma_m;
    }
    EXPECT_NEAR((double)confidence_of(last, false), 0.5, 0); // within reach
    sight.hidden_s = sight.out_of_image_s = 1.1;
    EXPECT_NEAR((double)confidence_of(sigma_of(&sight), false), 0, 0);
    sight.hidden_s = sight.out_of_image_s = 1e9;
    EXPECT_AT_MOST(sigma_of(&sight), 1.1);
    sight = (struct joint_sight){0}; // never seen
    EXPECT_NEAR((double)confidence_of(sigma_of(&sight), false), 0, 0);
}

static void test_along_the_ray_less_is_known(void **state)
{
    (void)state;
    const struct covariance3 fit = {0};
    const struct joint_sight sight = {.seen_ever = true};
    const struct vec3 at = v3(0.8, -0.5, 2), ray = v3_unit(at), across = v3_perpendicular(at);
    for (int j = 0; j < JOINT_COUNT; j++) {
        const struct joint_uncertainty_terms terms = joint_uncertainty((enum joint)j, at, &fit, &sight);
        EXPECT_AT_LEAST(covariance3_along(&terms.floor, ray), covariance3_along(&terms.floor, across));
        expect_positive(&terms.floor);
    }
}

static void test_estimates_that_disagree(void **state)
{
    (void)state;
    const struct covariance3 a = covariance3_isotropic(1e-4), b = covariance3_isotropic(3e-4);
    struct covariance3 c = joint_merge_covariance(&a, &b, v3(0.2, 0, 0), 0.5);
    EXPECT_NEAR(c.xx, 2e-4 + 0.02, 1e-12); // half of 0.2 squared
    EXPECT_NEAR(c.yy, 2e-4, 1e-12);
    c = joint_merge_covariance(&a, &b, v3(0.2, 0, 0), 1);
    EXPECT_NEAR(c.xx, 3e-4, 1e-12);
}

// The mean squared Mahalanobis distance of three coordinates is 3 where the covariances are right.
static void test_errors_are_of_the_stated_size(void **state)
{
    (void)state;
    enum { FRAMES = 60 };
    struct tracked_film f;
    double sum[2] = {0}; // of joints seen, and inferred
    int count[2] = {0};
    tracked_film_open(&f, "man", "kata");
    const struct pose from = world_sensor_pose(f.world);
    for (int k = 0; k < FRAMES; k++) {
        const double t = 1 + k / 30.0;
        struct skeleton got, truth = world_joints_in_camera(f.world, t, from);
        tracked_film_shoot(&f, from, t, (uint64_t)k);
        EXPECT_STATUS(tracker_next(f.tracker, nanoseconds(t), f.depth, &got, NULL), OK);
        for (int j = 0; j < JOINT_COUNT; j++) {
            const struct covariance3 c = joint_covariance(&got, (enum joint)j);
            expect_positive(&c);
            const int inferred = got.confidence[j] < 1;
            sum[inferred] += joint_mahalanobis_squared(&got, &truth, (enum joint)j);
            count[inferred]++;
        }
    }
    for (int i = 0; i < 2; i++)
        print_message("%d joints %s: mean squared Mahalanobis distance %.2f instead of 3\n", count[i],
                      i ? "inferred" : "seen", sum[i] / fmax(1, count[i]));
    EXPECT_AT_LEAST(count[0], FRAMES * JOINT_COUNT / 2);
    EXPECT_AT_LEAST(sum[0] / count[0], 1);
    EXPECT_AT_MOST(sum[0] / count[0], 6);
    tracked_film_close(&f);
}

int main(void)
{
    printf("seed %d\n", SEED);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_posterior_is_scatter_of_refits),    cmocka_unit_test(test_with_little_information),
        cmocka_unit_test(test_hidden_joints_are_known_ever_less), cmocka_unit_test(test_along_the_ray_less_is_known),
        cmocka_unit_test(test_estimates_that_disagree),           cmocka_unit_test(test_errors_are_of_the_stated_size),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
