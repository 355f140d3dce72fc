// The lists, points and calibrations that surroundings are read from: what they may say, and the sentence where they
// may not.
#include "tests/support/test.h"

#include "formats/ply.h"
#include "platform/files/file.h"
#include "surround/reading/surround_set.h"
#include "tests/support/scratch.h"

#include <stdio.h>
#include <string.h>

static struct scratch scratch;

static void test_pose_lists(void **state)
{
    (void)state;
    struct timed_pose *list;
    int count;
    scratch_text(&scratch, "poses.txt",
                 "# time x y z and a rotation\n-3999999999 1 2 3 0 0 0 1\n3999999999 3 2 1 0 0 0.8 0.6\n");
    EXPECT_STATUS(pose_list_read(scratch_file(&scratch, "poses.txt"), &list, &count), OK);
    EXPECT_INT(count, 2);
    EXPECT_TRUE(list[0].time_ns == -3999999999000000000 && list[1].time_ns == 3999999999000000000);
    EXPECT_NEAR(pose_list_at(list, count, 0).translation.x, 2, 1e-6); // halfway between the two
    free(list);
    static const char *const bad[] = {
        "4000000000 1 2 3 0 0 0 1\n", "nan 1 2 3 0 0 0 1\n", "1 1 2 3 0 0 0 nan\n",
        "1 1 2 3 0 0 0 9\n",          "1 1 2 3 0 0 0\n",     "2 1 2 3 0 0 0 1\n1 1 2 3 0 0 0 1\n",
        "../a 0007 1 2 3 0 0 0 1\n",  "# nothing\n",
    };
    for (size_t i = 0; i < COUNT_OF(bad); i++) {
        scratch_text(&scratch, "poses.txt", bad[i]);
        print_message("%s", bad[i]);
        EXPECT_STATUS(pose_list_read(scratch_file(&scratch, "poses.txt"), &list, &count), ERR_INPUT);
        EXPECT_SAYS("poses.txt");
    }
}

// Against a search one by one.
static void test_the_pose_at_a_time(void **state)
{
    (void)state;
    enum { POSES = 9 };
    struct timed_pose list[POSES];
    static const int64_t times[POSES] = {-5, 0, 0, 1, 3, 10, 11, 50, 60};
    for (int i = 0; i < POSES; i++)
        list[i] = (struct timed_pose){.time_ns = times[i], .pose = {{0, 0, 0, 1}, {i, 0, 0}}};
    for (int count = 1; count <= POSES; count++)
        for (int64_t t = -7; t < 63; t++) {
            int after = 0;
            while (after < count && times[after] < t)
                after++;
            const double share =
                after && after < count ? (double)(t - times[after - 1]) / (double)(times[after] - times[after - 1]) : 0;
            const double want = after == count ? count - 1 : after ? after - 1 + share : 0;
            EXPECT_NEAR(pose_list_at(list, count, t).translation.x, want, 1e-12);
        }
}

static void test_file_lists(void **state)
{
    (void)state;
    struct timed_file *list;
    char folder[300];
    int count;
    snprintf(folder, sizeof folder, "%s", scratch_file(&scratch, "."));
    scratch_text(&scratch, "files.txt", "0 a/../0.png\n# later\n0.5 ./b.png\n");
    EXPECT_STATUS(file_list_read(folder, "files.txt", &list, &count), OK);
    EXPECT_INT(count, 2);
    EXPECT_TRUE(list[1].time_ns == 500000000 && strstr(list[1].path, "/./b.png"));
    free(list);
    static const struct {
        const char *text, *says;
    } bad[] = {{"0 ../out.png\n", "outside of the folder"},
               {"0 a/../../out.png\n", "outside of the folder"},
               {"0 a\xff.png\n", "not UTF-8"},
               {"0 \x1b[2J.png\n", "control"},
               {"-4000000000 a.png\n", "no time and file"},
               {"0\n1 a.png\n", "no time and file"},
               {"1 a.png\n1 b.png\n", "do not rise"},
               {"\n", "names no file"}};
    for (size_t i = 0; i < COUNT_OF(bad); i++) {
        scratch_text(&scratch, "files.txt", bad[i].text);
        EXPECT_STATUS(file_list_read(folder, "files.txt", &list, &count), ERR_INPUT);
        EXPECT_SAYS(bad[i].says);
    }
}

// One vertex: as bytes after the header, or as text.
static enum status read_points(const char *format, const char *type, const void *body, size_t bytes,
                               float (**points)[3], int *count)
{
    static char file[1000];
    const int head = snprintf(file, sizeof file,
                              "ply\nformat %s 1.0\nelement vertex 1\nproperty uchar red\nproperty %s x\nproperty %s y\n"
                              "property %s z\nend_header\n",
                              format, type, type, type);
    memcpy(file + head, body, bytes);
    scratch_write(&scratch, "points.ply", (const uint8_t *)file, (size_t)head + bytes);
    return ply_points_read(scratch_file(&scratch, "points.ply"), points, count);
}

static void test_points(void **state)
{
    (void)state;
    static const char *const texts[] = {"float", "double", "int", "short"}, *const whole[] = {"int", "uint32", "short"};
    const float f[3] = {1.5F, -2, 3};
    const double d[3] = {1.5, -2, 3};
    uint8_t body[1 + sizeof d] = {255};
    float(*points)[3];
    int count;
    for (int wide = 0; wide < 2; wide++) {
        memcpy(body + 1, wide ? (const void *)d : f, wide ? sizeof d : sizeof f);
        EXPECT_STATUS(read_points("binary_little_endian", wide ? "double" : "float32", body,
                                  wide ? sizeof body : 1 + sizeof f, &points, &count),
                      OK);
        EXPECT_INT(count, 1);
        EXPECT_TRUE(!memcmp(points[0], f, sizeof f));
        free(points);
    }
    for (size_t i = 0; i < COUNT_OF(texts); i++) {
        EXPECT_STATUS(read_points("ascii", texts[i], "255 4 -5 6\n", 11, &points, &count), OK);
        EXPECT_TRUE(count == 1 && points[0][1] == -5);
        free(points);
    }
    EXPECT_STATUS(read_points("ascii", "float", "1 2 3 4", 7, &points, &count), OK); // no shorter one holds a point
    EXPECT_TRUE(count == 1 && points[0][2] == 4);
    free(points);
    EXPECT_STATUS(read_points("ascii", "float", "1 2 3 ", 6, &points, &count), ERR_CORRUPT);
    EXPECT_SAYS("ends before its last point");
    // Whole numbers in bytes would be taken for floats: 1 is 1.4e-45 then.
    for (size_t i = 0; i < COUNT_OF(whole); i++) {
        EXPECT_STATUS(read_points("binary_little_endian", whole[i], body, sizeof body, &points, &count), ERR_CORRUPT);
        EXPECT_SAYS("points.ply is no PLY file");
    }
    EXPECT_STATUS(read_points("binary_little_endian", "double", body, 20, &points, &count), ERR_CORRUPT);
    EXPECT_SAYS("ends before its last point");
    EXPECT_STATUS(read_points("binary_big_endian", "float", body, sizeof body, &points, &count), ERR_CORRUPT);
}

static enum status read_rig(const char *motion, struct surround_set *rig)
{
    char text[600];
    snprintf(text, sizeof text,
             "{\"view\": {\"width\": 64, \"height\": 48, \"fx\": 40, \"fy\": 40, \"cx\": 31.5, \"cy\": 23.5},"
             "\"panorama\": {\"projection\": \"equirectangular\", \"body_from_camera\": %s}}",
             motion);
    scratch_text(&scratch, "calibration.json", text);
    return surround_rig_read(rig, scratch_file(&scratch, "calibration.json"));
}

static void test_where_cameras_are_on_a_body(void **state)
{
    (void)state;
    struct surround_set rig;
    EXPECT_STATUS(read_rig("[[0, 0, 1, 0.1], [-1, 0, 0, -0.2], [0, -1, 0, 1.5], [0, 0, 0, 1]]", &rig), OK);
    EXPECT_TRUE(rig.panorama_placed);
    const struct vec3 ahead = pose_apply(rig.body_from_panorama, v3(0, 0, 1)); // x of the body is ahead
    EXPECT_NEAR(ahead.x, 1.1, 1e-9);
    EXPECT_NEAR(ahead.y, -0.2, 1e-9);
    EXPECT_NEAR(ahead.z, 1.5, 1e-9);
    surround_set_free(&rig);
    static const struct {
        const char *motion, *says;
    } bad[] = {{"[[0, 0, 1, 0], [1, 0, 0, 0], [0, -1, 0, 0], [0, 0, 0, 1]]", "no rotation of right-handed axes"},
               {"[[1, 0, 0, 0], [1, 0, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]", "no rotation"},
               {"[[1000, 0, 0, 0], [0, 1000, 0, 0], [0, 0, 1000, 0], [0, 0, 0, 1]]", "no rotation"},
               {"[[1, 0, 0, 0], [0, 1, 0, 1500], [0, 0, 1, 0], [0, 0, 0, 1]]", "1500 m from the body"},
               {"[[1, 0, 0], [0, 1, 0], [0, 0, 1]]", "4 x 4"}};
    for (size_t i = 0; i < COUNT_OF(bad); i++) {
        EXPECT_STATUS(read_rig(bad[i].motion, &rig), ERR_INPUT);
        EXPECT_SAYS(bad[i].says);
    }
}

int main(void)
{
    scratch = scratch_make();
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_pose_lists),
        cmocka_unit_test(test_the_pose_at_a_time),
        cmocka_unit_test(test_file_lists),
        cmocka_unit_test(test_points),
        cmocka_unit_test(test_where_cameras_are_on_a_body),
    };
    const int failed = cmocka_run_group_tests(tests, NULL, NULL);
    scratch_remove(&scratch);
    return failed;
}
