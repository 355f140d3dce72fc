// Evidence from joints that were found: the body that they are of is found again, wrong ones saturate, and the
// derivatives are the energy's.
#include "tests/support/test.h"

#include "capture/body/joint_evidence.h"
#include "capture/body/normal_equations.h"

#include <string.h>

enum { SEED = 409, POSES = 40 };
#define SIGMA_M 0.05

static struct quat turn_by(struct vec3 by) { return quat_from_rotation_vector(by); }

// Anywhere, lying too; elbows and knees bent as they bend.
static struct body_pose random_pose(struct rng *rng)
{
    struct body_pose pose = {.root = v3_add(v3(0, 0, 3), rng_normal3(rng, 0.5))};
    for (int s = 0; s < SEG_COUNT; s++)
        pose.rotation[s] = (struct quat){0, 0, 0, 1};
    pose.rotation[SEG_PELVIS] = turn_by(rng_normal3(rng, 1.5));
    pose.rotation[SEG_ABDOMEN] = turn_by(rng_normal3(rng, 0.15));
    pose.rotation[SEG_CHEST] = turn_by(rng_normal3(rng, 0.15));
    for (int k = 0; k < LIMB_COUNT; k++) {
        pose.rotation[body_limbs[k].upper] = turn_by(rng_normal3(rng, 0.6));
        pose.rotation[body_limbs[k].lower] = turn_by(v3((k < FIRST_LEG ? -1 : 1) * rng_between(rng, 0.2, 2), 0, 0));
    }
    return pose;
}

static struct joint_evidence evidence_of(const struct body_build *build)
{
    struct joint_evidence e = {.left = v3(1, 0, 0)};
    for (int j = 0; j < JOINT_COUNT; j++) {
        e.joint[j] = build->joint[j];
        e.sigma_m[j] = SIGMA_M;
    }
    return e;
}

static void test_pose_has_its_joints_there(void **state)
{
    (void)state;
    static const struct body_shape average;
    struct rng rng = rng_of(SEED, 0);
    double sum = 0, worst = 0;
    for (int i = 0; i < POSES; i++) {
        const struct body_pose pose = random_pose(&rng);
        struct body_build truth, build;
        body_forward_kinematics(&average, &pose, &truth);
        const struct joint_evidence e = evidence_of(&truth);
        const struct body_pose found = joint_evidence_pose(&e, &average, v3(0, -1, 0));
        body_forward_kinematics(&average, &found, &build);
        for (int j = 0; j < JOINT_COUNT; j++) {
            const double off = v3_distance(build.joint[j], truth.joint[j]);
            sum += off / (POSES * JOINT_COUNT);
            worst = fmax(worst, off);
        }
        EXPECT_NEAR(joint_evidence_height_m(&e), BODY_AVERAGE_HEIGHT_M, 1e-9);
    }
    print_message("seed %d: joints %.1f mm off in the mean, the worst %.1f mm\n", SEED, 1e3 * sum, 1e3 * worst);
    EXPECT_AT_MOST(sum, 0.015);
    EXPECT_AT_MOST(worst, 0.12);
}

// Of who is out of the picture above the hips, below them or at a side the trunk's other joints follow: upright, and
// turned as the network says.
static void test_trunk_is_completed(void **state)
{
    (void)state;
    static const struct body_shape average;
    static const enum joint above[] = {JOINT_HEAD, JOINT_NECK, JOINT_LEFT_SHOULDER, JOINT_RIGHT_SHOULDER, JOINT_TORSO},
                            below[] = {JOINT_WAIST, JOINT_LEFT_HIP, JOINT_RIGHT_HIP, JOINT_LEFT_KNEE, JOINT_RIGHT_KNEE},
                            side[] = {JOINT_LEFT_SHOULDER, JOINT_LEFT_ELBOW, JOINT_LEFT_HIP, JOINT_LEFT_KNEE};
    static const struct {
        const enum joint *joint;
        size_t count;
    } lost[] = {{above, COUNT_OF(above)}, {below, COUNT_OF(below)}, {side, COUNT_OF(side)}};
    double worst = 0;
    for (int turn = 0; turn < 8; turn++)
        for (size_t i = 0; i < COUNT_OF(lost); i++) {
            const struct body_pose pose = body_standing_pose(v3(0.2, 0, 3), v3(0, -1, 0), turn * 0.8);
            struct body_build truth, build;
            body_forward_kinematics(&average, &pose, &truth);
            struct joint_evidence e = evidence_of(&truth);
            e.left = body_axis(&truth, SEG_PELVIS, 0);
            for (size_t k = 0; k < lost[i].count; k++) {
                e.joint[lost[i].joint[k]] = v3(9, 9, 9);
                e.sigma_m[lost[i].joint[k]] = INFINITY;
            }
            const struct body_pose found = joint_evidence_pose(&e, &average, v3(0, -1, 0));
            body_forward_kinematics(&average, &found, &build);
            for (int k = 0; k < LIMB_COUNT; k++)
                worst = fmax(worst, v3_distance(build.joint[body_limbs[k].root], truth.joint[body_limbs[k].root]));
        }
    print_message("shoulders and hips at most %.1f mm off\n", 1e3 * worst);
    EXPECT_AT_MOST(worst, 0.05);
    struct joint_evidence none = {.left = v3(1, 0, 0)};
    for (int j = 0; j < JOINT_COUNT; j++)
        none.sigma_m[j] = INFINITY;
    const struct joint_evidence same = joint_evidence_complete(&none, &average, v3(0, -1, 0));
    EXPECT_TRUE(!memcmp(same.joint, none.joint, sizeof none.joint));
}

static void test_mirrored_has_the_sides_exchanged(void **state)
{
    (void)state;
    static const struct body_shape average;
    struct rng rng = rng_of(SEED, 1);
    const struct body_pose pose = random_pose(&rng);
    struct body_build build;
    body_forward_kinematics(&average, &pose, &build);
    const struct joint_evidence e = evidence_of(&build), other = joint_evidence_mirrored(&e),
                                again = joint_evidence_mirrored(&other);
    EXPECT_NEAR(v3_distance(other.joint[JOINT_LEFT_HAND], e.joint[JOINT_RIGHT_HAND]), 0, 0);
    EXPECT_NEAR(v3_distance(other.joint[JOINT_RIGHT_KNEE], e.joint[JOINT_LEFT_KNEE]), 0, 0);
    EXPECT_NEAR(v3_distance(other.joint[JOINT_HEAD], e.joint[JOINT_HEAD]), 0, 0);
    EXPECT_NEAR(other.left.x, -1, 0);
    EXPECT_TRUE(!memcmp(again.joint, e.joint, sizeof e.joint));
}

// However far a joint is off, it says no more than that it is wrong.
static void test_wrong_joints_saturate(void **state)
{
    (void)state;
    static const struct body_shape average;
    const struct body_pose pose = body_standing_pose(v3(0, 0, 3), v3(0, -1, 0), 0);
    struct body_build build;
    body_forward_kinematics(&average, &pose, &build);
    const struct joint_evidence right = evidence_of(&build);
    EXPECT_NEAR(joint_evidence_energy(&right, &build, NULL), 0, 1e-12);
    EXPECT_NEAR(joint_evidence_energy(NULL, &build, NULL), 0, 0);
    double before = 0;
    for (double off_m = 0.05; off_m < 20; off_m *= 2) {
        struct joint_evidence wrong = right;
        wrong.joint[JOINT_LEFT_HAND].x += off_m;
        const double energy = joint_evidence_energy(&wrong, &build, NULL);
        EXPECT_TRUE(energy > before);
        EXPECT_AT_MOST(energy, 0.5 * 9 * 5 / JOINT_COUNT);
        before = energy;
    }
    struct joint_evidence nowhere = right;
    for (int j = 0; j < JOINT_COUNT; j++)
        nowhere.joint[j].y += 50;
    EXPECT_NEAR(joint_evidence_energy(&nowhere, &build, NULL), 22.5, 0.01);
}

// A step of Gauss-Newton from a pose that is a little off brings the joints to where they were found.
static void test_fit_follows_the_joints(void **state)
{
    (void)state;
    static const struct body_shape average;
    static struct normal_equations system;
    struct rng rng = rng_of(SEED, 2);
    for (int i = 0; i < 8; i++) {
        const struct body_pose pose = random_pose(&rng);
        struct body_pose off = pose;
        struct body_build build;
        body_forward_kinematics(&average, &pose, &build);
        const struct joint_evidence e = evidence_of(&build);
        off.root = v3_add(off.root, rng_normal3(&rng, 0.01));
        off.rotation[SEG_LEFT_UPPER_ARM] =
            quat_multiply(off.rotation[SEG_LEFT_UPPER_ARM], turn_by(rng_normal3(&rng, 0.05)));
        body_forward_kinematics(&average, &off, &build);
        const double before = joint_evidence_energy(&e, &build, NULL);
        double x[FIT_COUNT];
        normal_equations_reset(&system, false);
        joint_evidence_energy(&e, &build, &system);
        normal_equations_assemble(&system, &build);
        for (int k = 0; k < FIT_POSE_COUNT; k++)
            system.h[k][k] += 0.01; // no joint tells a hand's or a foot's rotation
        EXPECT_TRUE(normal_equations_solve(&system, 0, x));
        off.root = v3_add(off.root, v3(x[0], x[1], x[2]));
        for (int s = 0; s < SEG_COUNT; s++)
            off.rotation[s] =
                quat_unit(quat_multiply(turn_by(v3(x[3 + 3 * s], x[4 + 3 * s], x[5 + 3 * s])), off.rotation[s]));
        body_forward_kinematics(&average, &off, &build);
        EXPECT_AT_MOST(joint_evidence_energy(&e, &build, NULL), 0.1 * before);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_pose_has_its_joints_there),        cmocka_unit_test(test_trunk_is_completed),
        cmocka_unit_test(test_mirrored_has_the_sides_exchanged), cmocka_unit_test(test_wrong_joints_saturate),
        cmocka_unit_test(test_fit_follows_the_joints),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
