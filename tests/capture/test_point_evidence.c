// Points of a colour image as evidence: the energy's derivatives against finite differences, saturation, and what does
// not count.
#include "tests/support/test.h"

#include "capture/body/normal_equations.h"
#include "tests/support/random.h"

#include <string.h>

enum { TRIALS = 20 };

static const struct body_shape average;

static struct calibration two_cameras(void)
{
    const struct lens lens = {.width = 640, .height = 480, .fx = 525, .fy = 520, .cx = 320, .cy = 240};
    struct calibration c = {.color = lens, .depth = lens};
    c.color.k1 = 0.05;
    c.color_from_depth = (struct pose){quat_from_rotation_vector(v3(0.01, -0.02, 0.005)), {-0.03, 0.002, 0.01}};
    return c;
}

static struct body_pose some_pose(struct rng *rng)
{
    struct body_pose pose = body_standing_pose(v3(0.1, 0, 2.6), v3(0, -1, 0), rng_between(rng, 0, 6));
    for (int s = 1; s < SEG_COUNT; s++)
        pose.rotation[s] = quat_from_rotation_vector(rng_within(rng, v3(0.5, 0.5, 0.5)));
    return pose;
}

// The points of a body as its image would have them, moved by up to off_px.
static struct body_points seen(const struct body_build *build, const struct calibration *c, double off_px,
                               struct rng *rng)
{
    struct body_points points = {.person = true};
    for (int k = 0; k < BODY_POINT_COUNT; k++) {
        const struct vec3 p = pose_apply(c->color_from_depth, body_point_on(build, (enum body_point_name)k));
        const struct pixel px = lens_project(&c->color, p);
        const struct vec3 off = rng_within(rng, v3(off_px, off_px, 0));
        points.at[k] = (struct body_point){(float)(px.x + off.x), (float)(px.y + off.y), 1};
    }
    return points;
}

static void move(struct body_pose *pose, int unknown, double by)
{
    double *root[3] = {&pose->root.x, &pose->root.y, &pose->root.z};
    if (unknown < 3) {
        *root[unknown] += by;
        return;
    }
    const int s = unknown / 3 - 1, k = unknown % 3;
    pose->rotation[s] =
        quat_multiply(quat_from_rotation_vector(v3(by * (k == 0), by * (k == 1), by * (k == 2))), pose->rotation[s]);
}

static double energy_at(const struct point_evidence *e, const struct body_pose *pose)
{
    struct body_build build;
    body_forward_kinematics(&average, pose, &build);
    return point_evidence_energy(e, &build, NULL);
}

static double energy_moved(const struct point_evidence *e, const struct body_pose *pose, int a, double by_a, int b,
                           double by_b)
{
    struct body_pose moved = *pose;
    move(&moved, a, by_a);
    move(&moved, b, by_b);
    return energy_at(e, &moved);
}

static void test_gradient_is_right(void **state)
{
    (void)state;
    static struct normal_equations system;
    const struct calibration c = two_cameras();
    struct rng rng = {4711};
    print_message("seed %llu\n", (unsigned long long)rng.state);
    const double d = 1e-5;
    double worst = 0;
    for (int trial = 0; trial < TRIALS; trial++) {
        struct body_build build;
        struct point_evidence e;
        const struct body_pose pose = some_pose(&rng);
        body_forward_kinematics(&average, &pose, &build);
        const struct body_points points = seen(&build, &c, 2.0 * (1 << trial % 6), &rng); // the widest saturate
        point_evidence_read(&e, &points, &c, 2.6);
        EXPECT_AT_LEAST(e.count, 10);
        normal_equations_reset(&system, false);
        const double energy = point_evidence_energy(&e, &build, &system);
        EXPECT_NEAR(energy, energy_at(&e, &pose), 1e-12);
        normal_equations_assemble(&system, &build);
        for (int i = 0; i < FIT_POSE_COUNT; i++) {
            const double slope = (energy_moved(&e, &pose, i, d, i, 0) - energy_moved(&e, &pose, i, -d, i, 0)) / (2 * d);
            worst = fmax(worst, fabs(system.g[i] + slope));
            EXPECT_NEAR(system.g[i], -slope, 1e-5 * (1 + fabs(slope)));
        }
    }
    print_message("gradient: at most %.2g off\n", worst);
}

// Where the points fit exactly, Gauss-Newton's matrix is the energy's second derivative.
static void test_hessian_is_right_at_the_minimum(void **state)
{
    (void)state;
    static struct normal_equations system;
    const struct calibration c = two_cameras();
    struct rng rng = {42};
    struct body_build build;
    struct point_evidence e;
    const struct body_pose pose = some_pose(&rng);
    body_forward_kinematics(&average, &pose, &build);
    const struct body_points points = seen(&build, &c, 0, &rng);
    point_evidence_read(&e, &points, &c, 2.6);
    normal_equations_reset(&system, false);
    EXPECT_AT_MOST(point_evidence_energy(&e, &build, &system), 1e-6);
    normal_equations_assemble(&system, &build);
    const double d = 1e-4;
    for (int a = 0; a < FIT_POSE_COUNT; a++)
        for (int b = 0; b <= a; b++) {
            const double second = (energy_moved(&e, &pose, a, d, b, d) - energy_moved(&e, &pose, a, d, b, -d) -
                                   energy_moved(&e, &pose, a, -d, b, d) + energy_moved(&e, &pose, a, -d, b, -d)) /
                                  (4 * d * d);
            EXPECT_NEAR(system.h[a][b], second, 0.02 + 0.01 * fabs(second));
        }
}

// Left and right exchanged all over a person who faces the camera.
static void test_exchanged_sides_weigh_10_to_30(void **state)
{
    (void)state;
    const struct calibration c = two_cameras();
    struct rng rng = {1};
    const struct body_pose pose = body_standing_pose(v3(0, 0, 2.6), v3(0, -1, 0), 0),
                           away = body_pose_flip_facing(&average, &pose);
    struct body_build build, other;
    struct point_evidence e;
    body_forward_kinematics(&average, &pose, &build);
    body_forward_kinematics(&average, &away, &other);
    const struct body_points points = seen(&build, &c, 0, &rng);
    point_evidence_read(&e, &points, &c, 2.6);
    const double odds = point_evidence_energy(&e, &other, NULL) - point_evidence_energy(&e, &build, NULL);
    print_message("exchanged sides: %.1f log-odds\n", odds);
    EXPECT_AT_LEAST(odds, 10);
    EXPECT_AT_MOST(odds, 30);
    EXPECT_AT_MOST(point_evidence_energy(&e, &other, NULL), POINTS_ENERGY_MAX);
}

static void test_hidden_and_outside_points_do_not_count(void **state)
{
    (void)state;
    const struct calibration c = two_cameras();
    struct rng rng = {1};
    const struct body_pose pose = body_standing_pose(v3(0, 0, 2.6), v3(0, -1, 0), 0);
    struct body_build build;
    struct point_evidence e;
    body_forward_kinematics(&average, &pose, &build);
    struct body_points points = seen(&build, &c, 0, &rng);
    points.at[BODY_POINT_LEFT_WRIST].visibility = 0.3f;
    points.at[BODY_POINT_RIGHT_KNEE].x_px = 5000;
    points.at[BODY_POINT_LEFT_TOE].x_px = NAN;
    point_evidence_read(&e, &points, &c, 2.6);
    EXPECT_INT(e.count, BODY_POINT_COUNT - 3);
    EXPECT_INT(e.index[BODY_POINT_LEFT_WRIST], -1);
    EXPECT_INT(e.index[BODY_POINT_RIGHT_KNEE], -1);
    EXPECT_INT(e.index[BODY_POINT_LEFT_TOE], -1);
    points.person = false;
    point_evidence_read(&e, &points, &c, 2.6);
    EXPECT_INT(e.count, 0);
    EXPECT_INT(point_evidence_energy(&e, &build, NULL), 0);
    EXPECT_INT(point_evidence_energy(NULL, &build, NULL), 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_gradient_is_right),
        cmocka_unit_test(test_hessian_is_right_at_the_minimum),
        cmocka_unit_test(test_exchanged_sides_weigh_10_to_30),
        cmocka_unit_test(test_hidden_and_outside_points_do_not_count),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
