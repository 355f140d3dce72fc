// Where a robot's world is in a place: panoramas of the rendered room, whose poses in the robot's world are known, are
// found by the room's tags; where they show nothing of it nothing is claimed.
#include "tests/support/test.h"

#include "app/place/robot_place.h"
#include "base/clock.h"
#include "recording/recorded_things.h"
#include "tests/support/film.h"
#include "tests/support/process.h"
#include "tests/support/robot_film.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const double PI = 3.14159265358979323846;

static struct world *world;
static struct place place;
static struct surround_picture pictures[ROBOT_CAPTURES];

static int make(void **state)
{
    (void)state;
    struct world_options options = world_default_options();
    options.threads = 2;
    if (world_open(&world, &options) != OK)
        return 1;
    place = film_true_place(world, 1);
    for (int i = 0; i < ROBOT_CAPTURES; i++)
        pictures[i] = robot_panorama(world, i);
    return 0;
}

static int tidy(void **state)
{
    (void)state;
    for (int i = 0; i < ROBOT_CAPTURES; i++)
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
    robot_film(&scratch, "robot", pictures, NULL);
    const struct process_result p =
        PROCESS(PROGRAM_DIR "/reenact", "drive", uri, file, "--keep", "--out", out, "--seconds", "1");
    if (p.exit_code)
        print_error("%s\n", p.err);
    EXPECT_INT(p.exit_code, 0);
    EXPECT_STATUS(recording_open(&r, file), OK);
    EXPECT_STATUS(recording_read_drive(r, &drive), OK);
    recording_free(&r);
    const struct pose wanted = pose_multiply(robot_truth, robot_world_from_body[1]);
    print_message("kept: off by %.1f mm, %d points\n",
                  1e3 * v3_distance(drive.world_from_body.translation, wanted.translation), drive.path_count);
    EXPECT_AT_MOST(v3_distance(drive.world_from_body.translation, wanted.translation), 0.02);
    EXPECT_AT_MOST(pose_angle(drive.world_from_body, wanted), 0.01);
    EXPECT_AT_LEAST(drive.path_count, 2);
    EXPECT_AT_MOST(v3_distance(drive.path[0], robot_truth.translation), 0.02);
    EXPECT_NEAR(drive.size_m[0], ROBOT_SIZE_M[0], 1e-12);
    // Another robot sees nothing of the room: that is said, and what was kept stays.
    const char *elsewhere = scratch_file(&scratch, "elsewhere");
    const struct process_result sim =
        PROCESS(PROGRAM_DIR "/reenact", "drive", "sim:", file, "--keep", "--out", elsewhere, "--seconds", "0.5");
    EXPECT_INT(sim.exit_code, 1);
    EXPECT_TRUE(strstr(sim.err, "too little of the place"));
    EXPECT_INT(PROCESS(PROGRAM_DIR "/reenact", "drive", "sim:", "--keep", "--out", out).exit_code, 2);
    const struct process_result stage =
        PROCESS(PROGRAM_DIR "/reenact", "drive", "sim:3x", "--out", elsewhere, "--seconds", "0.5");
    EXPECT_INT(stage.exit_code, 1);
    EXPECT_TRUE(strstr(stage.err, "not '3x'"));
    scratch_remove(&scratch);
}

static void test_the_robot_is_found_in_its_place(void **state)
{
    (void)state;
    struct pose found;
    EXPECT_STATUS(robot_place_find(pictures, ROBOT_CAPTURES, &place, &found), OK);
    print_message("off by %.1f mm and %.2f degrees\n", 1e3 * v3_distance(found.translation, robot_truth.translation),
                  pose_angle(found, robot_truth) * 180 / PI);
    EXPECT_AT_MOST(v3_distance(found.translation, robot_truth.translation), 0.02);
    EXPECT_AT_MOST(pose_angle(found, robot_truth), 0.01);
    for (int i = 0; i < ROBOT_CAPTURES; i++)
        memset(pictures[i].rgb, 128, (size_t)ROBOT_PANORAMA * 2 * ROBOT_PANORAMA * 3);
    EXPECT_STATUS(robot_place_find(pictures, ROBOT_CAPTURES, &place, &found), NOTHING);
}

// Offers `count` captures until the finder has looked at `looked` of them; returns what it then knows.
static struct robot_place_answer wait_looked(struct robot_place_finder *f, const struct surround_picture *all,
                                             int count, int looked)
{
    struct robot_place_answer answer = {0};
    for (int64_t until = clock_now_ns() + 60000000000; answer.looked < looked && clock_now_ns() < until;) {
        robot_place_finder_update(f, all, count, &answer);
        clock_sleep_until_ns(clock_now_ns() + 2000000);
    }
    EXPECT_INT(answer.looked, looked);
    return answer;
}

// Blank pictures say nothing; two of the room are enough. Then one of many captures is looked at, and what is
// known stays known where they show nothing.
static void test_the_robot_is_looked_for_while_it_drives(void **state)
{
    (void)state;
    enum { MANY = 40 };
    struct surround_picture blank = pictures[1], all[MANY];
    struct robot_place_finder *f;
    const size_t bytes = (size_t)ROBOT_PANORAMA * 2 * ROBOT_PANORAMA * 3;
    blank.rgb = malloc(bytes);
    memset(blank.rgb, 128, bytes);
    for (int i = 0; i < MANY; i++)
        all[i] = i == 1 || i == 2 ? pictures[i - 1] : blank;
    EXPECT_STATUS(robot_place_finder_start(&f, &place), OK);
    struct robot_place_answer answer;
    robot_place_finder_update(f, all, 0, &answer);
    EXPECT_INT(answer.state, ROBOT_PLACE_WAITING);
    answer = wait_looked(f, all, 1, 1);
    EXPECT_INT(answer.state, ROBOT_PLACE_TOO_LITTLE);
    for (int i = 2; i <= 3; i++)
        answer = wait_looked(f, all, i, i);
    EXPECT_INT(answer.state, ROBOT_PLACE_FOUND);
    EXPECT_AT_MOST(v3_distance(answer.place_from_world.translation, robot_truth.translation), 0.03);
    const struct pose first = answer.place_from_world;
    for (int i = 0; i < 2; i++) { // a few more are left alone
        robot_place_finder_update(f, all, 6, &answer);
        clock_sleep_until_ns(clock_now_ns() + 800000000);
    }
    robot_place_finder_update(f, all, 6, &answer);
    EXPECT_INT(answer.looked, 3);
    answer = wait_looked(f, all, MANY, 4);
    EXPECT_INT(answer.state, ROBOT_PLACE_FOUND);
    EXPECT_NEAR(v3_distance(answer.place_from_world.translation, first.translation), 0, 1e-12);
    robot_place_finder_close(&f);
    free(blank.rgb);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_a_drive_is_kept_in_the_place),
        cmocka_unit_test(test_the_robot_is_looked_for_while_it_drives),
        cmocka_unit_test(test_the_robot_is_found_in_its_place), // last: it empties the pictures
    };
    return cmocka_run_group_tests(tests, make, tidy);
}
