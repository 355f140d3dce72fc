// Bone frames: orthonormal for any skeleton, equivariant, continuous. Body cylinders:
// affine map and meshes.
#include "tests/support/test.h"

#include "reenact/skeleton/body_cylinders.h"

enum { SEED = 424242 };
static const double PI = 3.14159265358979323846;

static void expect_frame(const struct bone_frame *f)
{
    EXPECT_NEAR(v3_length(f->x), 1, 1e-9);
    EXPECT_NEAR(v3_length(f->y), 1, 1e-9);
    EXPECT_NEAR(v3_length(f->z), 1, 1e-9);
    EXPECT_NEAR(v3_distance(v3_cross(f->x, f->y), f->z), 0, 1e-9);
    EXPECT_TRUE(v3_finite(f->origin));
    EXPECT_AT_LEAST(f->length, 1e-3);
}

static struct skeleton random_skeleton(struct rng *rng)
{
    struct skeleton s = {0};
    for (int j = 0; j < JOINT_COUNT; j++) {
        s.joint[j] = rng_normal3(rng, 1);
        s.confidence[j] = 1;
    }
    return s;
}

// Upright, facing -z (the camera), arms hanging slightly outwards; camera axes.
static struct skeleton upright(void)
{
    struct skeleton s = {0};
    static const double at[JOINT_COUNT][3] = {
        [JOINT_HEAD] = {0, -0.25, 0},
        [JOINT_NECK] = {0, 0, 0},
        [JOINT_LEFT_SHOULDER] = {0.18, 0, 0},
        [JOINT_LEFT_ELBOW] = {0.25, 0.28, 0},
        [JOINT_LEFT_HAND] = {0.32, 0.56, 0},
        [JOINT_RIGHT_SHOULDER] = {-0.18, 0, 0},
        [JOINT_RIGHT_ELBOW] = {-0.25, 0.28, 0},
        [JOINT_RIGHT_HAND] = {-0.32, 0.56, 0},
        [JOINT_TORSO] = {0, 0.3, 0},
        [JOINT_WAIST] = {0, 0.5, 0},
        [JOINT_LEFT_HIP] = {0.1, 0.55, 0},
        [JOINT_LEFT_KNEE] = {0.1, 1, 0},
        [JOINT_LEFT_FOOT] = {0.1, 1.4, 0},
        [JOINT_RIGHT_HIP] = {-0.1, 0.55, 0},
        [JOINT_RIGHT_KNEE] = {-0.1, 1, 0},
        [JOINT_RIGHT_FOOT] = {-0.1, 1.4, 0},
    };
    for (int j = 0; j < JOINT_COUNT; j++) {
        s.joint[j] = v3_add(v3(at[j][0], at[j][1], at[j][2]), v3(0, 0, 3));
        s.confidence[j] = 1;
    }
    return s;
}

static void test_frames_are_orthonormal_for_any_skeleton(void **state)
{
    (void)state;
    struct rng rng = {SEED};
    print_message("seed %d\n", SEED);
    for (int round = 0; round < 300; round++) {
        struct skeleton s = random_skeleton(&rng);
        // Every second round a straight limb, every third a viewpoint on the bone's line.
        if (round % 2)
            s.joint[JOINT_LEFT_HAND] = v3_mix(s.joint[JOINT_LEFT_SHOULDER], s.joint[JOINT_LEFT_ELBOW], 2);
        struct vec3 eye = v3(0, 0, 0);
        if (round % 3 == 0)
            eye = v3_mix(s.joint[JOINT_LEFT_SHOULDER], s.joint[JOINT_LEFT_ELBOW], -1);
        for (int p = 0; p < PART_COUNT; p++) {
            struct bone_frame viewer_aligned, body_aligned;
            EXPECT_TRUE(bone_frame_viewer_aligned(&s, (enum part)p, eye, &viewer_aligned));
            expect_frame(&viewer_aligned);
            EXPECT_TRUE(bone_frame_body_aligned(&s, (enum part)p, &body_aligned));
            expect_frame(&body_aligned);
        }
    }
}

static void test_viewer_aligned_y_points_to_viewpoint(void **state)
{
    (void)state;
    struct rng rng = {SEED + 1};
    for (int round = 0; round < 200; round++) {
        struct skeleton s = random_skeleton(&rng);
        struct vec3 eye = rng_normal3(&rng, 3);
        struct bone_frame f;
        EXPECT_TRUE(bone_frame_viewer_aligned(&s, PART_LEFT_THIGH, eye, &f));
        struct vec3 in = bone_frame_local_point(&f, eye);
        EXPECT_NEAR(in.x, 0, 1e-9 * (1 + v3_length(eye)));
        EXPECT_AT_LEAST(in.y, 0);
    }
}

static void test_zero_length_limbs_have_no_frame(void **state)
{
    (void)state;
    struct skeleton s = upright();
    struct bone_frame f;
    s.joint[JOINT_LEFT_HAND] = s.joint[JOINT_LEFT_ELBOW];
    EXPECT_TRUE(!bone_frame_viewer_aligned(&s, PART_LEFT_FOREARM, v3(0, 0, 0), &f));
    EXPECT_TRUE(!bone_frame_body_aligned(&s, PART_LEFT_FOREARM, &f));
    EXPECT_TRUE(bone_frame_body_aligned(&s, PART_LEFT_UPPER_ARM, &f)); // its neighbour has one
    expect_frame(&f);
    s = upright();
    s.confidence[JOINT_HEAD] = 0;
    s.joint[JOINT_HEAD] = v3(NAN, NAN, NAN);
    EXPECT_TRUE(!bone_frame_viewer_aligned(&s, PART_HEAD, v3(0, 0, 0), &f));
    EXPECT_TRUE(!bone_frame_body_aligned(&s, PART_HEAD, &f));
    s.joint[JOINT_RIGHT_KNEE] = v3(NAN, 0, 0);
    s.confidence[JOINT_RIGHT_KNEE] = 1;
    EXPECT_TRUE(!bone_frame_viewer_aligned(&s, PART_RIGHT_SHIN, v3(0, 0, 0), &f));
}

static void test_front_axis_is_kept(void **state)
{
    (void)state;
    struct skeleton s = upright();
    for (int p = 0; p < PART_COUNT; p++) {
        struct bone_frame f;
        EXPECT_TRUE(bone_frame_body_aligned(&s, (enum part)p, &f));
        EXPECT_NEAR(v3_dot(f.y, v3(0, 0, -1)), 1, 0.02); // the chest faces the camera
    }
    // The front of a forearm raised forwards points upwards; that of a shin bent
    // back points downwards.
    s.joint[JOINT_LEFT_HAND] = v3_add(s.joint[JOINT_LEFT_ELBOW], v3(0, 0, -0.28));
    s.joint[JOINT_LEFT_FOOT] = v3_add(s.joint[JOINT_LEFT_KNEE], v3(0, 0, 0.4));
    struct bone_frame f;
    EXPECT_TRUE(bone_frame_body_aligned(&s, PART_LEFT_FOREARM, &f));
    EXPECT_AT_LEAST(v3_dot(f.y, v3(0, -1, 0)), 0.9);
    EXPECT_TRUE(bone_frame_body_aligned(&s, PART_LEFT_SHIN, &f));
    EXPECT_AT_LEAST(v3_dot(f.y, v3(0, 1, 0)), 0.9);
}

// Bending an elbow by a degree at a time: the axial rotation is continuous.
static void test_twist_blends_from_frame_to_hinge(void **state)
{
    (void)state;
    for (int side = 0; side < 4; side++) { // the plane the arm bends in
        struct bone_frame last = {0};
        for (int degree = 0; degree <= 120; degree++) {
            struct skeleton s = upright();
            struct vec3 down = v3_unit(v3_sub(s.joint[JOINT_LEFT_ELBOW], s.joint[JOINT_LEFT_SHOULDER]));
            double a = (side - 1) * PI / 6;
            struct vec3 ahead =
                v3_unit(v3_sub(v3(sin(a), 0, -cos(a)), v3_scale(down, v3_dot(down, v3(sin(a), 0, -cos(a))))));
            double bend = degree * PI / 180;
            struct vec3 along = v3_add(v3_scale(down, cos(bend)), v3_scale(ahead, sin(bend)));
            s.joint[JOINT_LEFT_HAND] = v3_add(s.joint[JOINT_LEFT_ELBOW], v3_scale(along, 0.28));
            struct bone_frame f;
            EXPECT_TRUE(bone_frame_body_aligned(&s, PART_LEFT_UPPER_ARM, &f));
            if (degree)
                EXPECT_AT_MOST(acos(fmin(1, v3_dot(f.y, last.y))) * 180 / PI, 5);
            last = f;
        }
    }
}

static void test_frames_are_rigidly_equivariant(void **state)
{
    (void)state;
    struct rng rng = {SEED + 2};
    for (int round = 0; round < 100; round++) {
        struct skeleton s = random_skeleton(&rng);
        struct quat random_rotation = quat_from_rotation_vector(rng_normal3(&rng, 2));
        struct pose move = {random_rotation, rng_normal3(&rng, 1)};
        struct skeleton moved = skeleton_transform(move, &s);
        for (int p = 0; p < PART_COUNT; p++) {
            struct bone_frame a, b;
            EXPECT_TRUE(bone_frame_body_aligned(&s, (enum part)p, &a));
            EXPECT_TRUE(bone_frame_body_aligned(&moved, (enum part)p, &b));
            EXPECT_NEAR(v3_distance(quat_rotate(move.rotation, a.y), b.y), 0, 1e-7);
            EXPECT_NEAR(v3_distance(pose_apply(move, a.origin), b.origin), 0, 1e-9);
        }
    }
}

static void test_map_takes_cylinder_to_bone(void **state)
{
    (void)state;
    struct skeleton s = upright();
    struct bone_frame f;
    EXPECT_TRUE(bone_frame_viewer_aligned(&s, PART_RIGHT_UPPER_ARM, v3(0, 0, 0), &f));
    struct affine_map m = cylinder_affine(&f, 0.05);
    const double local[3] = {0.6, -0.8, 0.25};
    double p[3];
    for (int i = 0; i < 3; i++)
        p[i] = m.row[i][0] * local[0] + m.row[i][1] * local[1] + m.row[i][2] * local[2] + m.row[i][3];
    struct vec3 in = bone_frame_local_point(&f, v3(p[0], p[1], p[2]));
    EXPECT_NEAR(in.x, 0.03, 1e-6);
    EXPECT_NEAR(in.y, -0.04, 1e-6);
    EXPECT_NEAR(in.z, 0.25 * f.length, 1e-6);
}

static void test_meshes_are_valid(void **state)
{
    (void)state;
    for (int shape = 0; shape < 2; shape++)
        for (int sides = 8; sides <= 64; sides *= 2) {
            struct cylinder_mesh m;
            EXPECT_STATUS(cylinder_mesh_make((enum cylinder_shape)shape, 0.3, sides, 24, &m), OK);
            double low = 1e9, high = -1e9, wide = 0, thin = 1e9;
            for (int i = 0; i < m.vertex_count; i++) {
                const float *v = m.vertices + 3 * i;
                double r = hypot(v[0], v[1]);
                low = fmin(low, v[2]);
                high = fmax(high, v[2]);
                wide = fmax(wide, r);
                if (v[2] >= 0 && v[2] <= 1)
                    thin = fmin(thin, r);
            }
            double polygon = cos(PI / sides); // of inner to outer radius
            EXPECT_NEAR(low, shape == CYLINDER_ROUNDED ? -0.3 : 0, 1e-6);
            EXPECT_NEAR(high, shape == CYLINDER_ROUNDED ? 1.3 : 1, 1e-6);
            EXPECT_AT_MOST(wide - 1, (1 - polygon) * 0.55);
            EXPECT_AT_LEAST(thin, 1);
            EXPECT_AT_LEAST(1 - thin * polygon, 0);
            EXPECT_INT(m.index_count % 3, 0);
            for (int i = 0; i < m.index_count; i++)
                EXPECT_TRUE(m.indices[i] < m.vertex_count);
            cylinder_mesh_free(&m);
        }
}

static void test_side_count_keeps_silhouette(void **state)
{
    (void)state;
    for (double radius = 1; radius < 80; radius *= 1.3) {
        int sides = cylinder_sides(radius, 0.1);
        double error = radius * (1 - cos(PI / sides)) / 2;
        EXPECT_AT_MOST(error, sides == 64 ? 0.5 : 0.1);
        if (sides > 8)
            EXPECT_AT_LEAST(radius * (1 - cos(PI / (sides / 2))) / 2, 0.1); // no more than needed
    }
    EXPECT_INT(cylinder_sides(NAN, 0.1), 64);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_frames_are_orthonormal_for_any_skeleton),
        cmocka_unit_test(test_viewer_aligned_y_points_to_viewpoint),
        cmocka_unit_test(test_zero_length_limbs_have_no_frame),
        cmocka_unit_test(test_front_axis_is_kept),
        cmocka_unit_test(test_twist_blends_from_frame_to_hinge),
        cmocka_unit_test(test_frames_are_rigidly_equivariant),
        cmocka_unit_test(test_map_takes_cylinder_to_bone),
        cmocka_unit_test(test_meshes_are_valid),
        cmocka_unit_test(test_side_count_keeps_silhouette),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
