// Stereo calibration on drawn boards of circles: lenses and baseline against the truth, boards cut off by the edge, and
// what is said when it cannot work.
#include "tests/support/test.h"

#include "capture/calibration/stereo_rig.h"
#include "platform/files/file.h"
#include "tests/support/scratch.h"

#include <stdio.h>

enum { VIEWS = 8, WIDTH = 320, HEIGHT = 240, COLUMNS = 7, ROWS = 5, SEED = 5 };
#define PITCH 0.025

static uint8_t gray[WIDTH * HEIGHT];

static struct stereo_rig truth(void)
{
    return (struct stereo_rig){
        .left = {.width = WIDTH, .height = HEIGHT, .fx = 330, .fy = 331, .cx = 158, .cy = 121, .k1 = -0.2, .k2 = 0.05},
        .right =
            {.width = WIDTH, .height = HEIGHT, .fx = 327, .fy = 326, .cx = 162, .cy = 119, .k1 = -0.18, .k2 = 0.04},
        .left_from_right = {quat_from_rotation_vector(v3(0.01, -0.02, 0.01)), v3(0.07, 0.001, -0.002)}};
}

static int level(struct vec3 from, struct vec3 ray)
{
    const double t = -from.z / ray.z;
    const struct vec3 p = v3_add(from, v3_scale(ray, t));
    const double x = p.x / PITCH, y = p.y / PITCH;
    if (!(t > 0) || x < -1 || y < -1 || x > COLUMNS || y > ROWS)
        return 120; // behind the board
    const double dx = x - floor(x + 0.5), dy = y - floor(y + 0.5);
    const bool on = floor(x + 0.5) >= 0 && floor(y + 0.5) >= 0 && floor(x + 0.5) < COLUMNS && floor(y + 0.5) < ROWS;
    return on && dx * dx + dy * dy < 0.3 * 0.3 ? 15 : 215;
}

// 4 x 4 rays a pixel.
static void draw(const struct lens *lens, struct pose camera_from_board, struct rng *rng)
{
    const struct pose board_from_camera = pose_inverse(camera_from_board);
    for (int y = 0; y < HEIGHT; y++)
        for (int x = 0; x < WIDTH; x++) {
            double sum = 0;
            for (int k = 0; k < 16; k++) {
                const struct vec3 ray = lens_ray(lens, (struct pixel){x + (k % 4 - 1.5) / 4, y + (k / 4 - 1.5) / 4});
                sum += level(board_from_camera.translation, quat_rotate(board_from_camera.rotation, ray)) / 16.0;
            }
            const double noise = rng_between(rng, -2, 2);
            gray[y * WIDTH + x] = (uint8_t)(sum + noise + 0.5);
        }
}

static struct circle circles[VIEWS][2][STEREO_MAX_CIRCLES];

static void see(struct stereo_view views[VIEWS], double tilt, double shift)
{
    const struct stereo_rig rig = truth();
    struct rng rng = {SEED};
    print_message("seed %d\n", SEED);
    for (int v = 0; v < VIEWS; v++) {
        const double yaw = rng_between(&rng, -tilt, tilt), pitch = rng_between(&rng, -tilt, tilt);
        const double roll = rng_between(&rng, -0.3, 0.3), away = rng_between(&rng, 0.3, 0.45);
        const double x = rng_between(&rng, -shift, shift), y = rng_between(&rng, -shift / 2, shift / 2);
        const struct quat turn =
            quat_multiply(quat_from_rotation_vector(v3(pitch, yaw, 0)), quat_from_rotation_vector(v3(0, 0, roll)));
        const struct vec3 middle = quat_rotate(turn, v3((COLUMNS - 1) * PITCH / 2, (ROWS - 1) * PITCH / 2, 0));
        const struct pose left = {turn, v3_sub(v3(0.03 + x, y, away), middle)};
        for (int c = 0; c < 2; c++) {
            const struct pose p = c ? pose_multiply(pose_inverse(rig.left_from_right), left) : left;
            draw(c ? &rig.right : &rig.left, p, &rng);
            views[v].circles[c] = circles[v][c];
            EXPECT_STATUS(stereo_circles_find(gray, WIDTH, HEIGHT, circles[v][c], &views[v].count[c]), OK);
        }
    }
}

static const struct stereo_board board = {COLUMNS, ROWS, PITCH};

static void test_lenses_and_baseline(void **state)
{
    (void)state;
    struct stereo_view views[VIEWS];
    struct stereo_rig rig;
    const struct stereo_rig want = truth();
    struct stereo_report report;
    see(views, 0.6, 0.05);
    EXPECT_STATUS(stereo_calibrate(&board, views, VIEWS, WIDTH, HEIGHT, &rig, &report), OK);
    EXPECT_AT_MOST(report.rms_px[0], 0.1);
    EXPECT_AT_MOST(report.rms_px[1], 0.1);
    EXPECT_NEAR(rig.left.fx / want.left.fx, 1, 0.003);
    EXPECT_NEAR(rig.left.fy / want.left.fy, 1, 0.003);
    EXPECT_NEAR(rig.right.fx / want.right.fx, 1, 0.003);
    EXPECT_NEAR(rig.right.fy / want.right.fy, 1, 0.003);
    EXPECT_NEAR(report.baseline_m, v3_length(want.left_from_right.translation), 0.0002);
    EXPECT_AT_MOST(pose_angle(rig.left_from_right, want.left_from_right), 0.004);
    EXPECT_AT_LEAST(report.views, 6);
    EXPECT_AT_MOST(report.baseline_sigma_m, 0.0002);
}

static void test_what_is_said(void **state)
{
    (void)state;
    struct stereo_view views[VIEWS] = {{{circles[0][0], circles[0][1]}, {0, 0}, NULL}};
    struct stereo_rig rig;
    struct stereo_report report;
    for (int v = 0; v < VIEWS; v++)
        views[v] = (struct stereo_view){{circles[v][0], circles[v][1]}, {0, 0}, NULL};
    EXPECT_STATUS(stereo_calibrate(&board, views, VIEWS, WIDTH, HEIGHT, &rig, &report), ERR_INPUT);
    EXPECT_TRUE(strstr(status_message(), "at least 4") != NULL);
    int count;
    memset(gray, 128, sizeof gray);
    EXPECT_STATUS(stereo_circles_find(gray, WIDTH, HEIGHT, circles[0][0], &count), OK);
    EXPECT_INT(count, 0);
}

static void expect_folder_fault(const struct scratch *scratch, const char *board_json, const char *says)
{
    struct stereo_rig rig;
    struct stereo_report report;
    int pairs;
    scratch_text(scratch, "board.json", board_json);
    EXPECT_STATUS(stereo_calibrate_folder(scratch_file(scratch, "."), &rig, &report, &pairs), ERR_INPUT);
    EXPECT_SAYS(says);
}

static void test_faults_of_a_folder(void **state)
{
    (void)state;
    enum { MORE_THAN_MOST = 513 };
    struct scratch scratch = scratch_make();
    EXPECT_STATUS(folder_make(scratch_file(&scratch, "left")), OK);
    expect_folder_fault(&scratch, "{\"columns\": 7.5, \"rows\": 5, \"pitch_m\": 0.02}", "whole columns and rows");
    expect_folder_fault(&scratch, "{\"columns\": 1e300, \"rows\": 5, \"pitch_m\": 0.02}", "whole columns and rows");
    const char *good = "{\"columns\": 7, \"rows\": 5, \"pitch_m\": 0.02}";
    expect_folder_fault(&scratch, good, "is empty");
    char name[200] = "left/";
    memset(name + 5, 'a', 130);
    scratch_text(&scratch, name, "");
    expect_folder_fault(&scratch, good, "is longer than 127 bytes");
    EXPECT_TRUE(!remove(scratch_file(&scratch, name)));
    for (int i = 0; i < MORE_THAN_MOST; i++) {
        snprintf(name, sizeof name, "left/%03d.png", i);
        scratch_text(&scratch, name, "");
    }
    expect_folder_fault(&scratch, good, "more than 512 pictures");
    scratch_remove(&scratch);
}

static void test_a_rig_is_read_as_written(void **state)
{
    (void)state;
    struct scratch scratch = scratch_make();
    struct stereo_rig rig = truth(), back;
    rig.error_at_1m = (struct covariance3){1e-7, 2e-8, 0, 2e-7, 0, 3e-7};
    char *text = stereo_rig_print(&rig);
    scratch_text(&scratch, "rig.json", text);
    free(text);
    EXPECT_STATUS(stereo_rig_read(scratch_file(&scratch, "rig.json"), &back), OK);
    EXPECT_TRUE(lens_equal(&rig.left, &back.left) && lens_equal(&rig.right, &back.right));
    EXPECT_NEAR(pose_angle(rig.left_from_right, back.left_from_right), 0, 1e-7);
    EXPECT_NEAR(back.error_at_1m.yy, 2e-7, 1e-20);
    scratch_text(&scratch, "bad.json", "{\"left\": {\"K\": [[1,0,0],[0,1,0]]}}");
    EXPECT_STATUS(stereo_rig_read(scratch_file(&scratch, "bad.json"), &back), ERR_INPUT);
    rig.left_from_right.translation.x = 101;
    text = stereo_rig_print(&rig);
    scratch_text(&scratch, "far.json", text);
    free(text);
    EXPECT_STATUS(stereo_rig_read(scratch_file(&scratch, "far.json"), &back), ERR_INPUT);
    EXPECT_SAYS("101 m apart");
    scratch_remove(&scratch);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_lenses_and_baseline),
        cmocka_unit_test(test_what_is_said),
        cmocka_unit_test(test_faults_of_a_folder),
        cmocka_unit_test(test_a_rig_is_read_as_written),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
