// The fit of the body model to depth images that show the model itself, in a pose and of a shape that are known.
#include "tests/support/test.h"

#include "base/linear_algebra.h"
#include "capture/body/body_fit.h"
#include "tests/support/solid_body.h"

#include <stdio.h>

enum { SEED = 1992, WIDTH = 160, HEIGHT = 120, PIXELS = WIDTH * HEIGHT, STARTS = 6, POINTS = 800 };
#define WALL_M 4.0

static const struct lens lens = {.width = WIDTH, .height = HEIGHT, .fx = 130, .fy = 130, .cx = 79.5, .cy = 59.5};
static const struct body_shape average;

static struct depth_evidence *evidence;
static uint16_t depth[PIXELS];
static uint8_t mask[PIXELS];
static struct fit_result result; // 30 kB

static int open_evidence(void **state)
{
    (void)state;
    return evidence_open(&evidence, &lens) == OK ? 0 : -1;
}

static int close_evidence(void **state)
{
    (void)state;
    evidence_close(&evidence);
    return 0;
}

static struct quat turn_by(double x, double y, double z) { return quat_from_rotation_vector(v3(x, y, z)); }

// Turned a little, arms and knees bent, nothing hidden.
static struct body_pose true_pose(void)
{
    struct body_pose pose = body_standing_pose(v3(0.05, 0, 2.5), v3(0, -1, 0), 0.3);
    pose.rotation[SEG_LEFT_UPPER_ARM] = turn_by(-0.3, 0.1, 0.6);
    pose.rotation[SEG_LEFT_FOREARM] = turn_by(-0.9, 0, 0);
    pose.rotation[SEG_RIGHT_UPPER_ARM] = turn_by(-0.5, 0, -0.7);
    pose.rotation[SEG_RIGHT_FOREARM] = turn_by(-0.4, 0, 0);
    pose.rotation[SEG_LEFT_THIGH] = turn_by(-0.2, 0, 0.15);
    pose.rotation[SEG_LEFT_SHIN] = turn_by(0.3, 0, 0);
    pose.rotation[SEG_RIGHT_THIGH] = turn_by(0.05, 0, -0.15);
    pose.rotation[SEG_CHEST] = turn_by(0.1, 0.05, 0);
    return pose;
}

static struct body_build build_of(const struct body_shape *shape, const struct body_pose *pose)
{
    struct body_build build;
    body_forward_kinematics(shape, pose, &build);
    return build;
}

static void film(const struct body_shape *shape, const struct body_pose *pose)
{
    const struct body_build build = build_of(shape, pose);
    solid_body_draw(&build, &lens, WALL_M, depth, mask);
    EXPECT_TRUE(evidence_read(evidence, depth, mask, POINTS));
    EXPECT_INT(evidence_cropped_edges(evidence), 0);
}

static struct body_pose disturbed(struct body_pose pose, struct rng *rng, double turn, double shift_m)
{
    pose.root = v3_add(pose.root, rng_normal3(rng, shift_m));
    for (int s = 0; s < SEG_COUNT; s++) {
        const struct vec3 by = rng_normal3(rng, turn);
        pose.rotation[s] = quat_unit(quat_multiply(pose.rotation[s], quat_from_rotation_vector(by)));
    }
    return pose;
}

static struct fit_task task_from(const struct body_pose *start)
{
    return (struct fit_task){.evidence = evidence,
                             .up = {0, -1, 0},
                             .expected = *start,
                             .expected_sigma = 4,
                             .iterations = 12,
                             .point_stride = 1,
                             .kernel_m = 0.12,
                             .shape = shape_prior_default()};
}

// Of the joints: mean and largest distance.
static double joint_error_m(const struct body_build *build, const struct body_build *truth, double *most)
{
    double sum = 0;
    *most = 0;
    for (int j = 0; j < JOINT_COUNT; j++) {
        const double off = v3_distance(build->joint[j], truth->joint[j]);
        sum += off;
        *most = fmax(*most, off);
    }
    return sum / JOINT_COUNT;
}

// ------------------------------------------------------------- the pose

static void test_pose_from_disturbed_starts(void **state)
{
    (void)state;
    const struct body_pose pose = true_pose();
    const struct body_build truth = build_of(&average, &pose);
    double started = 0, mean = 0, worst = 0;
    film(&average, &pose);
    for (int i = 0; i < STARTS; i++) {
        struct rng rng = rng_of(SEED, i);
        const struct body_pose start = disturbed(pose, &rng, 0.05, 0.015);
        const struct fit_task task = task_from(&start);
        const struct body_build before = build_of(&average, &start);
        double most;
        started += joint_error_m(&before, &truth, &most) / STARTS;
        body_fit(&task, &start, &result);
        mean += joint_error_m(&result.build, &truth, &most) / STARTS;
        worst = fmax(worst, most);
    }
    print_message("joints from %.1f mm to %.1f mm, the worst %.1f mm\n", 1e3 * started, 1e3 * mean, 1e3 * worst);
    EXPECT_AT_LEAST(started, 0.05); // measured 61.8 mm
    EXPECT_AT_MOST(mean, 0.004);    // measured 1.1 mm
    EXPECT_AT_MOST(worst, 0.012);   // measured 2.9 mm
}

static void test_truth_stays(void **state)
{
    (void)state;
    const struct body_pose pose = true_pose();
    const struct body_build truth = build_of(&average, &pose);
    double most;
    film(&average, &pose);
    const struct fit_task task = task_from(&pose);
    body_fit(&task, &pose, &result);
    const double mean = joint_error_m(&result.build, &truth, &most);
    print_message("from the truth: %.1f mm, the worst %.1f mm\n", 1e3 * mean, 1e3 * most);
    EXPECT_AT_MOST(mean, 0.002); // measured 0.5 mm
    EXPECT_AT_MOST(most, 0.004); // measured 1.0 mm
}

// What the mirror shows is fitted by the mirrored pose.
static void test_mirrored_image(void **state)
{
    (void)state;
    struct body_pose pose = true_pose();
    pose.root.x = 0;
    struct rng rng = rng_of(SEED, 0);
    const struct body_pose start = disturbed(pose, &rng, 0.06, 0.01);
    film(&average, &pose);
    struct fit_task task = task_from(&start);
    body_fit(&task, &start, &result);
    const struct body_build straight = result.build;
    for (int y = 0; y < HEIGHT; y++)
        for (int x = 0; x < WIDTH / 2; x++) {
            const int a = y * WIDTH + x, b = y * WIDTH + WIDTH - 1 - x;
            const uint16_t d = depth[a];
            const uint8_t m = mask[a];
            depth[a] = depth[b], mask[a] = mask[b];
            depth[b] = d, mask[b] = m;
        }
    EXPECT_TRUE(evidence_read(evidence, depth, mask, POINTS));
    struct body_pose other = start;
    other.root.x = -start.root.x;
    for (int s = 0; s < SEG_COUNT; s++) {
        const struct quat q = start.rotation[s];
        other.rotation[body_mirror((enum segment)s)] = (struct quat){q.x, -q.y, -q.z, q.w};
    }
    // The camera's x axis and the body's point opposite ways for a body that faces it: mirroring keeps the pelvis's
    // form.
    task = task_from(&other);
    body_fit(&task, &other, &result);
    double most = 0;
    for (int s = 0; s < SEG_COUNT; s++) {
        const struct vec3 a = straight.origin[s], b = result.build.origin[body_mirror((enum segment)s)];
        most = fmax(most, v3_distance(v3(-a.x, a.y, a.z), b));
    }
    print_message("mirrored: %.1f mm\n", 1e3 * most);
    EXPECT_AT_MOST(most, 0.003); // measured 0.6 mm: other pixels are taken for points
}

// A fifth of the points lies somewhere before the body: the kernel leaves them out. (Of what lies behind, only how far
// beside a limb it is seen counts; solid_distance.h.)
static void test_outliers_do_not_pull(void **state)
{
    (void)state;
    const struct body_pose pose = true_pose();
    const struct body_build truth = build_of(&average, &pose);
    struct rng rng = rng_of(SEED, 1), far = rng_of(SEED, 2);
    film(&average, &pose);
    for (int i = 0; i < evidence->count; i += 5)
        evidence->point[i].p.z -= rng_between(&far, 0.5, 1.5);
    const struct body_pose start = disturbed(pose, &rng, 0.06, 0.01);
    const struct fit_task task = task_from(&start);
    double most;
    body_fit(&task, &start, &result);
    const double mean = joint_error_m(&result.build, &truth, &most);
    print_message("a fifth of the points elsewhere: %.1f mm, the worst %.1f mm\n", 1e3 * mean, 1e3 * most);
    EXPECT_AT_MOST(mean, 0.015); // measured 4.3 mm
    EXPECT_AT_MOST(most, 0.04);  // measured 13.3 mm
}

static void test_same_answer_twice(void **state)
{
    (void)state;
    static struct fit_result again;
    const struct body_pose pose = true_pose();
    struct rng rng = rng_of(SEED, 2);
    const struct body_pose start = disturbed(pose, &rng, 0.1, 0.02);
    film(&average, &pose);
    const struct fit_task task = task_from(&start);
    body_fit(&task, &start, &result);
    body_fit(&task, &start, &again);
    EXPECT_TRUE(!memcmp(&result.pose, &again.pose, sizeof again.pose));
    EXPECT_NEAR(result.energy, again.energy, 0);
}

static void test_no_iterations(void **state)
{
    (void)state;
    const struct body_pose pose = true_pose();
    film(&average, &pose);
    struct fit_task task = task_from(&pose);
    task.iterations = 0;
    body_fit(&task, &pose, &result);
    EXPECT_TRUE(!memcmp(&result.pose, &pose, sizeof pose));
    EXPECT_TRUE(!result.has_information);
}

// Few points, all of one hand: the rest of the body stays as predicted.
static void test_one_hand_alone(void **state)
{
    (void)state;
    const struct body_pose pose = true_pose();
    const struct body_build truth = build_of(&average, &pose);
    film(&average, &pose);
    int kept = 0, solid;
    for (int i = 0; i < evidence->count; i++) {
        (void)solid_body_distance(&truth, evidence->point[i].p, &solid);
        if (solid == SOLID_LEFT_ARM + 3)
            evidence->point[kept++] = evidence->point[i];
    }
    EXPECT_AT_LEAST(kept, 3);
    evidence->count = kept;
    struct fit_task task = task_from(&pose);
    task.expected_sigma = 0.2;
    body_fit(&task, &pose, &result);
    double most;
    joint_error_m(&result.build, &truth, &most);
    print_message("%d points of a hand: %.1f mm\n", kept, 1e3 * most);
    EXPECT_AT_MOST(most, 0.003); // measured 0.8 mm
}

// ------------------------------------------------------------- energy and residuals

static void test_least_energy_at_the_truth(void **state)
{
    (void)state;
    const struct body_pose pose = true_pose();
    film(&average, &pose);
    const struct fit_task task = task_from(&pose);
    body_evaluate(&task, &pose, &average, &result);
    const double least = result.energy;
    double ratio = INFINITY;
    EXPECT_TRUE(!result.has_information);
    for (int i = 0; i < 20; i++) {
        struct rng rng = rng_of(SEED, 100 + i);
        const struct body_pose other = disturbed(pose, &rng, 0.05, 0.01);
        body_evaluate(&task, &other, &average, &result);
        ratio = fmin(ratio, result.energy / least);
        EXPECT_TRUE(!memcmp(&result.pose, &other, sizeof other));
    }
    print_message("energy %.1f at the truth, at least %.1f times that beside it\n", least, ratio);
    EXPECT_AT_LEAST(ratio, 40); // measured 179
}

// Against the nearest of all balls. The surface of a point behind a limb's middle is that before it, which may not be
// its nearest.
static void test_residuals_are_distances(void **state)
{
    (void)state;
    const struct body_pose pose = true_pose();
    film(&average, &pose);
    struct rng rng = rng_of(SEED, 3);
    const struct body_pose other = disturbed(pose, &rng, 0.05, 0.02);
    const struct body_build build = build_of(&average, &other);
    const struct fit_task task = task_from(&other);
    body_evaluate(&task, &other, &average, &result);
    int close = 0, same = 0, count = 0;
    for (int i = 0; i < evidence->count; i++) {
        int solid;
        const double wanted = solid_body_distance(&build, evidence->point[i].p, &solid);
        if (wanted < 0) // within one solid, it may be on another
            continue;
        count++;
        close += fabs(fabs((double)result.residual[i]) - wanted) < 0.004;
        same += result.solid[i] == solid;
    }
    const double share = (double)close / count;
    print_message("%.3f of the residuals are the distances, %.3f of the solids are the nearest\n", share,
                  (double)same / count);
    EXPECT_AT_LEAST(share, 0.9); // measured 0.962
}

static void test_information_is_positive_definite(void **state)
{
    (void)state;
    static double h[FIT_POSE_COUNT * FIT_POSE_COUNT];
    const struct body_pose pose = true_pose();
    double tight_root = 0;
    film(&average, &pose);
    for (int loose = 0; loose < 2; loose++) {
        struct fit_task task = task_from(&pose);
        task.expected_sigma = loose ? 8 : 1;
        body_fit(&task, &pose, &result);
        EXPECT_TRUE(result.has_information);
        for (int i = 0; i < FIT_POSE_COUNT; i++)
            for (int k = 0; k <= i; k++)
                h[i * FIT_POSE_COUNT + k] = h[k * FIT_POSE_COUNT + i] = result.information.h[i][k];
        if (loose)
            EXPECT_AT_MOST(h[0], tight_root); // the motion says less
        tight_root = h[0];
        EXPECT_TRUE(cholesky_factor(h, FIT_POSE_COUNT));
    }
}

// ------------------------------------------------------------- the shape

static void test_shape_is_learned(void **state)
{
    (void)state;
    struct body_shape tall = average;
    tall.log[SHAPE_SCALE] = 0.08;
    tall.log[SHAPE_THIGH] = 0.05;
    tall.log[SHAPE_CHEST_GIRTH] = -0.1;
    struct body_pose pose = true_pose();
    pose.root.z += 0.4;
    film(&tall, &pose);
    struct fit_task task = task_from(&pose);
    task.learn_shape = true;
    task.learn_rate = 0.5;
    task.iterations = 25;
    body_fit(&task, &pose, &result);
    const struct body_build truth = build_of(&tall, &pose), before = build_of(&average, &pose);
    double worst, started;
    const double mean = joint_error_m(&result.build, &truth, &worst);
    joint_error_m(&before, &truth, &started);
    print_message("scale %.3f of 0.080; joints %.1f mm, the worst %.1f mm of %.1f\n", result.shape.log[SHAPE_SCALE],
                  1e3 * mean, 1e3 * worst, 1e3 * started);
    EXPECT_NEAR(result.shape.log[SHAPE_SCALE], 0.08, 0.01); // measured 0.083
    EXPECT_AT_MOST(mean, 0.015);                            // measured 5.7 mm
    for (int i = 0; i < SHAPE_COUNT; i++)                   // this frame's own information, and symmetric
        for (int k = 0; k < i; k++)
            EXPECT_NEAR(result.shape_information[i][k], result.shape_information[k][i],
                        1e-6 * (1 + fabs(result.shape_information[i][k])));
    EXPECT_AT_LEAST(result.shape_information[SHAPE_SCALE][SHAPE_SCALE], 100);
}

static void test_shape_odds(void **state)
{
    (void)state;
    struct body_shape shape = average;
    EXPECT_NEAR(shape_log_odds(&shape), 0, 0);
    shape.log[SHAPE_SCALE] = 0.12; // 1.94 m: two standard deviations
    EXPECT_NEAR(shape_log_odds(&shape), 2, 1e-12);
    shape.log[SHAPE_SCALE] = -0.12; // 1.52 m: one, for children are people
    EXPECT_NEAR(shape_log_odds(&shape), 0.5, 1e-12);
}

int main(void)
{
    print_message("seed %d\n", SEED);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_pose_from_disturbed_starts),
        cmocka_unit_test(test_truth_stays),
        cmocka_unit_test(test_mirrored_image),
        cmocka_unit_test(test_outliers_do_not_pull),
        cmocka_unit_test(test_same_answer_twice),
        cmocka_unit_test(test_no_iterations),
        cmocka_unit_test(test_one_hand_alone),
        cmocka_unit_test(test_least_energy_at_the_truth),
        cmocka_unit_test(test_residuals_are_distances),
        cmocka_unit_test(test_information_is_positive_definite),
        cmocka_unit_test(test_shape_is_learned),
        cmocka_unit_test(test_shape_odds),
    };
    return cmocka_run_group_tests(tests, open_evidence, close_evidence);
}
