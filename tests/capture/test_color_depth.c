// Colour to depth on a rendered board of discs with a Kinect's noise: the pose is found; what is wrong is said.
#include "tests/support/test.h"

#include "capture/calibration/color_depth.h"
#include "tests/world/world.h"

#include <stdio.h>

enum { WIDTH = 640, HEIGHT = 480 };
static const double PITCH_M = 0.12;

struct scene {
    struct disc_board board;
    struct pose depth_from_board; // the board's plane is z = 0, its discs at z = -standoff, towards the camera
};

// What a ray from the camera meets: depth along z, and how bright.
static double meet(const struct scene *s, struct pose board_from_camera, struct vec3 ray, double *luma)
{
    const struct vec3 from = board_from_camera.translation, along = quat_rotate(board_from_camera.rotation, ray);
    const double w = 0.5 * (s->board.columns - 1) * PITCH_M, h = 0.5 * (s->board.rows - 1) * PITCH_M;
    double t = (-s->board.standoff_m - from.z) / along.z;
    struct vec3 p = v3_add(from, v3_scale(along, t));
    const double c = round((p.x + w) / PITCH_M), r = round((p.y + h) / PITCH_M);
    if (t > 0 && c >= 0 && r >= 0 && c < s->board.columns && r < s->board.rows &&
        hypot(p.x + w - c * PITCH_M, p.y + h - r * PITCH_M) < s->board.radius_m) {
        *luma = 28;
        return t;
    }
    t = -from.z / along.z;
    p = v3_add(from, v3_scale(along, t));
    if (t > 0 && fabs(p.x) < w + 0.09 && fabs(p.y) < h + 0.09) {
        *luma = 222;
        return t;
    }
    *luma = 120;
    return 3 / ray.z;
}

static void render(const struct scene *s, const struct calibration *k, struct pose color_from_depth, uint64_t seed,
                   uint8_t *rgb, uint16_t *depth)
{
    const struct pose board_from_depth = pose_inverse(s->depth_from_board),
                      board_from_color = pose_multiply(board_from_depth, pose_inverse(color_from_depth));
    double luma;
    for (int y = 0; y < HEIGHT; y++)
        for (int x = 0; x < WIDTH; x++) {
            double sum = 0;
            for (int i = 0; i < 16; i++) {
                const struct pixel px = {x + (i % 4 - 1.5) / 4, y + (i / 4 - 1.5) / 4};
                meet(s, board_from_color, lens_ray(&k->color, px), &luma);
                sum += luma;
            }
            memset(rgb + 3 * (y * WIDTH + x), (int)(sum / 16 + 0.5), 3);
            depth[y * WIDTH + x] =
                (uint16_t)(1e3 * meet(s, board_from_depth, lens_ray(&k->depth, (struct pixel){x, y}), &luma) + 0.5);
        }
    world_color_noise(rgb, WIDTH, HEIGHT, seed);
    EXPECT_STATUS(world_depth_noise(&k->depth, depth, seed, depth), OK);
}

static struct calibration the_calibration(void)
{
    struct calibration k = world_calibration(1);
    k.depth.fx = k.depth.fy = 575;
    k.registered = false;
    k.color_from_depth = POSE_IDENTITY;
    return k;
}

static const struct pose truth = {{0.004, -0.009, 0.003, 0.99994}, {0.0252, -0.0021, 0.0013}};

struct film {
    int views;
    double distance_m; // of the first, the last is half as much farther
    bool swapped;      // each depth image goes with another's colour
};

static uint8_t rgb[2][3 * WIDTH * HEIGHT];
static uint16_t depth[2][WIDTH * HEIGHT];

static enum status calibrate(const struct film *film, struct pose *found, struct color_depth_report *report)
{
    const struct calibration k = the_calibration();
    const struct disc_board board = disc_board_default();
    const struct pose color_from_depth = {quat_unit(truth.rotation), truth.translation};
    struct color_depth c;
    struct rng rng = {7};
    EXPECT_STATUS(color_depth_start(&c, &k, &board), OK);
    for (int i = 0; i < film->views; i++) {
        const double tilt = rng_between(&rng, -0.4, 0.4), pan = rng_between(&rng, -0.4, 0.4),
                     z = film->distance_m * (1 + 0.5 * i / film->views), x = rng_between(&rng, -0.12, 0.12) * z,
                     y = rng_between(&rng, -0.08, 0.08) * z;
        const struct scene s = {board, {quat_from_rotation_vector(v3(tilt, pan, 0.05 * tilt)), v3(x, y, z)}};
        enum color_depth_seen seen;
        render(&s, &k, color_from_depth, (uint64_t)i + 1, rgb[i % 2], depth[i % 2]);
        if (!film->swapped || i)
            EXPECT_STATUS(color_depth_add(&c, rgb[(i + film->swapped) % 2], depth[i % 2], &seen), OK);
    }
    printf("%d frames: %d with the board in both, %d not in colour, %d not in depth, %d too far\n", c.frames, c.views,
           c.no_color, c.no_depth, c.too_far);
    enum status status = color_depth_solve(&c, found, report);
    color_depth_free(&c);
    return status;
}

static void test_the_pose_is_found(void **state)
{
    (void)state;
    struct pose found;
    struct color_depth_report r;
    EXPECT_STATUS(calibrate(&(struct film){12, 0.8, false}, &found, &r), OK);
    const struct pose off =
        pose_multiply(found, pose_inverse((struct pose){quat_unit(truth.rotation), truth.translation}));
    const double off_mm = v3_distance(found.translation, truth.translation) * 1e3,
                 off_deg = v3_length(quat_to_rotation_vector(off.rotation)) * 57.2958;
    printf("%d views, %d points: %.3f px, %.2f mm; off by %.2f mm (said: sigma %.2f), %.3f degrees (%.3f)\n", r.views,
           r.points, r.rms_px, r.rms_mm, off_mm, r.sigma_mm, off_deg, r.sigma_deg);
    EXPECT_INT(r.views, 12);
    EXPECT_AT_MOST(off_mm, 1.5);
    EXPECT_AT_MOST(off_deg, 0.1);
}

static void test_what_is_wrong_is_said(void **state)
{
    (void)state;
    struct pose found;
    struct color_depth_report r;
    EXPECT_STATUS(calibrate(&(struct film){4, 0.8, false}, &found, &r), ERR_INPUT);
    EXPECT_SAYS("only 4 of 4");
    EXPECT_STATUS(calibrate(&(struct film){8, 4.5, false}, &found, &r), ERR_INPUT);
    EXPECT_SAYS("too far");
    EXPECT_STATUS(calibrate(&(struct film){12, 0.8, true}, &found, &r), ERR_INPUT);
    printf("swapped: %s\n", status_message());
    EXPECT_SAYS("colour and depth");
    struct color_depth c;
    struct calibration k = the_calibration();
    const struct disc_board board = disc_board_default();
    k.depth.width = 0;
    EXPECT_STATUS(color_depth_start(&c, &k, &board), ERR_INPUT);
    EXPECT_SAYS("only colour");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_the_pose_is_found),
        cmocka_unit_test(test_what_is_wrong_is_said),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
