// Driving a ROS robot: a real master and a simulated robot on this machine. What it sees is captured and drawn, it goes
// where it is sent, and a link lost on either side stops it. Skipped where ROS is not there.
#include "tests/support/test.h"

#include "base/clock.h"
#include "surround/drive/drive_session.h"
#include "tests/support/ros_stage.h"

#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#define TICK_NS 50000000
enum { PATIENCE = 30 * 20 /* ticks: a busy machine is slow, not wrong */ };

struct robot {
    struct ros_stage ros;
    struct drive_session session;
    int64_t start_ns, ticks;
};

static struct robot driven;

static void wait_a_tick(struct robot *r) { clock_sleep_until_ns(r->start_ns + ++r->ticks * TICK_NS); }

// One step with a command (ahead below -9: none), real time.
static void step(struct robot *r, double ahead)
{
    const struct drive_command command = {ahead, 0};
    wait_a_tick(r);
    assert_int_equal(drive_session_step(&r->session, r->ticks * TICK_NS, ahead < -9 ? NULL : &command), OK);
    ros_stage_read(&r->ros);
}

static void start(struct robot *r, const char *patience_s)
{
    ros_stage_open(&r->ros, PROGRAM_DIR "/ros-rover", patience_s);
    struct drive_options options = drive_default_options();
    options.calibration = r->ros.calibration;
    options.threads = true;
    options.patience_s = 1;
    options.processor_clock = clock_cpu_ns;
    const enum status status = drive_session_open(&r->session, r->ros.uri, &options);
    if (status != OK)
        print_error("%s\n", status_message());
    assert_int_equal(status, OK);
    r->start_ns = clock_now_ns();
    r->ticks = 0;
}

// Also after a failed test: a rover that goes on would take its share of the processor from all that follow.
static int end(void **state)
{
    (void)state;
    ros_stage_close(&driven.ros);
    return 0;
}

// Drives on until the robot truly is at x, drawing now and then. A link lost on a busy machine asks for a 0 first.
static void drive_to(struct robot *r, double x)
{
    const struct surround_view *view;
    for (int i = 0; i < PATIENCE && r->ros.is.x < x; i++) {
        step(r, r->session.ros.stopped ? 0 : 0.3);
        if (i % 8 == 0)
            assert_int_equal(drive_session_draw(&r->session, &view), OK);
    }
    EXPECT_AT_LEAST(r->ros.is.x, x);
}

static void wait_until_moving(struct robot *r, double ahead, bool moving)
{
    for (int i = 0; i < PATIENCE && (r->ros.is.speed > 0) != moving; i++)
        step(r, ahead);
    EXPECT_INT(r->ros.is.speed > 0, moving);
}

static void expect_pose(struct robot *r)
{
    for (int i = 0; i < 10; i++)
        step(r, 0); // it stands
    const struct pose believed = drive_session_pose(&r->session);
    print_message("truly at %.3f, believed at %.3f, by the wheels %.3f; %d captures, alignment at most %.1f ms\n",
                  r->ros.is.x, believed.translation.x,
                  r->session.ros.odometry[r->session.ros.odometry_count - 1].pose.translation.x,
                  r->session.ros.surroundings.taken, (double)r->session.ros.surroundings.worst_align_ns * 1e-6);
    EXPECT_NEAR(believed.translation.x, r->ros.is.x, 0.03);
    EXPECT_NEAR(believed.translation.y, r->ros.is.y, 0.03);
}

static void expect_picture(struct robot *r)
{
    const struct surround_view *view;
    for (int i = 0; i < PATIENCE && r->session.ros.surroundings.taken < 2; i++) {
        step(r, 0);
        assert_int_equal(drive_session_draw(&r->session, &view), OK);
    }
    assert_int_equal(drive_session_draw(&r->session, &view), OK);
    int drawn = 0;
    const int pixels = view->lens.width * view->lens.height;
    for (int i = 0; i < pixels; i++)
        drawn += view->source[i] == SOURCE_SEEN;
    EXPECT_AT_LEAST(r->session.ros.surroundings.taken, 2);
    EXPECT_AT_LEAST(drawn, 0.8 * pixels);
    EXPECT_INT(ros_robot_refused(r->session.ros.link), 0);
}

// By tf, over a mast, and by the calibration.
static void expect_places(const struct robot *r)
{
    const struct {
        enum ros_topic topic;
        struct pose is;
    } cameras[] = {{ROS_PANORAMA, rover_head()},
                   {ROS_DEPTH_FRONT, rover_depth_camera(0)},
                   {ROS_DEPTH_LEFT, rover_depth_camera(1)}};
    for (size_t i = 0; i < COUNT_OF(cameras); i++) {
        const struct pose at = r->session.ros.newest[cameras[i].topic].body_from_camera;
        EXPECT_NEAR(v3_distance(at.translation, cameras[i].is.translation), 0, 1e-6);
        EXPECT_NEAR(pose_angle(at, cameras[i].is), 0, 1e-6);
    }
    const struct pose panorama = r->session.ros.surroundings.body_from_panorama;
    EXPECT_NEAR(v3_distance(panorama.translation, rover_head().translation), 0, 1e-6);
}

// Nothing comes from the robot any more: that is said, and it is stopped until the hand has been off the stick.
static void expect_link_watched(struct robot *r)
{
    kill(r->ros.rover, SIGSTOP);
    for (int i = 0; i < PATIENCE && !r->session.link_lost; i++)
        step(r, 0.05);
    EXPECT_TRUE(r->session.link_lost);
    kill(r->ros.rover, SIGCONT);
    for (int i = 0; i < PATIENCE && r->session.link_lost; i++)
        step(r, 0.05);
    EXPECT_TRUE(!r->session.link_lost);
    for (int i = 0; i < 30; i++) // longer than a command that was sent before can have effect
        step(r, 0.05);
    EXPECT_NEAR(r->ros.is.speed, 0, 0);
    step(r, 0);
    wait_until_moving(r, 0.05, true);
}

static void test_a_ros_robot_is_driven(void **state)
{
    (void)state;
    struct robot *const r = &driven;
    if (!ros_stage_available())
        skip_without("ROS (libroscpp-dev, python3-rosmaster)");
    start(r, "0.5");
    // The world begins where the first capture is taken; on a busy machine the robot would have moved by then.
    for (int i = 0; i < PATIENCE && !r->session.ros.surroundings.any_taken; i++)
        step(r, 0);
    drive_to(r, 0.7);
    expect_pose(r);
    expect_picture(r);
    expect_places(r);
    step(r, 0);
    wait_until_moving(r, 0.05, true);
    wait_until_moving(r, -10, false); // no command: the robot's own watchdog
    step(r, 0);
    wait_until_moving(r, 0.05, true);
    expect_link_watched(r);
    EXPECT_INT(r->ros.is.touched, 0);
    drive_session_close(&r->session); // its last command is a stop
    for (int i = 0; i < PATIENCE && r->ros.is.speed > 0; i++) {
        wait_a_tick(r);
        ros_stage_read(&r->ros);
    }
    EXPECT_NEAR(r->ros.is.speed, 0, 0);
}

// A robot that drives on for a minute without a command, and a program that hangs: it stands soon all the same. In a
// process of its own, for there is one node in each.
static void test_a_program_that_hangs_stops_the_robot(void **state)
{
    (void)state;
    struct robot *const r = &driven;
    if (!ros_stage_available())
        skip_without("ROS (libroscpp-dev, python3-rosmaster)");
    const pid_t child = fork();
    if (child == 0) {
        start(r, "60");
        for (int i = 0; i < PATIENCE && !r->session.ros.surroundings.any_taken; i++)
            step(r, 0);
        for (int i = 0; i < PATIENCE && !(r->ros.is.speed > 0); i++)
            step(r, r->session.ros.stopped ? 0 : 0.05);
        const bool moved = r->ros.is.speed > 0;
        const int64_t from = clock_now_ns();
        while (clock_now_ns() - from < 10000000000 && r->ros.is.speed > 0) { // nothing is sent
            clock_sleep_until_ns(clock_now_ns() + 10000000);
            ros_stage_read(&r->ros);
        }
        const double took_s = (double)(clock_now_ns() - from) * 1e-9;
        print_message("moved: %d; stands %.2f s after the last command\n", moved, took_s);
        ros_stage_close(&r->ros);
        _exit(moved && took_s < 1 ? 0 : 1);
    }
    int status = -1;
    EXPECT_INT(waitpid(child, &status, 0), child);
    EXPECT_TRUE(WIFEXITED(status));
    EXPECT_INT(WEXITSTATUS(status), 0);
}

static void test_what_is_missing_is_said(void **state)
{
    (void)state;
    struct drive_session s;
    struct drive_options options = drive_default_options();
    assert_int_equal(drive_session_open(&s, "ros:", &options), ERR_INPUT);
    assert_non_null(strstr(status_message(), "--calibration"));
    struct ros_robot *robot;
    if (!ros_robot_available()) {
        assert_int_equal(ros_robot_open(&robot, "", NULL), ERR_INPUT);
        assert_non_null(strstr(status_message(), "libroscpp"));
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_what_is_missing_is_said),
        cmocka_unit_test(test_a_program_that_hangs_stops_the_robot), // before this process has threads
        cmocka_unit_test_teardown(test_a_ros_robot_is_driven, end),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
