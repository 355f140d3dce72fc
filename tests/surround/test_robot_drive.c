// Driving: motion, the link, the overlay, and the trials in which a scripted driver who only sees drawn pictures
// approaches a wall without touching it and finds its way through a bent passage. With a number: that many starts of
// both trials, counted.
#include "tests/support/test.h"

#include "base/clock.h"
#include "surround/drive/drive_session.h"
#include "surround/drive/robot_motion.h"
#include "surround/picture/surround_picture.h"
#include "tests/support/drive_trial.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static void test_motion_is_an_arc(void **state)
{
    (void)state;
    const struct drive_command c = {0.5, 0.4};
    struct pose steps = POSE_IDENTITY;
    const struct pose once = robot_motion_after(POSE_IDENTITY, c, 2);
    for (int i = 0; i < 100; i++)
        steps = robot_motion_after(steps, c, 0.02);
    EXPECT_NEAR(v3_distance(steps.translation, once.translation), 0, 1e-9);
    EXPECT_NEAR(once.translation.x, 0.5 / 0.4 * sin(0.8), 1e-12);
    EXPECT_NEAR(once.translation.y, 0.5 / 0.4 * (1 - cos(0.8)), 1e-12);
}

static void test_a_lost_link_stops_the_robot(void **state)
{
    (void)state;
    struct link_watch watch = {.patience_s = 0.5};
    const struct drive_command go = {0.3, 0};
    bool lost;
    EXPECT_NEAR(link_watch_command(&watch, go, 0, &lost).speed, 0, 0);
    assert_true(lost);
    watch.heard = true;
    watch.heard_ns = 1000000000;
    EXPECT_NEAR(link_watch_command(&watch, go, 1400000000, &lost).speed, 0.3, 0);
    assert_false(lost);
    EXPECT_NEAR(link_watch_command(&watch, go, 1600000000, &lost).speed, 0, 0);
    assert_true(lost);
    const struct drive_link link = {.loss = 0.3, .seed = 5};
    int arrived = 0;
    for (uint32_t i = 0; i < 10000; i++)
        arrived += drive_link_delivers(&link, i);
    EXPECT_NEAR(arrived, 7000, 200);
}

// The robot's side of a link that goes silent for five seconds, in one step and in small ones: it drives on for what
// its watchdog has, and stands. What was under way arrives when it arrives.
static void test_a_silent_link_is_timed_by_the_robot(void **state)
{
    (void)state;
    const struct drive_command go = {0.2, 0}, stand = {0, 0};
    double way_m[2];
    for (int small = 0; small < 2; small++) {
        struct drive_session s;
        struct drive_options options = drive_default_options();
        options.link.delay_s = 0.3;
        EXPECT_STATUS(drive_session_open(&s, "sim:3", &options), OK);
        EXPECT_STATUS(drive_session_step(&s, 1000000000, &go), OK);
        for (int i = 1; i <= (small ? 500 : 1); i++)
            EXPECT_STATUS(drive_session_step(&s, 1000000000 + i * (small ? 10000000LL : 5000000000LL), NULL), OK);
        way_m[small] = v3_distance(s.rover.world_from_body.translation, s.rover.start.translation);
        EXPECT_NEAR(way_m[small], go.speed * options.patience_s, 1e-6);
        EXPECT_NEAR(s.rover.command.speed, 0, 0);
        EXPECT_TRUE(s.link_lost);
        drive_session_close(&s);
    }
    struct drive_session s;
    const struct drive_options options = drive_default_options();
    EXPECT_STATUS(drive_session_open(&s, "sim:3", &options), OK);
    EXPECT_STATUS(drive_session_step(&s, 100000000, &go), OK);
    EXPECT_NEAR(s.rover.command.speed, go.speed, 0);
    EXPECT_STATUS(drive_session_step(&s, 200000000, &stand), OK); // it moved until this was sent
    EXPECT_NEAR(v3_distance(s.rover.world_from_body.translation, s.rover.start.translation), 0.02, 1e-9);
    EXPECT_NEAR(s.rover.command.speed, 0, 0);
    drive_session_close(&s);
}

// A wall that is as good as touched is not marked like one that is far away.
static void test_the_warning_goes_by_distance(void **state)
{
    (void)state;
    EXPECT_INT(overlay_warning_of(0.06), WARNING_TOUCHING);
    EXPECT_INT(overlay_warning_of(0.4), WARNING_NEAR);
    EXPECT_INT(overlay_warning_of(0.9), WARNING_NONE);
    for (int i = 0; i < WARNING_NONE; i++)
        for (int k = i + 1; k <= WARNING_NONE; k++) {
            const uint8_t *a = overlay_warning_color((enum overlay_warning)i);
            const uint8_t *b = overlay_warning_color((enum overlay_warning)k);
            EXPECT_AT_LEAST(abs(a[0] - b[0]) + abs(a[1] - b[1]) + abs(a[2] - b[2]), 150);
        }
}

static void test_clearance(void **state)
{
    (void)state;
    struct box_world w;
    struct pose start;
    const double size[3] = {0.6, 0.5, 1.2};
    rover_stage_world(1, &w, &start);
    EXPECT_NEAR(box_world_clearance(&w, start, size), 0.2, 1e-12);
    rover_stage_world(2, &w, &start);
    start.translation.x = 0.8;
    start.translation.y = -0.5;
    EXPECT_NEAR(box_world_clearance(&w, start, size), 0.1, 1e-12);
    start.translation.x = 1.2;
    EXPECT_AT_MOST(box_world_clearance(&w, start, size), 0);
}

// A narrow run of the trial: 4 starts here; `test_robot_drive 20` runs twenty.
static void test_approaches_without_touching(void **state)
{
    (void)state;
    for (uint32_t trial = 0; trial < (SANITIZED ? 1 : 4); trial++) {
        struct box_world world;
        struct pose start;
        struct simulated_rover rover;
        struct rover_options options = rover_default_options();
        double clearance;
        options.seed = trial + 1;
        options.panorama_height = 128;
        rover_stage_world(3, &world, &start);
        start.translation.x = 0.5 + 0.1 * trial;
        start.rotation = quat_from_rotation_vector(v3(0, 0, 0.1 * trial - 0.15));
        assert_int_equal(simulated_rover_open(&rover, &world, start, &options), OK);
        assert_int_equal(drive_trial_approach(&rover, &clearance), OK);
        print_message("trial %u: %.1f mm, %d captures\n", trial, clearance * 1e3, rover.surroundings.taken);
        EXPECT_AT_LEAST(clearance, 0.001);
        EXPECT_AT_MOST(clearance, 0.05);
        simulated_rover_close(&rover);
    }
}

// Three starts, in coarse pictures; `test_robot_drive 20` has more and finer ones.
static void test_the_map_saves_commands_through_the_bent_passage(void **state)
{
    (void)state;
    int commands[TRIAL_VIEWS] = {0};
    if (SANITIZED) // minutes there, and nothing that the approach does not run, too
        return;
    for (int i = 0; i < 3 * TRIAL_VIEWS; i++) {
        const enum trial_view view = (enum trial_view)(i % TRIAL_VIEWS);
        struct box_world world;
        struct pose start;
        struct simulated_rover rover;
        struct trial_result result;
        struct rover_options options = rover_default_options();
        options.panorama_height = 128;
        options.view = (struct lens){.width = 240, .height = 180, .fx = 150, .fy = 150, .cx = 119.5, .cy = 89.5};
        rover_stage_world(2, &world, &start);
        start.translation.y = 0.06 * (i / TRIAL_VIEWS - 1);
        start.rotation = quat_from_rotation_vector(v3(0, 0, 0.12 * (i / TRIAL_VIEWS - 1)));
        assert_int_equal(simulated_rover_open(&rover, &world, start, &options), OK);
        assert_int_equal(drive_trial_run(&rover, view, &result), OK);
        print_message("%s: %d commands, %.2f m, arrived %d, touched %d\n", view == TRIAL_MAP ? "map" : "picture",
                      result.commands, result.length_m, result.arrived, result.touched);
        EXPECT_TRUE(!result.touched);
        EXPECT_TRUE(result.arrived);
        EXPECT_AT_LEAST(result.commands, 4); // two bends
        EXPECT_AT_LEAST(result.length_m, 5);
        commands[view] += result.commands;
        simulated_rover_close(&rover);
    }
    EXPECT_AT_MOST(commands[TRIAL_MAP], commands[TRIAL_PICTURE] - 1);
}

// Two starts of `test_robot_drive 20`: at a box's corner, of which the picture ahead shows nothing, and
// before a wall that is drawn continued where none is. It looks where it turned to, and leaves the margin on floor that
// it saw.
static void test_corners_out_of_sight_are_not_touched(void **state)
{
    (void)state;
    static const struct {
        int number;
        enum trial_view view;
    } starts[] = {{13, TRIAL_PICTURE}, {11, TRIAL_MAP}};
    if (SANITIZED)
        return;
    for (size_t i = 0; i < COUNT_OF(starts); i++) {
        const int number = starts[i].number;
        struct simulated_rover rover;
        struct trial_result result;
        assert_int_equal(drive_trial_open(&rover, number), OK);
        assert_int_equal(drive_trial_run(&rover, starts[i].view, &result), OK);
        print_message("start %d: %d commands, %.2f m, arrived %d, touched %d\n", number, result.commands,
                      result.length_m, result.arrived, result.touched);
        EXPECT_TRUE(!result.touched);
        EXPECT_TRUE(result.arrived);
        simulated_rover_close(&rover);
    }
}

static void test_overlay(void **state)
{
    (void)state;
    struct box_world world;
    struct pose start;
    struct simulated_rover rover;
    struct rover_options options = rover_default_options();
    options.panorama_height = 128;
    rover_stage_world(3, &world, &start);
    assert_int_equal(simulated_rover_open(&rover, &world, start, &options), OK);
    const struct surround_view *view = &rover.surroundings.view;
    assert_int_equal(surroundings_draw(&rover.surroundings, operator_viewpoint(VIEWPOINT_THIRD, start, options.size_m)),
                     OK);
    const size_t bytes = (size_t)view->lens.width * (size_t)view->lens.height * 3;
    uint8_t *before = malloc(bytes);
    memcpy(before, view->rgb, bytes);
    const struct operator_overlay overlay = {
        .world_from_body = start, .size_m = {0.6, 0.5, 1.2}, .command = {0.3, 0.2}, .age_s = 1, .link_lost = true};
    struct nearest_thing thing;
    assert_int_equal(nearest_in_view(view, start, options.size_m, 0.1, &thing), OK);
    operator_overlay_draw(&rover.surroundings.view, &overlay, &thing);
    int changed = 0;
    for (size_t i = 0; i < bytes; i += 3)
        changed += memcmp(before + i, view->rgb + i, 3) != 0;
    EXPECT_AT_LEAST(changed, bytes / 3 / 50);
    EXPECT_AT_MOST(changed, bytes / 3 / 2);
    free(before);
    simulated_rover_close(&rover);
}

// A spiral of 200 m: the path stays within its memory, begins where the robot did, and is nowhere farther from where it
// was than its points are apart.
static void test_a_long_path_is_bounded(void **state)
{
    (void)state;
    enum { STEPS = 20000 };
    static struct vec3 was[STEPS];
    struct drive_path path = {.count = 0};
    for (int i = 0; i < STEPS; i++) {
        const double angle = 2e-3 * i, radius = 2 + 1.5e-4 * i;
        was[i] = v3(radius * cos(angle), radius * sin(angle), 0);
        drive_path_add(&path, was[i]);
        EXPECT_AT_MOST(path.count, DRIVE_PATH_POINTS);
    }
    EXPECT_AT_LEAST(path.count, DRIVE_PATH_POINTS / 4);
    EXPECT_AT_MOST(v3_distance(path.at[0], was[0]), 0);
    double farthest = 0;
    for (int i = 0; i < STEPS; i += 7) {
        double nearest = INFINITY;
        for (int k = 0; k < path.count; k++)
            nearest = fmin(nearest, v3_distance(was[i], path.at[k]));
        farthest = fmax(farthest, nearest);
    }
    print_message("%d points, %.2f m apart, at most %.2f m from the way\n", path.count, path.spacing_m, farthest);
    EXPECT_AT_MOST(farthest, path.spacing_m);
}

// Seen from above, a path of a metre behind the robot is drawn where it was driven.
static void test_the_path_is_drawn_where_it_was_driven(void **state)
{
    (void)state;
    struct overlay_shapes without, with;
    struct drive_path path = {.count = 0};
    const struct lens lens = {.width = 400, .height = 400, .fx = 200, .fy = 200, .cx = 199.5, .cy = 199.5};
    struct surround_view view = {.lens = lens,
                                 .world_from_view = {quat_from_rotation_vector(v3(3.14159265358979, 0, 0)), {0, 0, 4}}};
    struct operator_overlay overlay = {.world_from_body = POSE_IDENTITY, .size_m = {0.6, 0.5, 1.2}};
    quat_to_matrix(view.world_from_view.rotation, view.axes);
    for (int i = 0; i <= 10; i++)
        drive_path_add(&path, v3(0.1 * i - 1, 0, 0));
    operator_overlay_shapes(&without, &view, &overlay, NULL);
    overlay.path = &path;
    operator_overlay_shapes(&with, &view, &overlay, NULL);
    EXPECT_INT(with.line_count - without.line_count, path.count);
    const double to_px = lens.fx / 3.98; // the floor's, 2 cm raised
    EXPECT_NEAR(with.lines[0].ax, lens.cx - 1 * to_px, 0.01);
    EXPECT_NEAR(with.lines[0].ay, lens.cy, 0.01);
    EXPECT_NEAR(with.lines[path.count - 1].bx, lens.cx, 0.01);
}

// The tablet looks along its place's y when it is centred: half a metre that way is half a metre ahead of the robot, a
// quarter turn to the left looks to the robot's left, and what is raised is raised.
static void test_the_tablet_is_the_head(void **state)
{
    (void)state;
    double level[3][3] = {{1, 0, 0}, {0, 0, 1}, {0, -1, 0}}; // x right, y down, z along the place's y
    struct pose tablet = {quat_from_matrix(level), v3(3, 2, 1.5)};
    struct head_tracker head = {0};
    struct pose eye = head_tracker_eye(&head, tablet, v3(0, 0, 1.2));
    struct vec3 ahead = quat_rotate(eye.rotation, v3(0, 0, 1));
    EXPECT_NEAR(v3_distance(eye.translation, v3(0, 0, 1.2)), 0, 1e-12);
    EXPECT_NEAR(v3_distance(ahead, v3(1, 0, 0)), 0, 1e-9);
    tablet.translation = v3(3, 2.5, 1.6);
    tablet.rotation = quat_multiply(quat_from_rotation_vector(v3(0, 0, 1.5707963267948966)), tablet.rotation);
    eye = head_tracker_eye(&head, tablet, v3(0, 0, 1.2));
    ahead = quat_rotate(eye.rotation, v3(0, 0, 1));
    EXPECT_NEAR(v3_distance(eye.translation, v3(0.5, 0, 1.3)), 0, 1e-9);
    EXPECT_NEAR(v3_distance(ahead, v3(0, 1, 0)), 0, 1e-9);
    const struct vec3 down = quat_rotate(eye.rotation, v3(0, 1, 0));
    EXPECT_NEAR(v3_distance(down, v3(0, 0, -1)), 0, 1e-9);
    head.centred = false;
    eye = head_tracker_eye(&head, tablet, v3(0, 0, 1.2));
    EXPECT_NEAR(v3_distance(eye.translation, v3(0, 0, 1.2)), 0, 1e-12);
}

static void ride(struct simulated_rover *r, bool threads)
{
    struct box_world world;
    struct pose start;
    struct rover_options options = rover_default_options();
    options.panorama_height = 96;
    rover_stage_world(3, &world, &start);
    assert_int_equal(simulated_rover_open(r, &world, start, &options), OK);
    if (threads) {
        assert_int_equal(surroundings_start_threads(&r->surroundings), OK);
        EXPECT_INT(r->surroundings.taken, 1); // before the threads
    }
    for (int i = 0; i < 2; i++) {
        assert_int_equal(simulated_rover_step(r, (struct drive_command){0.31, 0.05}, 2), OK);
        const struct pose eye = operator_viewpoint(VIEWPOINT_THIRD, simulated_rover_pose(r), options.size_m);
        for (int k = 0; k < 2000 && r->surroundings.taken < i + 2; k++) { // drawing never waits for a capture
            assert_int_equal(surroundings_draw(&r->surroundings, eye), OK);
            if (threads)
                clock_sleep_until_ns(clock_now_ns() + 10000000);
        }
    }
}

// Captures handed to threads are placed where they are without, and come with their meshes, each depth with a number of
// its own.
static void test_captures_on_threads(void **state)
{
    (void)state;
    struct simulated_rover plain, threaded;
    ride(&plain, false);
    ride(&threaded, true);
    EXPECT_INT(threaded.surroundings.taken, 3);
    EXPECT_INT(plain.surroundings.taken, 3);
    for (int i = 0; i < 3; i++)
        EXPECT_NEAR(v3_distance(plain.surroundings.poses[i].translation, threaded.surroundings.poses[i].translation), 0,
                    0);
    for (int i = 0; i < 3; i++) {
        EXPECT_TRUE(threaded.surroundings.pictures[i].mesh && threaded.surroundings.pictures[i].mesh->count);
        EXPECT_TRUE(threaded.surroundings.pictures[i].depth_number > 0);
        EXPECT_TRUE(i == 0 || threaded.surroundings.pictures[i].depth_number !=
                                  threaded.surroundings.pictures[i - 1].depth_number);
    }
    EXPECT_NEAR(v3_distance(simulated_rover_pose(&plain).translation, simulated_rover_pose(&threaded).translation), 0,
                0);
    simulated_rover_close(&plain);
    simulated_rover_close(&threaded);
}

// ---------------------------------------------------------------- many starts

// Starts differ in distance from the wall and in heading, by fixed steps.
static void approach_wall(int number, double *clearance_m)
{
    struct box_world world;
    struct pose start;
    struct simulated_rover rover;
    struct rover_options options = rover_default_options();
    options.seed = (uint32_t)number + 1;
    rover_stage_world(3, &world, &start);
    start.translation.x = 0.1 * (number % 7);
    start.rotation = quat_from_rotation_vector(v3(0, 0, 0.05 * (number % 9) - 0.2));
    EXPECT_STATUS(simulated_rover_open(&rover, &world, start, &options), OK);
    EXPECT_STATUS(drive_trial_approach(&rover, clearance_m), OK);
    simulated_rover_close(&rover);
}

static int starts;

static void test_many_starts_are_counted(void **state)
{
    (void)state;
    static const char *const names[TRIAL_VIEWS] = {"picture alone", "map"};
    int wall_touched = 0, close = 0, commands[TRIAL_VIEWS] = {0}, arrived[TRIAL_VIEWS] = {0},
        touched[TRIAL_VIEWS] = {0};
    for (int i = 0; i < starts; i++) {
        double clearance_m;
        approach_wall(i, &clearance_m);
        wall_touched += clearance_m <= 0;
        close += clearance_m > 0 && clearance_m <= 0.05;
        for (int view = 0; view < TRIAL_VIEWS; view++) {
            struct simulated_rover rover;
            struct trial_result result;
            EXPECT_STATUS(drive_trial_open(&rover, i), OK);
            EXPECT_STATUS(drive_trial_run(&rover, (enum trial_view)view, &result), OK);
            commands[view] += result.arrived ? result.commands : 0;
            arrived[view] += result.arrived;
            touched[view] += result.touched;
            simulated_rover_close(&rover);
        }
    }
    print_message("the wall: %d of %d touched it, %d came within 5 cm without touching\n", wall_touched, starts, close);
    for (int view = 0; view < TRIAL_VIEWS; view++)
        print_message("the bent passage, %s: %.1f commands, %d of %d arrived, %d touched\n", names[view],
                      arrived[view] ? (double)commands[view] / arrived[view] : 0, arrived[view], starts, touched[view]);
}

int main(int argc, char **argv)
{
    if (argc > 1) {
        const struct CMUnitTest many[] = {cmocka_unit_test(test_many_starts_are_counted)};
        starts = atoi(argv[1]);
        return cmocka_run_group_tests(many, NULL, NULL);
    }
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_motion_is_an_arc),
        cmocka_unit_test(test_a_lost_link_stops_the_robot),
        cmocka_unit_test(test_a_silent_link_is_timed_by_the_robot),
        cmocka_unit_test(test_the_warning_goes_by_distance),
        cmocka_unit_test(test_clearance),
        cmocka_unit_test(test_corners_out_of_sight_are_not_touched),
        cmocka_unit_test(test_overlay),
        cmocka_unit_test(test_a_long_path_is_bounded),
        cmocka_unit_test(test_the_path_is_drawn_where_it_was_driven),
        cmocka_unit_test(test_the_tablet_is_the_head),
        cmocka_unit_test(test_captures_on_threads),
        cmocka_unit_test(test_the_map_saves_commands_through_the_bent_passage),
        cmocka_unit_test(test_approaches_without_touching),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
