// Exports for other programs: CSV and BVH, read back by independent code.
#include "tests/support/test.h"

#include "capture/export.h"
#include "platform/file.h"
#include "tests/support/scratch.h"
#include "tests/world/bvh.h"
#include "tests/world/world.h"

#include <stdio.h>
#include <string.h>

enum { FRAMES = 40 };

static struct scratch scratch;
static struct world *world;
static struct recording *recording;
static struct take *take;

// The head's covariance is not known, the others are 2 cm.
static struct skeleton truth(int i)
{
    struct skeleton s = world_joints_in_camera(world, i / 10.0, world_sensor_pose(world));
    const struct covariance3 c = covariance3_isotropic(4e-4);
    for (int j = 0; j < JOINT_COUNT; j++)
        if (j != JOINT_HEAD)
            joint_set_covariance(&s, (enum joint)j, &c);
    return s;
}

static void test_csv_has_every_joint(void **state)
{
    (void)state;
    const char *path = scratch_file(&scratch, "joints.csv");
    EXPECT_STATUS(export_joints_csv(take, path), OK);
    uint8_t *text;
    size_t count;
    EXPECT_STATUS(file_read(path, &text, &count), OK);
    char *line = strtok((char *)text, "\n");
    assert_string_equal(line, "timestamp,joint,x_m,y_m,z_m,confidence,sigma_m");
    int rows = 0;
    while ((line = strtok(NULL, "\n"))) {
        double time_s, x, y, z, confidence, sigma_m;
        char name[32];
        const int fields =
            sscanf(line, "%lf,%31[^,],%lf,%lf,%lf,%lf,%lf", &time_s, name, &x, &y, &z, &confidence, &sigma_m);
        enum joint j;
        EXPECT_TRUE(joint_from_name(name, &j));
        EXPECT_INT(fields, j == JOINT_HEAD ? 6 : 7); // an empty field
        if (j != JOINT_HEAD)
            EXPECT_NEAR(sigma_m, 0.02, 2e-5);
        else
            EXPECT_TRUE(line[strlen(line) - 1] == ',');
        struct skeleton wanted = truth(rows / JOINT_COUNT);
        EXPECT_NEAR(time_s, 7 + rows / JOINT_COUNT / 10.0, 1e-6);
        EXPECT_NEAR(x, wanted.joint[j].x, 1e-5);
        EXPECT_NEAR(y, wanted.joint[j].y, 1e-5);
        EXPECT_NEAR(z, wanted.joint[j].z, 1e-5);
        rows++;
    }
    EXPECT_INT(rows, FRAMES * JOINT_COUNT);
    free(text);
}

// The bones of a BVH have one length for the whole file, and trunk and pelvis are
// rigid, so joints come back within centimetres, not exactly.
static void test_bvh_matches_take(void **state)
{
    (void)state;
    const char *path = scratch_file(&scratch, "motion.bvh");
    EXPECT_STATUS(export_bvh(take, path), OK);
    uint8_t *text;
    size_t count;
    struct bvh *bvh;
    EXPECT_STATUS(file_read(path, &text, &count), OK);
    EXPECT_STATUS(bvh_parse(&bvh, path, text, count), OK);
    EXPECT_INT(bvh_joint_count(bvh), JOINT_COUNT);
    EXPECT_INT(bvh_frame_count(bvh), FRAMES);
    EXPECT_NEAR(bvh_frame_s(bvh), 0.1, 1e-6);
    double sum = 0, worst = 0;
    for (int i = 0; i < FRAMES; i++) {
        struct vec3 got[JOINT_COUNT];
        struct skeleton wanted = world_joints(world, i / 10.0);
        bvh_positions(bvh, i, got);
        for (int j = 0; j < JOINT_COUNT; j++) {
            int at = bvh_find(bvh, joint_name((enum joint)j));
            EXPECT_AT_LEAST(at, 0);
            struct vec3 p = wanted.joint[j]; // world, z up; the file has y up and centimetres
            double error = v3_distance(v3_scale(got[at], 0.01), v3(p.x, p.z, -p.y));
            sum += error / (FRAMES * JOINT_COUNT);
            worst = fmax(worst, error);
        }
    }
    print_message("joints from BVH: mean error %.3f m, %.3f m at worst\n", sum, worst);
    EXPECT_AT_MOST(sum, 0.05);
    EXPECT_AT_MOST(worst, 0.1);
    bvh_free(&bvh);
    free(text);
}

static int set_up(void **state)
{
    (void)state;
    struct world_options options = world_default_options();
    struct calibration calibration = world_calibration(0.25);
    struct recording_writer *writer;
    options.plain = true;
    scratch = scratch_make();
    const char *path = scratch_file(&scratch, "take.reenact");
    if (world_open(&world, &options) != OK || recording_create(&writer, path) != OK ||
        recording_begin_take(writer, "t", &calibration) != OK)
        return -1;
    for (int i = 0; i < FRAMES; i++) {
        struct take_frame frame = {.time_ns = 7000000000 + i * 100000000LL,
                                   .world_from_camera = world_sensor_pose(world),
                                   .located = true,
                                   .has_skeleton = true,
                                   .skeleton = truth(i)};
        if (recording_add_frame(writer, &frame) != OK)
            return -1;
    }
    if (recording_end_take(writer) != OK || recording_close(&writer) != OK)
        return -1;
    return recording_open(&recording, path) == OK && take_open(&take, recording, "t") == OK ? 0 : -1;
}

static int tear_down(void **state)
{
    (void)state;
    take_close(&take);
    recording_free(&recording);
    world_close(&world);
    scratch_remove(&scratch);
    return 0;
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_csv_has_every_joint),
        cmocka_unit_test(test_bvh_matches_take),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
