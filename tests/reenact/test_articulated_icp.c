// Registration of a shape that is known, the cylinders of an avatar that no frame has shaped yet, to a painted person
// of the same measures.
#include "tests/support/test.h"

#include "reenact/avatar/articulated_icp.h"
#include "reenact/avatar/tsdf.h"
#include "tests/support/observe.h"
#include "tests/support/painted_person.h"

#include <stdio.h>
#include <string.h>

enum { SEED = 1987, STARTS = SANITIZED ? 2 : 6, FUSED = 4 };

static struct painted seen;
static struct painted_take take;
static struct source_rays *rays;
static struct tsdf *tsdf;
static struct bind_pose bind_pose;
static struct bone_transforms truth; // of the person in `seen`
static struct depth_frame observed;

static struct bone_transforms transforms_of(const struct skeleton *skeleton)
{
    struct bone_transforms transforms;
    EXPECT_STATUS(bone_transforms_of(&bind_pose, skeleton, &transforms), OK);
    return transforms;
}

static int make_person(void **state)
{
    (void)state;
    struct skeleton joints = whole_body(0);
    paint_person(&seen, &ideal, &joints, &whole_measures);
    const struct one_frame frame = {joints, seen.rgb, seen.depth, seen.mask};
    painted_take_open(&take, &ideal, &frame, 1, &whole_measures);
    EXPECT_STATUS(source_rays_open(&rays, take_calibration(take.take)), OK);
    EXPECT_STATUS(bind_pose_make(&bind_pose, take.take), OK);
    EXPECT_STATUS(tsdf_open(&tsdf, &bind_pose, take_calibration(take.take), TSDF_VOXEL_M, 2), OK);
    EXPECT_STATUS(depth_frame_open(&observed, take.take, rays), OK);
    EXPECT_STATUS(observe_frame(&observed, take.take, 0), OK);
    truth = transforms_of(&joints);
    for (int i = 0; i < FUSED; i++)
        EXPECT_STATUS(tsdf_integrate(tsdf, &observed, &truth), OK);
    joints = whole_body(0.1);
    paint_person(&seen, &ideal, &joints, &whole_measures);
    truth = transforms_of(&joints);
    return 0;
}

static int free_person(void **state)
{
    (void)state;
    depth_frame_close(&observed);
    tsdf_close(&tsdf);
    source_rays_close(&rays);
    painted_take_close(&take);
    return 0;
}

static struct skeleton disturbed_joints(int start, double sigma_m)
{
    struct rng rng = rng_of(SEED, start);
    struct skeleton joints = whole_body(0.1);
    for (int j = 0; j < JOINT_COUNT; j++)
        joints.joint[j] = v3_add(joints.joint[j], rng_normal3(&rng, sigma_m));
    return joints;
}

static struct icp_input input_of(const struct bone_transforms *joints)
{
    return (struct icp_input){
        .joints = *joints, .joint_errors = joint_noise_prior(), .start = bone_corrections_identity()};
}

// Registers to the frame with these pixels of the mask.
static struct bone_transforms registered(const struct icp_input *from, const uint8_t *mask,
                                         struct joint_noise *uncertainty)
{
    const struct skeleton joints = whole_body(0.1);
    const struct take_images images = {.depth = seen.depth, .mask = mask};
    depth_frame_label(&observed, &images, &joints);
    const struct bone_corrections corrections = articulated_icp(tsdf, &observed, from, uncertainty);
    return bone_corrections_apply(&from->joints, &corrections);
}

static double bone_error_m(const struct bone_transforms *transforms, int bone)
{
    const struct vec3 middle = bone_frame_midpoint(&bind_pose.frame[bone]);
    return v3_distance(pose_apply(transforms->bone[bone], middle), pose_apply(truth.bone[bone], middle));
}

// Of the parts with joints: mean and largest distance of their middles.
static double mean_error_m(const struct bone_transforms *transforms, double *most)
{
    double sum = 0;
    *most = 0;
    for (int p = 0; p < PART_COUNT; p++) {
        sum += bone_error_m(transforms, p);
        *most = fmax(*most, bone_error_m(transforms, p));
    }
    return sum / PART_COUNT;
}

// ------------------------------------------------------------- registration

static void test_disturbed_joints(void **state)
{
    (void)state;
    double before = 0, after = 0, worst = 0, most;
    for (int i = 0; i < STARTS; i++) {
        const struct skeleton joints = disturbed_joints(i, 0.015);
        const struct bone_transforms start = transforms_of(&joints);
        const struct icp_input from = input_of(&start);
        before += mean_error_m(&start, &most) / STARTS;
        const struct bone_transforms found = registered(&from, seen.mask, NULL);
        after += mean_error_m(&found, &most) / STARTS;
        worst = fmax(worst, most);
    }
    print_message("bones from %.1f mm to %.1f mm, the worst %.1f mm\n", 1e3 * before, 1e3 * after, 1e3 * worst);
    EXPECT_AT_LEAST(before, 0.012); // measured 17.8 mm
    EXPECT_AT_MOST(after, 0.006);   // measured 3.6 mm
    EXPECT_AT_MOST(worst, 0.02);    // measured 13.1 mm
}

static void test_truth_stays(void **state)
{
    (void)state;
    const struct icp_input from = input_of(&truth);
    double most;
    const struct bone_transforms found = registered(&from, seen.mask, NULL);
    const double mean = mean_error_m(&found, &most);
    print_message("from the truth: %.1f mm, the worst %.1f mm\n", 1e3 * mean, 1e3 * most);
    EXPECT_AT_MOST(mean, 0.003); // measured 1.1 mm
    EXPECT_AT_MOST(most, 0.008); // measured 3.5 mm
}

// Nobody is in the frame: all stays where the joints have it.
static void test_empty_frame(void **state)
{
    (void)state;
    static const uint8_t nobody[PIXELS];
    const struct skeleton joints = disturbed_joints(0, 0.015);
    const struct bone_transforms start = transforms_of(&joints);
    const struct icp_input from = input_of(&start);
    const struct bone_transforms found = registered(&from, nobody, NULL);
    double most = 0;
    for (int b = 0; b < BONE_COUNT; b++) {
        EXPECT_TRUE(pose_finite(found.bone[b]));
        const struct vec3 middle = bone_frame_midpoint(&bind_pose.frame[b]);
        most = fmax(most, v3_distance(pose_apply(found.bone[b], middle), pose_apply(start.bone[b], middle)));
    }
    print_message("empty frame: %.2g mm\n", 1e3 * most);
    EXPECT_AT_MOST(most, 0.02); // measured 11 mm: adjacent bones are pulled together at joints that do not fit
}

// The left forearm is not in the picture: the others are registered as before, and only of it little is known.
static void test_hidden_forearm(void **state)
{
    (void)state;
    static uint8_t mask[PIXELS];
    const struct skeleton joints = whole_body(0.1), start_joints = disturbed_joints(1, 0.01);
    const struct bone_transforms start = transforms_of(&start_joints);
    const struct icp_input from = input_of(&start);
    const struct pixel elbow = lens_project(&ideal, joints.joint[JOINT_LEFT_ELBOW]);
    for (int i = 0; i < PIXELS; i++)
        mask[i] = i % W > elbow.x && i / W < lens_project(&ideal, joints.joint[JOINT_LEFT_KNEE]).y ? 0 : seen.mask[i];
    struct joint_noise whole, hidden;
    registered(&from, seen.mask, &whole);
    const struct bone_transforms found = registered(&from, mask, &hidden);
    print_message("forearm known to %.1f mm, hidden %.1f mm; the other to %.1f and %.1f mm\n",
                  1e3 * whole.m[PART_LEFT_FOREARM], 1e3 * hidden.m[PART_LEFT_FOREARM],
                  1e3 * whole.m[PART_RIGHT_FOREARM], 1e3 * hidden.m[PART_RIGHT_FOREARM]);
    EXPECT_AT_LEAST(hidden.m[PART_LEFT_FOREARM], 2 * whole.m[PART_LEFT_FOREARM]); // measured 3.1 times
    EXPECT_NEAR(hidden.m[PART_RIGHT_FOREARM], whole.m[PART_RIGHT_FOREARM], 0.1 * whole.m[PART_RIGHT_FOREARM]);
    EXPECT_AT_MOST(bone_error_m(&found, PART_RIGHT_FOREARM), 0.015);
    EXPECT_AT_MOST(bone_error_m(&found, PART_LEFT_FOREARM), 0.04);
    for (int b = 0; b < BONE_COUNT; b++)
        EXPECT_TRUE(hidden.m[b] > 0 && hidden.rad[b] > 0 && isfinite(hidden.m[b]) && isfinite(hidden.rad[b]));
}

// Depth does not tell how a thigh is turned about its axis: the start's rotation is kept, if it is said to be known.
static void test_axial_rotation_is_kept(void **state)
{
    (void)state;
    struct icp_input from = input_of(&truth);
    from.axial_fixed = true;
    EXPECT_TRUE(rotation_from_colors(PART_LEFT_THIGH) && !rotation_from_colors(PART_UPPER_TORSO));
    const struct vec3 axis = bind_pose.frame[PART_LEFT_THIGH].z;
    from.start.bone[PART_LEFT_THIGH].rotation = quat_from_rotation_vector(v3_scale(axis, 0.3));
    const struct bone_transforms found = registered(&from, seen.mask, NULL);
    const struct quat by =
        quat_multiply(quat_conjugate(truth.bone[PART_LEFT_THIGH].rotation), found.bone[PART_LEFT_THIGH].rotation);
    const double turn = v3_dot(quat_to_rotation_vector(by), axis);
    print_message("a thigh that was turned by 0.300 rad stays at %.3f\n", turn);
    EXPECT_NEAR(turn, 0.3, 0.015); // measured 0.298
}

static void test_same_answer_twice(void **state)
{
    (void)state;
    const struct skeleton joints = disturbed_joints(2, 0.015);
    const struct bone_transforms start = transforms_of(&joints);
    const struct icp_input from = input_of(&start);
    struct joint_noise uncertainty;
    const struct bone_transforms one = registered(&from, seen.mask, NULL),
                                 two = registered(&from, seen.mask, &uncertainty);
    EXPECT_TRUE(!memcmp(&one, &two, sizeof one));
}

// ------------------------------------------------------------- corrections

static void test_corrections(void **state)
{
    (void)state;
    struct bone_corrections a = bone_corrections_identity(), b = a;
    for (int i = 0; i < BONE_COUNT; i++)
        b.bone[i] = (struct pose){quat_from_rotation_vector(v3(0, 0, 0.4)), {0.1 * i, 0, -0.2}};
    const struct bone_corrections half = bone_corrections_mix(&a, &b, 0.5), from = bone_corrections_mix(&a, &b, 0),
                                  to = bone_corrections_mix(&a, &b, 1);
    for (int i = 0; i < BONE_COUNT; i++) {
        EXPECT_NEAR(pose_angle(half.bone[i], a.bone[i]), 0.2, 1e-9);
        EXPECT_NEAR(v3_distance(half.bone[i].translation, v3(0.05 * i, 0, -0.1)), 0, 1e-12);
        EXPECT_NEAR(v3_distance(from.bone[i].translation, v3(0, 0, 0)), 0, 1e-12);
        EXPECT_NEAR(pose_angle(to.bone[i], b.bone[i]), 0, 1e-7);
    }
    const struct bone_transforms same = bone_corrections_apply(&truth, &a), moved = bone_corrections_apply(&truth, &b);
    for (int i = 0; i < BONE_COUNT; i++) {
        EXPECT_NEAR(v3_distance(same.bone[i].translation, truth.bone[i].translation), 0, 1e-12);
        const struct vec3 p = {0.3, -0.2, 0.1}; // corrected in the bone's axes, then put where the joints have it
        const struct vec3 wanted = pose_apply(truth.bone[i], pose_apply(b.bone[i], p));
        EXPECT_NEAR(v3_distance(pose_apply(moved.bone[i], p), wanted), 0, 1e-12);
    }
}

int main(void)
{
    print_message("seed %d\n", SEED);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_disturbed_joints),
        cmocka_unit_test(test_truth_stays),
        cmocka_unit_test(test_empty_frame),
        cmocka_unit_test(test_hidden_forearm),
        cmocka_unit_test(test_axial_rotation_is_kept),
        cmocka_unit_test(test_same_answer_twice),
        cmocka_unit_test(test_corrections),
    };
    return cmocka_run_group_tests(tests, make_person, free_person);
}
