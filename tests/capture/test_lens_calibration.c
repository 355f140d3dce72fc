// A lens from rendered pictures of boards of circles and chequers, also by the command, and a rolling shutter's
// read-out from a swing before a tag of the small world.
#include "tests/support/test.h"

#include "capture/calibration/lens_calibration.h"
#include "locate/tag_corners.h"
#include "platform/files/json.h"
#include "platform/files/png.h"
#include "platform/vision/tag_detector.h"
#include "tests/support/process.h"
#include "tests/support/scratch.h"
#include "tests/world/world.h"

#include <stdio.h>

static const struct lens true_lens = {.width = 640,
                                      .height = 480,
                                      .fx = 548.3,
                                      .fy = 546.1,
                                      .cx = 322.4,
                                      .cy = 236.7,
                                      .k1 = -0.09,
                                      .k2 = 0.06,
                                      .p1 = 0.0007,
                                      .p2 = -0.0004};

static double luma(const struct stereo_board *b, bool chequers, struct pose board_from_camera, struct vec3 ray)
{
    const struct vec3 from = board_from_camera.translation, along = quat_rotate(board_from_camera.rotation, ray);
    const double t = -from.z / along.z, x = (from.x + t * along.x) / b->pitch_m,
                 y = (from.y + t * along.y) / b->pitch_m;
    const double c = round(x), r = round(y);
    if (chequers) // squares between the corners, and one more all round
        return x < -1.5 || y < -1.5 || x > b->columns + 0.5 || y > b->rows + 0.5 ? 130
               : x < -1 || y < -1 || x > b->columns || y > b->rows               ? 225
               : ((int)floor(x) + (int)floor(y)) % 2                             ? 225
                                                                                 : 25;
    if (c >= 0 && r >= 0 && c < b->columns && r < b->rows && hypot(x - c, y - r) < 0.3)
        return 25;
    return x > -1 && y > -1 && x < b->columns && y < b->rows ? 225 : 130;
}

static void render_board(const struct stereo_board *b, bool chequers, struct pose camera_from_board, uint64_t seed,
                         uint8_t *rgb)
{
    const struct pose board_from_camera = pose_inverse(camera_from_board);
    for (int y = 0; y < true_lens.height; y++)
        for (int x = 0; x < true_lens.width; x++) {
            double sum = 0;
            for (int i = 0; i < 9; i++)
                sum += luma(b, chequers, board_from_camera,
                            lens_ray(&true_lens, (struct pixel){x + (i % 3 - 1) / 3.0, y + (i / 3 - 1) / 3.0}));
            memset(rgb + 3 * (y * true_lens.width + x), (int)(sum / 9 + 0.5), 3);
        }
    world_color_noise(rgb, true_lens.width, true_lens.height, seed);
}

static struct pose tilted_pose(struct rng *rng)
{
    const double tilt = rng_between(rng, -0.6, 0.6), pan = rng_between(rng, -0.6, 0.6), z = rng_between(rng, 0.28, 0.4),
                 x = rng_between(rng, -0.05, 0.05), y = rng_between(rng, -0.04, 0.04);
    const struct quat turn = quat_from_rotation_vector(v3(tilt, pan, rng_between(rng, -0.3, 0.3)));
    return (struct pose){turn, v3_add(v3(x, y, z), quat_rotate(turn, v3(-0.09, -0.06, 0)))};
}

static void calibrate_by(bool chequers)
{
    static uint8_t rgb[3 * 640 * 480];
    const struct stereo_board board = {10, 7, 0.02};
    struct lens_calibration c;
    struct lens_report report;
    struct lens lens;
    struct rng rng = {11};
    bool used;
    lens_calibration_start(&c, &board, 640, 480);
    c.chequers = chequers;
    for (int i = 0; i < 12; i++) {
        render_board(&board, chequers, tilted_pose(&rng), (uint64_t)i + 1, rgb);
        EXPECT_STATUS(lens_calibration_add(&c, rgb, &used), OK);
        if (i == 3) { // the same once more says nothing new
            EXPECT_STATUS(lens_calibration_add(&c, rgb, &used), OK);
            EXPECT_TRUE(!used);
            EXPECT_STATUS(lens_calibration_solve(&c, &lens, &report), ERR_INPUT);
            EXPECT_SAYS("at least");
        }
    }
    EXPECT_STATUS(lens_calibration_solve(&c, &lens, &report), OK);
    printf("%s: %d views, %d points: %.3f px; fx %.2f fy %.2f cx %.2f cy %.2f k1 %.4f; focal lengths to %.3f %%\n",
           chequers ? "chequers" : "circles", report.views, report.circles, report.rms_px, lens.fx, lens.fy, lens.cx,
           lens.cy, lens.k1, report.focal_sigma * 100);
    EXPECT_AT_MOST(report.rms_px, 0.15);
    EXPECT_NEAR(lens.fx / true_lens.fx, 1, 0.003);
    EXPECT_NEAR(lens.fy / true_lens.fy, 1, 0.003);
    EXPECT_NEAR(lens.cx, true_lens.cx, 1.5);
    EXPECT_NEAR(lens.cy, true_lens.cy, 1.5);
    lens_calibration_free(&c);
}

static void test_a_lens_by_circles(void **state)
{
    (void)state;
    calibrate_by(false);
}

static void test_a_lens_by_chequers(void **state)
{
    (void)state;
    calibrate_by(true);
}

// Its JSON is all that it writes, and has the result where no device keeps it.
static void test_the_command(void **state)
{
    (void)state;
    enum { VIEWS = 12 };
    static uint8_t rgb[3 * 640 * 480];
    const struct stereo_board board = {10, 7, 0.02};
    struct scratch scratch = scratch_make();
    struct rng rng = {11};
    char uri[240], list[VIEWS * 16] = "";
    for (int i = 0; i < VIEWS; i++) {
        char name[16];
        snprintf(name, sizeof name, "%d.png", i);
        snprintf(list + strlen(list), sizeof list - strlen(list), "%d %s\n", i, name);
        render_board(&board, false, tilted_pose(&rng), (uint64_t)i + 1, rgb);
        EXPECT_STATUS(png_write(scratch_file(&scratch, name), PNG_RGB8, rgb, 640, 480), OK);
    }
    scratch_text(&scratch, "rgb.txt", list);
    scratch_text(&scratch, "calibration.json",
                 "{\"color\": {\"width\": 640, \"height\": 480, \"fx\": 500, \"fy\": 500, \"cx\": 320, \"cy\": 240}}");
    snprintf(uri, sizeof uri, "folder:%s", scratch.path);
    const struct process_result p = PROCESS(PROGRAM_DIR "/reenact-capture", "calibrate", "--lens", uri, "--circles",
                                            "10x7", "--views", "12", "--json");
    print_message("%s%s", p.out, p.err);
    EXPECT_INT(p.exit_code, 0);
    struct json *root;
    bool kept = true;
    double views, fx;
    EXPECT_STATUS(json_parse(p.out, strlen(p.out), "the command's output", &root), OK);
    EXPECT_STATUS(json_need_number(root, "views", "the output", &views), OK);
    EXPECT_TRUE(json_get_bool(json_member(root, "kept"), &kept) && !kept);
    const struct json *color = json_member(json_member(root, "calibration"), "color");
    EXPECT_STATUS(json_need_number(color, "fx", "the output", &fx), OK);
    EXPECT_NEAR(views, VIEWS, 0);
    EXPECT_NEAR(fx / true_lens.fx, 1, 0.003);
    json_free(&root);
    scratch_remove(&scratch);
}

// ---------------------------------------------------------------- rolling shutter

// A camera on a wrist: turned left and right, faster than it is carried.
static struct pose swing(const void *context, double time_s)
{
    const struct pose *still = context;
    const double pan = 0.16 * sin(2 * 3.14159265 * 0.9 * time_s), tilt = 0.02 * sin(2 * 3.14159265 * 0.4 * time_s);
    const struct pose turn = {quat_from_rotation_vector(v3(tilt, pan, 0)), v3(0.02 * sin(5 * time_s), 0, 0)};
    return pose_multiply(*still, turn);
}

static void test_a_rolling_shutter(void **state)
{
    (void)state;
    static struct readout r;
    struct world *world;
    struct world_options o = world_default_options();
    int32_t count;
    o.motion = "still";
    o.bare = true;
    EXPECT_STATUS(world_open(&world, &o), OK);
    const struct place_tag *tag = world_tags(world, &count);
    // A metre before the first tag on a wall, facing it.
    const struct vec3 out = quat_rotate(tag->world_from_tag.rotation, v3(0, 0, 1)),
                      at = tag->world_from_tag.translation;
    const struct world_stand stand = {v3_add(at, v3_scale(out, 0.9)), at, 0};
    const struct pose still = world_stand_pose(&stand);
    const double readouts[] = {0.025, 0};
    for (int which = 0; which < 2; which++) {
        struct lens lens = world_viewer_calibration(1).color;
        struct tag_detector *detector;
        double found_s = -1;
        struct readout_report report;
        const size_t pixels = (size_t)lens.width * (size_t)lens.height;
        uint8_t *rgb = malloc(3 * pixels), *gray = malloc(pixels);
        r = (struct readout){.lens = lens};
        lens.readout_s = readouts[which];
        EXPECT_STATUS(tag_detector_open(&detector, 1), OK);
        for (int i = 0; i < 45; i++) {
            struct tag_detection seen[4];
            int n;
            const struct world_shot shot = {lens, still, 0, false};
            struct world_image image = {.color = rgb};
            if (readouts[which] > 0)
                EXPECT_STATUS(world_render_rolling(world, &shot, swing, &still, i / 30.0, &image), OK);
            else {
                struct world_shot still_shot = shot;
                still_shot.world_from_camera = swing(&still, i / 30.0);
                EXPECT_STATUS(world_render(world, &still_shot, &image), OK);
            }
            gray_from_rgb(rgb, pixels, gray);
            EXPECT_STATUS(
                tag_detector_detect(detector, &(struct gray_image){gray, lens.width, lens.height}, seen, 4, &n), OK);
            for (int k = 0; k < n; k++)
                if (seen[k].id == tag->id)
                    readout_add(&r, i / 30.0, seen[k].id, seen[k].corner);
        }
        EXPECT_STATUS(readout_solve(&r, &found_s, &report), OK);
        printf(
            "read-out %.1f ms, found %.2f ms (sigma %.2f); %d frames, %.2f px, up to %.0f px/s, sheared by %.1f px\n",
            readouts[which] * 1e3, found_s * 1e3, report.sigma_s * 1e3, report.frames, report.rms_px,
            report.fastest_px_per_s, report.bend_px);
        EXPECT_NEAR(found_s, readouts[which], 0.002);
        tag_detector_close(&detector);
        free(rgb);
        free(gray);
    }
    r.count = 10;
    double none;
    struct readout_report report;
    EXPECT_STATUS(readout_solve(&r, &none, &report), ERR_INPUT);
    EXPECT_SAYS("pictures");
    world_close(&world);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_a_lens_by_circles),
        cmocka_unit_test(test_a_lens_by_chequers),
        cmocka_unit_test(test_the_command),
        cmocka_unit_test(test_a_rolling_shutter),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
