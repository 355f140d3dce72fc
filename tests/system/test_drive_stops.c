// reenact drive on a real X server (Xvfb) and a simulated robot on a ROS master, in processes of their own: by its own
// word the robot stands soon after whatever ends the driving. It has no time-out of its own: with its last command it
// would drive on for an hour. Skipped where ROS is not there.
#include "tests/support/test.h"

#include "base/clock.h"
#include "tests/support/display.h"
#include "tests/support/process.h"
#include "tests/support/ros_stage.h"
#include "tests/support/scratch.h"

#include <signal.h>
#include <stdio.h>
#include <string.h>
#include <sys/wait.h>

enum { WIDTH = 640, HEIGHT = 480 };
static const uint32_t KEY_UP = 0xff52, KEY_DOWN = 0xff54, KEY_SPACE = 0x20, KEY_ESCAPE = 0xff1b;
// The longest of the times after which driver and guard send a stop (0.3 and 0.4 s), and what a picture may take.
static const double WATCHED_S = 0.5, PICTURE_S = 0.5;

static struct scratch scratch;
static struct display display;
static struct ros_stage ros;
static pid_t driver; // 0: not running
static bool ahead;   // goes to and fro, so that no wall is reached

static void wait_ms(int ms) { clock_sleep_until_ns(clock_now_ns() + ms * 1000000LL); }

static int open_stage(void **state)
{
    (void)state;
    if (!ros_stage_available())
        return 0;
    scratch = scratch_make();
    ros_stage_open(&ros, PROGRAM_DIR "/ros-rover", "3600");
    setenv("SDL_VIDEODRIVER", "x11", 1);
    if (!display_open(&display, scratch.path, WIDTH, HEIGHT))
        return 1;
    const char *const arguments[] = {PROGRAM_DIR "/reenact", "drive",  ros.uri,   "--calibration",
                                     ros.calibration,        "--size", "640x480", NULL};
    driver = process_start(arguments);
    return 0;
}

static int close_stage(void **state)
{
    (void)state;
    if (driver) {
        kill(driver, SIGKILL);
        waitpid(driver, NULL, 0);
        driver = 0;
    }
    display_close(&display);
    ros_stage_close(&ros);
    if (*scratch.path)
        scratch_remove(&scratch);
    scratch = (struct scratch){0};
    return 0;
}

static bool moves(void)
{
    ros_stage_read(&ros);
    return ros.is.speed != 0;
}

static uint32_t key(void) { return ahead ? KEY_UP : KEY_DOWN; }

// Holds the key until the robot moves. Pressed again where the program was not ready yet, or a busy machine lost the
// link meanwhile.
static void drive(void)
{
    ahead = !ahead;
    for (int i = 0; i < 30 && !moves(); i++) {
        display_hold_key(&display, key(), false);
        wait_ms(300);
        display_hold_key(&display, key(), true);
        for (int k = 0; k < 20 && !moves(); k++)
            wait_ms(50);
    }
    EXPECT_TRUE(moves());
    wait_ms(300);
    EXPECT_TRUE(moves());
}

// From now on until it stands; then it stays so, with the key still down.
static void expect_stops(const char *what)
{
    const int64_t start = clock_now_ns();
    while (moves() && clock_now_ns() - start < 10000000000)
        wait_ms(5);
    const double took_s = (double)(clock_now_ns() - start) * 1e-9;
    print_message("%s: stands after %.2f s\n", what, took_s);
    EXPECT_AT_MOST(took_s, WATCHED_S + PICTURE_S);
    for (int i = 0; i < 20; i++) {
        wait_ms(50);
        EXPECT_TRUE(!moves());
    }
}

// The process that guards (platform/network/ros_guard.h), a child of the driver; 0: none.
static pid_t guard_of(pid_t parent)
{
    char path[64], name[64] = "";
    int child = 0;
    snprintf(path, sizeof path, "/proc/%d/task/%d/children", parent, parent);
    FILE *from = fopen(path, "r");
    while (from && strcmp(name, "reenact-ros-guard") != 0 && fscanf(from, "%d", &child) == 1) {
        snprintf(path, sizeof path, "/proc/%d/cmdline", child);
        FILE *line = fopen(path, "r");
        if (line && !fgets(name, sizeof name, line))
            *name = 0;
        if (line)
            fclose(line);
    }
    if (from)
        fclose(from);
    return strcmp(name, "reenact-ros-guard") ? 0 : child;
}

// It may be a zombie of nobody that waits for it: then it has ended, too.
static bool runs(pid_t process)
{
    char path[64], state = 0;
    snprintf(path, sizeof path, "/proc/%d/stat", process);
    FILE *from = fopen(path, "r");
    if (from && fscanf(from, "%*d %*s %c", &state) != 1)
        state = 0;
    if (from)
        fclose(from);
    return state && state != 'Z';
}

static void expect_ends(pid_t process)
{
    for (int i = 0; i < 100 && runs(process); i++)
        wait_ms(50);
    EXPECT_TRUE(!runs(process));
}

static void expect_exit_code(int expected)
{
    int status = 0;
    pid_t ended = 0;
    for (int i = 0; i < 200 && !(ended = waitpid(driver, &status, WNOHANG)); i++)
        wait_ms(50);
    EXPECT_INT(ended, driver);
    EXPECT_TRUE(WIFEXITED(status));
    EXPECT_INT(WEXITSTATUS(status), expected);
    if (ended == driver)
        driver = 0;
}

// While all is well the guard sends nothing in between.
static void expect_steady(void)
{
    drive();
    for (int i = 0; i < 20; i++) {
        wait_ms(50);
        EXPECT_TRUE(moves());
    }
    display_hold_key(&display, key(), false);
    expect_stops("the key is let go");
}

static void test_what_ends_driving(void **state)
{
    (void)state;
    if (!driver)
        skip_without("ROS (libroscpp-dev, python3-rosmaster)");
    expect_steady();
    drive();
    display_hold_key(&display, key(), false);
    expect_stops("the key is let go");
    drive();
    display_key(&display, KEY_SPACE);
    expect_stops("space");
    drive();
    display_key(&display, KEY_ESCAPE);
    expect_stops("Escape");
    EXPECT_INT(waitpid(driver, NULL, WNOHANG), 0); // it did not leave
    drive();
    display_hold_button(&display, WIDTH - 60, HEIGHT - 60, true);
    expect_stops("STOP");
    display_hold_button(&display, WIDTH - 60, HEIGHT - 60, false);
    display_focus(&display, true);
    drive();
    display_focus(&display, false);
    expect_stops("the keyboard goes to another window");
    display_focus(&display, true);
    expect_stops("it comes back, the key is down");
    drive();
    display_grab_keyboard(&display, true);
    expect_stops("the screen is locked");
    display_grab_keyboard(&display, false);
    drive();
    display_show_window(&display, false);
    expect_stops("the window is hidden");
    display_show_window(&display, true);
    display_focus(&display, true);
    drive();
    kill(driver, SIGSTOP);
    expect_stops("the program is stopped");
    kill(driver, SIGCONT);
    expect_stops("it goes on, the key is down");
    drive();
    kill(driver, SIGSTOP);
    wait_ms(600); // shorter than what the controls notice by themselves
    kill(driver, SIGCONT);
    expect_stops("it is stopped for 0.6 s, the key is down");
    drive();
    const pid_t guard = guard_of(driver);
    EXPECT_TRUE(guard > 0);
    kill(driver, SIGTERM);
    expect_stops("the program is ended");
    expect_ends(guard);
    EXPECT_INT(ros.is.touched, 0);
}

static void end_driving(const char *what, pid_t process, int signal)
{
    if (!driver)
        skip_without("ROS (libroscpp-dev, python3-rosmaster)");
    drive();
    const pid_t guard = guard_of(driver);
    EXPECT_TRUE(guard > 0);
    kill(process, signal);
    expect_stops(what);
    expect_ends(guard);
}

static void test_the_program_is_killed(void **state)
{
    (void)state;
    end_driving("the program is killed", driver, SIGKILL);
}

static void test_the_program_crashes(void **state)
{
    (void)state;
    end_driving("the program crashes", driver, SIGSEGV);
}

static void test_the_display_is_gone(void **state)
{
    (void)state;
    end_driving("the display is gone", display.server, SIGKILL);
    expect_exit_code(1); // also where it drew at that moment, and Mesa never returns
}

// Nothing is driven unguarded.
static void test_the_guard_is_killed(void **state)
{
    (void)state;
    if (!driver)
        skip_without("ROS (libroscpp-dev, python3-rosmaster)");
    drive();
    const pid_t guard = guard_of(driver);
    EXPECT_TRUE(guard > 0);
    kill(guard, SIGKILL);
    expect_stops("the guard is killed");
    expect_exit_code(1);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(test_what_ends_driving, open_stage, close_stage),
        cmocka_unit_test_setup_teardown(test_the_program_is_killed, open_stage, close_stage),
        cmocka_unit_test_setup_teardown(test_the_program_crashes, open_stage, close_stage),
        cmocka_unit_test_setup_teardown(test_the_guard_is_killed, open_stage, close_stage),
        cmocka_unit_test_setup_teardown(test_the_display_is_gone, open_stage, close_stage),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
