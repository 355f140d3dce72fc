// A person's pose from one depth image, without any image before: the body model itself, drawn in poses that are known,
// from all around, with joints that are found some centimetres off; and what is no person.
#include "tests/support/test.h"

#include "capture/tracking/pose_init.h"
#include "tests/support/solid_body.h"

#include <stdio.h>

enum { SEED = 2004, WIDTH = 160, HEIGHT = 120, PIXELS = WIDTH * HEIGHT, POINTS = 800, YAWS = 8 };
#define WALL_M  4.5
#define FLOOR_M 1.0  // of the camera over it
#define FOUND_M 0.04 // standard deviation of the joints that are found
#define PI      3.14159265358979323846

static const struct lens lens = {.width = WIDTH, .height = HEIGHT, .fx = 130, .fy = 130, .cx = 79.5, .cy = 59.5};
static const struct body_shape average;

static struct depth_evidence *evidence;
static uint16_t depth[PIXELS];
static uint8_t mask[PIXELS];
static struct joint_evidence joints, told[2];
static struct fit_scratch scratch; // 100 kB

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

// Standing on the floor, the arms a little away from the body.
static struct body_pose standing(double yaw)
{
    struct body_pose pose = body_standing_pose(v3(0.1, 0, 2.8), v3(0, -1, 0), yaw);
    struct body_build build;
    body_forward_kinematics(&average, &pose, &build);
    double lowest = -INFINITY;
    for (int k = SOLID_LEFT_LEG; k < build.solids; k++)
        lowest = fmax(lowest,
                      fmax(build.solid[k].a.y + build.solid[k].radius_a, build.solid[k].b.y + build.solid[k].radius_b));
    pose.root.y += FLOOR_M - lowest;
    pose.rotation[SEG_LEFT_UPPER_ARM] = turn_by(0, 0, 0.3);
    pose.rotation[SEG_RIGHT_UPPER_ARM] = turn_by(0, 0, -0.3);
    return pose;
}

static void find_joints(const struct body_build *build)
{
    struct rng rng = rng_of(SEED, 1);
    joints.left = v3_unit(v3_sub(build->joint[JOINT_LEFT_HIP], build->joint[JOINT_RIGHT_HIP]));
    for (int j = 0; j < JOINT_COUNT; j++) {
        joints.joint[j] = v3_add(build->joint[j], rng_normal3(&rng, FOUND_M));
        joints.sigma_m[j] = FOUND_M;
    }
    told[0] = joints;
    told[1] = joint_evidence_mirrored(&joints);
}

static struct body_build film(const struct body_pose *pose)
{
    struct body_build build;
    body_forward_kinematics(&average, pose, &build);
    find_joints(&build);
    solid_body_draw(&build, &lens, WALL_M, depth, mask);
    EXPECT_TRUE(evidence_read(evidence, depth, mask, POINTS));
    EXPECT_INT(evidence_cropped_edges(evidence), 0);
    return build;
}

static struct fit_task task_of(void)
{
    return (struct fit_task){.evidence = evidence,
                             .joints = &joints,
                             .have_floor = true,
                             .up = {0, -1, 0},
                             .floor_m = FLOOR_M,
                             .expected_sigma = 4,
                             .iterations = 8,
                             .point_stride = 1,
                             .kernel_m = SEARCH_KERNEL_M,
                             .shape = shape_prior_default()};
}

// Of the joints: mean and largest distance.
static double joint_error_m(const struct body_build *truth, double *most)
{
    double sum = 0;
    *most = 0;
    for (int j = 0; j < JOINT_COUNT; j++) {
        const double off = v3_distance(scratch.best.build.joint[j], truth->joint[j]);
        sum += off;
        *most = fmax(*most, off);
    }
    return sum / JOINT_COUNT;
}

static struct vec3 ahead_of(const struct body_build *build) { return body_axis(build, SEG_PELVIS, 2); }

// ------------------------------------------------------------- the search

static void test_standing_from_all_around(void **state)
{
    (void)state;
    double worst_mean = 0, worst_ahead = 1;
    for (int i = 0; i < YAWS; i += SANITIZED ? 3 : 1) {
        const struct body_pose pose = standing(2 * PI * i / YAWS + 0.15);
        const struct body_build truth = film(&pose);
        struct fit_task task = task_of();
        EXPECT_TRUE(pose_init_search(&task, told, &scratch));
        double most;
        const double mean = joint_error_m(&truth, &most),
                     same = v3_dot(ahead_of(&truth), ahead_of(&scratch.best.build));
        print_message("%3d degrees: %.1f mm, the worst %.1f mm; %.3f of its direction\n", i * 360 / YAWS + 9,
                      1e3 * mean, 1e3 * most, same);
        worst_mean = fmax(worst_mean, mean);
        worst_ahead = fmin(worst_ahead, same);
        EXPECT_AT_LEAST(explained_share(evidence, &scratch.best, 0.05), 0.9);
    }
    EXPECT_AT_MOST(worst_mean, 0.04);   // measured 20.9 mm, from the side, where an arm is hidden
    EXPECT_AT_LEAST(worst_ahead, 0.98); // measured 0.999
}

static void test_arms_raised(void **state)
{
    (void)state;
    struct body_pose pose = standing(0.2);
    pose.rotation[SEG_LEFT_UPPER_ARM] = turn_by(0, 0, 2.2);
    pose.rotation[SEG_RIGHT_UPPER_ARM] = turn_by(0, 0, -2.2);
    const struct body_build truth = film(&pose);
    struct fit_task task = task_of();
    EXPECT_TRUE(pose_init_search(&task, told, &scratch));
    double most;
    const double mean = joint_error_m(&truth, &most);
    print_message("arms raised: %.1f mm, the worst %.1f mm\n", 1e3 * mean, 1e3 * most);
    EXPECT_AT_MOST(mean, 0.02); // measured 6.8 mm
}

// On the back, the head to the right.
static void test_lying(void **state)
{
    (void)state;
    struct body_pose pose = standing(0);
    pose.root = v3(0, FLOOR_M - 0.12, 2.6);
    const struct quat right = turn_by(0, 0, PI / 2), back = turn_by(0, -PI / 2, 0);
    pose.rotation[SEG_PELVIS] = quat_multiply(right, quat_multiply(pose.rotation[SEG_PELVIS], back));
    const struct body_build truth = film(&pose);
    struct fit_task task = task_of();
    EXPECT_TRUE(pose_init_search(&task, told, &scratch));
    double most;
    const double mean = joint_error_m(&truth, &most);
    print_message("lying: %.1f mm, the worst %.1f mm\n", 1e3 * mean, 1e3 * most);
    EXPECT_AT_MOST(mean, 0.03);
}

// A child of 1.2 m: the shape follows from the joints' distances and then the points.
static void test_small_person(void **state)
{
    (void)state;
    struct body_shape small = average;
    small.log[SHAPE_SCALE] = log(1.2 / BODY_AVERAGE_HEIGHT_M);
    struct body_pose pose = standing(0.1);
    pose.root.y = FLOOR_M - (FLOOR_M - pose.root.y) * 1.2 / BODY_AVERAGE_HEIGHT_M;
    struct body_build truth;
    body_forward_kinematics(&small, &pose, &truth);
    find_joints(&truth);
    solid_body_draw(&truth, &lens, WALL_M, depth, mask);
    EXPECT_TRUE(evidence_read(evidence, depth, mask, POINTS));
    struct fit_task task = task_of();
    EXPECT_TRUE(pose_init_search(&task, told, &scratch));
    double most;
    const double mean = joint_error_m(&truth, &most), scale = task.shape.mean.log[SHAPE_SCALE];
    print_message("1.20 m: %.1f mm, the worst %.1f mm; scale %.3f of %.3f\n", 1e3 * mean, 1e3 * most, scale,
                  small.log[SHAPE_SCALE]);
    EXPECT_NEAR(scale, small.log[SHAPE_SCALE], 0.01); // measured 0.002 off
    EXPECT_AT_MOST(mean, 0.004);                      // measured 1.0 mm
}

// ------------------------------------------------------------- no person

// Points here and there in the room.
static void test_scattered_points(void **state)
{
    (void)state;
    const struct body_pose pose = standing(0);
    film(&pose);
    struct rng rng = rng_of(SEED, 0);
    for (int i = 0; i < evidence->count; i++) {
        const struct vec3 p = rng_within(&rng, v3(2, 1, 1.4));
        evidence->point[i].p = v3_add(p, v3(0, 0, 2.8));
    }
    struct fit_task task = task_of();
    EXPECT_TRUE(!pose_init_search(&task, told, &scratch));
}

static void test_too_few_points(void **state)
{
    (void)state;
    const struct body_pose pose = standing(0);
    film(&pose);
    const int counts[] = {29, 1, 0};
    for (size_t i = 0; i < COUNT_OF(counts); i++) {
        evidence->count = counts[i];
        struct fit_task task = task_of();
        EXPECT_TRUE(!pose_init_search(&task, told, &scratch));
    }
}

// ------------------------------------------------------------- a person who is followed already

static bool task_equal(const struct fit_task *a, const struct fit_task *b)
{
    return a->evidence == b->evidence && a->iterations == b->iterations && a->point_stride == b->point_stride &&
           a->kernel_m == b->kernel_m && a->learn_shape == b->learn_shape && a->expected_sigma == b->expected_sigma &&
           !memcmp(&a->shape, &b->shape, sizeof a->shape) && !memcmp(&a->expected, &b->expected, sizeof a->expected);
}

static void expect_followed_again(const struct fit_task *task, const struct fit_task *before,
                                  const struct body_pose *pose)
{
    static struct fit_result wanted;
    EXPECT_TRUE(task_equal(task, before));
    EXPECT_TRUE(!memcmp(&scratch.best.pose, pose, sizeof *pose));
    body_evaluate(before, pose, &before->shape.mean, &wanted);
    EXPECT_NEAR(scratch.best.energy, wanted.energy, 0);
}

static void test_right_pose_is_kept(void **state)
{
    (void)state;
    const struct body_pose pose = standing(0.3);
    film(&pose);
    struct fit_task task = task_of();
    const struct fit_task before = task;
    scratch.best.pose = pose;
    EXPECT_TRUE(!pose_reinit(&task, told, false, &scratch));
    expect_followed_again(&task, &before, &pose);
}

static void test_wrong_pose_is_left(void **state)
{
    (void)state;
    const struct body_pose pose = standing(0.3);
    struct body_pose wrong = pose;
    wrong.root.x += 0.5;
    wrong.rotation[SEG_LEFT_THIGH] = turn_by(-1, 0, 0.4);
    const struct body_build truth = film(&pose);
    struct fit_task task = task_of();
    scratch.best.pose = wrong;
    EXPECT_TRUE(pose_reinit(&task, told, false, &scratch));
    double most;
    EXPECT_AT_MOST(joint_error_m(&truth, &most), 0.01);
}

static void test_explained_share(void **state)
{
    (void)state;
    static struct fit_result result;
    const struct body_pose pose = standing(0);
    film(&pose);
    for (int i = 0; i < evidence->count; i++)
        result.residual[i] = (float)(i % 4 == 0 ? -0.2 : 0.01 * (i % 4));
    const double quarter = (double)((evidence->count + 3) / 4) / evidence->count;
    EXPECT_NEAR(explained_share(evidence, &result, 0.1), 1 - quarter, 1e-12);
    EXPECT_NEAR(explained_share(evidence, &result, 1), 1, 0);
    EXPECT_NEAR(explained_share(evidence, &result, 0), 0, 0);
    evidence->count = 0;
    EXPECT_NEAR(explained_share(evidence, &result, 1), 0, 0);
}

int main(void)
{
    print_message("seed %d\n", SEED);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_standing_from_all_around),
        cmocka_unit_test(test_arms_raised),
        cmocka_unit_test(test_lying),
        cmocka_unit_test(test_small_person),
        cmocka_unit_test(test_scattered_points),
        cmocka_unit_test(test_too_few_points),
        cmocka_unit_test(test_right_pose_is_kept),
        cmocka_unit_test(test_wrong_pose_is_left),
        cmocka_unit_test(test_explained_share),
    };
    return cmocka_run_group_tests(tests, open_evidence, close_evidence);
}
