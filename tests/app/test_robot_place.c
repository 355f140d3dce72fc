// Where a robot's world is in a place: panoramas of the rendered room, whose poses in the robot's world are known, are
// found by the room's tags; where they show nothing of it nothing is claimed.
#include "app/place/robot_place.h"
#include "capture/recording/recorded_drive.h"
#include "platform/png.h"
#include "tests/support/film.h"
#include "tests/support/process.h"
#include "tests/support/test.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { HEIGHT = 768, FACE = 512, PANORAMAS = 2 };
static const double PI = 3.14159265358979323846;

// Of six pictures, each of a quarter circle: ahead, right, back, left, up, down.
static struct surround_picture panorama(const struct world *w, struct pose world_from_camera)
{
    static uint8_t faces[6][FACE * FACE * 3];
    const struct vec3 turns[6] = {{0, 0, 0},       {0, PI / 2, 0}, {0, PI, 0},
                                  {0, -PI / 2, 0}, {PI / 2, 0, 0}, {-PI / 2, 0, 0}};
    const double middle = (FACE - 1) / 2.0;
    const struct lens lens = {
        .width = FACE, .height = FACE, .fx = FACE / 2.0, .fy = FACE / 2.0, .cx = middle, .cy = middle};
    struct pose camera_from_face[6];
    for (int k = 0; k < 6; k++) {
        camera_from_face[k] = (struct pose){quat_from_rotation_vector(turns[k]), v3(0, 0, 0)};
        const struct world_shot shot = {lens, pose_multiply(world_from_camera, camera_from_face[k]), 0, false};
        EXPECT_STATUS(world_render(w, &shot, &(struct world_image){.color = faces[k]}), OK);
    }
    uint8_t *rgb = malloc((size_t)HEIGHT * 2 * HEIGHT * 3);
    for (int i = 0; i < 2 * HEIGHT * HEIGHT; i++) {
        const double lon = (i % (2 * HEIGHT) + 0.5) / HEIGHT * PI - PI, down = (i / (2 * HEIGHT) + 0.5) / HEIGHT * PI;
        const struct vec3 ray = v3(sin(down) * sin(lon), -cos(down), sin(down) * cos(lon));
        for (int k = 0; k < 6; k++) {
            const struct vec3 at = pose_apply(pose_inverse(camera_from_face[k]), ray);
            if (at.z < fabs(at.x) - 1e-9 || at.z < fabs(at.y) - 1e-9)
                continue;
            const struct pixel px = lens_project(&lens, at);
            const int x = (int)fmin(fmax(px.x + 0.5, 0), FACE - 1), y = (int)fmin(fmax(px.y + 0.5, 0), FACE - 1);
            memcpy(rgb + 3 * (size_t)i, faces[k] + 3 * (y * FACE + x), 3);
            break;
        }
    }
    struct surround_picture p;
    EXPECT_STATUS(surround_picture_make(&p, rgb, 2 * HEIGHT, HEIGHT, NULL), OK);
    return p;
}

// The robot's world against the room's; its head in its body's axes, x ahead, y left, z up; where its body went.
static const struct pose truth = {{0, 0, 0.867423226, 0.497571048}, {0.4, -0.7, 0}};
static const struct pose body_from_head = {{-0.5, 0.5, -0.5, 0.5}, {0, 0, 1.2}};
static const struct pose robot_from_body[PANORAMAS] = {{{0, 0, 0, 1}, {0, 0, 0}}, {{0, 0, 0, 1}, {0.8, 0.3, 0}}};

static struct world *world;
static struct place place;
static struct surround_picture pictures[PANORAMAS];

static int make(void **state)
{
    (void)state;
    struct world_options options = world_default_options();
    options.threads = 2;
    if (world_open(&world, &options) != OK)
        return 1;
    place = film_true_place(world, 1);
    for (int i = 0; i < PANORAMAS; i++) {
        const struct pose robot_from_head = pose_multiply(robot_from_body[i], body_from_head);
        pictures[i] = panorama(world, pose_multiply(truth, robot_from_head));
        surround_picture_place(&pictures[i], robot_from_head);
    }
    return 0;
}

static int tidy(void **state)
{
    (void)state;
    for (int i = 0; i < PANORAMAS; i++)
        surround_picture_free(&pictures[i]);
    place_free(&place);
    world_close(&world);
    return 0;
}

// A folder of captures without depth is played, and where the robot went is in the place's recording afterwards.
static void test_a_drive_is_kept_in_the_place(void **state)
{
    (void)state;
    struct scratch scratch = scratch_make();
    struct recording_writer *writer;
    struct recording *r;
    struct recorded_drive drive;
    char uri[300], file[256], out[256];
    snprintf(uri, sizeof uri, "folder:%s/robot", scratch.path);
    snprintf(file, sizeof file, "%s", scratch_file(&scratch, "room.reenact"));
    snprintf(out, sizeof out, "%s", scratch_file(&scratch, "out"));
    EXPECT_STATUS(recording_create(&writer, file), OK);
    EXPECT_STATUS(recording_put_place(writer, &place), OK);
    EXPECT_STATUS(recording_close(&writer), OK);
    scratch_text(&scratch, "robot/calibration.json",
                 "{\"body\": {\"length_m\": 0.7, \"width_m\": 0.5, \"height_m\": 1.3}, "
                 "\"view\": {\"width\": 64, \"height\": 48, \"fx\": 40, \"fy\": 40, \"cx\": 31.5, \"cy\": 23.5}, "
                 "\"panorama\": {\"projection\": \"equirectangular\", \"body_from_camera\": "
                 "[[0, 0, 1, 0], [-1, 0, 0, 0], [0, -1, 0, 1.2], [0, 0, 0, 1]]}}");
    scratch_text(&scratch, "robot/panorama.txt", "10.0 0.png\n11.0 1.png\n");
    scratch_text(&scratch, "robot/odometry.txt", "10.0 0 0 0 0 0 0 1\n11.0 0.8 0.3 0 0 0 0 1\n");
    for (int i = 0; i < PANORAMAS; i++)
        EXPECT_STATUS(png_write(scratch_file(&scratch, i ? "robot/1.png" : "robot/0.png"), PNG_RGB8, pictures[i].rgb,
                                pictures[i].width, pictures[i].height),
                      OK);
    const struct process_result p =
        PROCESS(PROGRAM_DIR "/reenact", "drive", uri, file, "--keep", "--out", out, "--seconds", "1");
    if (p.exit_code)
        print_error("%s\n", p.err);
    EXPECT_INT(p.exit_code, 0);
    EXPECT_STATUS(recording_open(&r, file), OK);
    EXPECT_STATUS(recording_read_drive(r, &drive), OK);
    recording_free(&r);
    const struct pose wanted = pose_multiply(truth, robot_from_body[1]);
    print_message("kept: off by %.1f mm, %d points\n",
                  1e3 * v3_distance(drive.world_from_body.translation, wanted.translation), drive.path_count);
    EXPECT_AT_MOST(v3_distance(drive.world_from_body.translation, wanted.translation), 0.02);
    EXPECT_AT_MOST(pose_angle(drive.world_from_body, wanted), 0.01);
    EXPECT_AT_LEAST(drive.path_count, 2);
    EXPECT_AT_MOST(v3_distance(drive.path[0], truth.translation), 0.02);
    EXPECT_NEAR(drive.size_m[0], 0.7, 1e-12);
    // Another robot sees nothing of the room: that is said, and what was kept stays.
    const char *elsewhere = scratch_file(&scratch, "elsewhere");
    const struct process_result sim =
        PROCESS(PROGRAM_DIR "/reenact", "drive", "sim:", file, "--keep", "--out", elsewhere, "--seconds", "0.5");
    EXPECT_INT(sim.exit_code, 1);
    EXPECT_TRUE(strstr(sim.err, "too little of the place"));
    EXPECT_INT(PROCESS(PROGRAM_DIR "/reenact", "drive", "sim:", "--keep", "--out", out).exit_code, 2);
    scratch_remove(&scratch);
}

static void test_the_robot_is_found_in_its_place(void **state)
{
    (void)state;
    struct pose found;
    EXPECT_STATUS(robot_place_find(pictures, PANORAMAS, &place, &found), OK);
    print_message("off by %.1f mm and %.2f degrees\n", 1e3 * v3_distance(found.translation, truth.translation),
                  pose_angle(found, truth) * 180 / PI);
    EXPECT_AT_MOST(v3_distance(found.translation, truth.translation), 0.02);
    EXPECT_AT_MOST(pose_angle(found, truth), 0.01);
    for (int i = 0; i < PANORAMAS; i++)
        memset(pictures[i].rgb, 128, (size_t)HEIGHT * 2 * HEIGHT * 3);
    EXPECT_STATUS(robot_place_find(pictures, PANORAMAS, &place, &found), NOTHING);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_a_drive_is_kept_in_the_place),
        cmocka_unit_test(test_the_robot_is_found_in_its_place), // last: it empties the pictures
    };
    return cmocka_run_group_tests(tests, make, tidy);
}
