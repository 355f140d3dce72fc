// The program on real display servers, X11 (Xvfb) and Wayland (weston within it): the contents
// of the display's memory are checked.
#include "tests/support/test.h"

#include "base/clock.h"
#include "platform/files/file.h"
#include "tests/support/answer.h"
#include "tests/support/display.h"
#include "tests/support/rehearsal.h"

#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>

enum { WIDTH = 1280, HEIGHT = 800 };

// Upside down, too; not where drawing is emulated: there test_screens checks rotation.
#ifdef EMULATED
enum { ORIENTATIONS = 1 };
#else
enum { ORIENTATIONS = SANITIZED ? 1 : 2 };
#endif
static const uint32_t ACCENT = 0x2dd4bf; // of the play button, dark theme

static struct rehearsal rehearsal;
static struct display display;
static pid_t weston, watcher; // 0: not running

// Waits until the play button is there, at the bottom or, upside down, at the top, and an image with it.
static void expect_screen(bool upside_down)
{
    const int top = upside_down ? 20 : HEIGHT - 120;
    int accent = 0, other = 0, colors = 0;
    for (int i = 0; i < 1200 * PROCESS_PATIENCE && (accent < 1500 || colors < 100); i++) {
        clock_sleep_until_ns(clock_now_ns() + 100000000);
        if (!display_read(&display))
            continue;
        accent = display_count(&display, ACCENT, 580, top, 700, top + 100);
        other = display_count(&display, ACCENT, 580, HEIGHT - 120 - top, 700, HEIGHT - 20 - top);
        colors = display_colors(&display, 300, 200, 980, 600);
    }
    print_message("%d pixels of the play button, %d where it is not, %d colours\n", accent, other, colors);
    EXPECT_AT_LEAST(accent, 1500);
    EXPECT_AT_MOST(other, 100);
    EXPECT_AT_LEAST(colors, 100);
}

// Ends a child, also after a failed test; returns its exit status.
static int end(pid_t *child)
{
    int status = 0;
    if (*child) {
        kill(*child, SIGTERM);
        waitpid(*child, &status, 0);
    }
    *child = 0;
    return status;
}

static void end_watcher(void)
{
    int status = end(&watcher);
    EXPECT_TRUE(WIFEXITED(status));
    EXPECT_INT(WEXITSTATUS(status), 0);
}

static void watch(const char *rotate)
{
    const char *const arguments[] = {PROGRAM_DIR "/reenact",
                                     rehearsal.file,
                                     "--take",
                                     "turn",
                                     "--camera",
                                     rehearsal.camera,
                                     "--dpi",
                                     "149",
                                     "--rotate",
                                     rotate,
                                     NULL};
    watcher = process_start(arguments);
}

static void test_x11(void **state)
{
    (void)state;
    setenv("SDL_VIDEODRIVER", "x11", 1);
    for (int upside_down = 0; upside_down < ORIENTATIONS; upside_down++) {
        watch(upside_down ? "180" : "0");
        expect_screen(upside_down);
        end_watcher();
    }
}

static void test_wayland(void **state)
{
    (void)state;
    setenv("XDG_RUNTIME_DIR", rehearsal.scratch.path, 1);
    const char *const arguments[] = {"/usr/bin/weston",
                                     "--backend=x11-backend.so",
                                     "--use-pixman",
                                     "--width=1280",
                                     "--height=800",
                                     "--socket=reenact",
                                     "--no-config",
                                     "--idle-time=0",
                                     "--shell=kiosk-shell.so",
                                     NULL};
    weston = process_start(arguments);
    for (int i = 0; i < 100 && !file_exists(scratch_file(&rehearsal.scratch, "reenact")); i++)
        clock_sleep_until_ns(clock_now_ns() + 100000000);
    setenv("WAYLAND_DISPLAY", "reenact", 1);
    setenv("SDL_VIDEODRIVER", "wayland", 1);
    watch("0");
    expect_screen(false);
    end_watcher();
    end(&weston);
}

// Waits until that many pixels of the accent are in the box.
static void expect_accent(int left, int top, int right, int bottom, int wanted)
{
    int accent = 0;
    for (int i = 0; i < 600 * PROCESS_PATIENCE && accent < wanted; i++) {
        clock_sleep_until_ns(clock_now_ns() + 100000000);
        if (display_read(&display))
            accent = display_count(&display, ACCENT, left, top, right, bottom);
    }
    print_message("%d pixels of the accent\n", accent);
    EXPECT_AT_LEAST(accent, wanted);
}

// Without a file: the start screen, from which a recording is opened by touch, and to which one comes back.
static void test_start_screen(void **state)
{
    (void)state;
    enum { ESCAPE = 0xff1b }; // X11's keysym
    char home[300];
    int status;
    setenv("SDL_VIDEODRIVER", "x11", 1);
    snprintf(home, sizeof home, "%s", scratch_file(&rehearsal.scratch, "home"));
    EXPECT_STATUS(folder_make(scratch_file(&rehearsal.scratch, "home/Videos/Reenact")), OK);
    EXPECT_INT(link(rehearsal.file, scratch_file(&rehearsal.scratch, "home/Videos/Reenact/turn.reenact")), 0);
    setenv("HOME", home, 1);
    setenv("XDG_STATE_HOME", home, 1);
    const char *const arguments[] = {PROGRAM_DIR "/reenact", "--camera", "none", "--dpi", "149", NULL};
    watcher = process_start(arguments);
    expect_accent(30, 120, 250, 190, 3000); // Film
    int colors = 0;                         // of the recording's picture, which comes after the first frame
    for (int i = 0; i < 600 * PROCESS_PATIENCE && colors < 60; i++) {
        clock_sleep_until_ns(clock_now_ns() + 100000000);
        if (display_read(&display))
            colors = display_colors(&display, 30, 210, 480, 480);
    }
    EXPECT_AT_LEAST(colors, 60);
    display_click(&display, 200, 300);
    expect_accent(0, 200, WIDTH, HEIGHT, 1500); // of the takes
    display_key(&display, ESCAPE);
    expect_accent(30, 120, 250, 190, 3000);
    EXPECT_TRUE(file_exists(scratch_file(&rehearsal.scratch, "home/reenact/recent")));
    display_close_window(&display);
    waitpid(watcher, &status, 0);
    watcher = 0;
    EXPECT_TRUE(WIFEXITED(status));
    EXPECT_INT(WEXITSTATUS(status), 0);
}

static void test_missing_display_is_reported(void **state)
{
    (void)state;
    setenv("SDL_VIDEODRIVER", "wayland", 1);
    setenv("WAYLAND_DISPLAY", "nowhere", 1);
    struct process_result said = PROCESS(PROGRAM_DIR "/reenact", rehearsal.file, "--camera", "none");
    EXPECT_SENTENCE(said, "display");
}

static void test_missing_graphics_driver_is_reported(void **state)
{
    (void)state;
    setenv("SDL_VIDEODRIVER", "x11", 1);
    setenv("__EGL_VENDOR_LIBRARY_FILENAMES", "/dev/null", 1); // no EGL at all
    struct process_result watched = PROCESS(PROGRAM_DIR "/reenact", rehearsal.file, "--camera", "none");
    struct process_result rendered =
        PROCESS(PROGRAM_DIR "/reenact", "render", rehearsal.file, "--take", "turn", "--camera", rehearsal.camera,
                "--out", scratch_file(&rehearsal.scratch, "out"));
    unsetenv("__EGL_VENDOR_LIBRARY_FILENAMES");
    EXPECT_SENTENCE(watched, "OpenGL ES 3");
    EXPECT_SENTENCE(rendered, "graphics driver");
}

static int count_occurrences(const char *text, const char *what)
{
    int times = 0;
    while ((text = strstr(text, what))) {
        text++;
        times++;
    }
    return times;
}

static void test_lost_graphics_context_is_recreated(void **state)
{
    (void)state;
    setenv("SDL_VIDEODRIVER", "x11", 1);
    setenv("LD_PRELOAD", LOSE_CONTEXT, 1);
    struct process_result said = PROCESS(PROGRAM_DIR "/reenact", rehearsal.file, "--take", "turn", "--camera",
                                         rehearsal.camera, "--size", "480x320", "--stats");
    unsetenv("LD_PRELOAD");
    print_message("%s%s", said.out, said.err);
    EXPECT_INT(said.exit_code, 0);
    EXPECT_INT(count_occurrences(said.out, "shows     the actor in place"), 2);
}

// How many pixels have the colour of the robot's edges, in one half of the display.
static int find_robot(int half)
{
    int count = 0;
    for (int y = 0; y < HEIGHT; y++)
        for (int x = half * WIDTH / 2; x < (half + 1) * WIDTH / 2; x++) {
            const uint8_t *p = display.rgb + 3 * (y * WIDTH + x);
            count += p[0] < 120 && p[1] > 120 && p[1] < 200 && p[2] > 220;
        }
    return count;
}

// The picture on the left, the map on the right, the robot in both; SIGTERM ends it in good order.
static void test_driving_with_the_map_beside(void **state)
{
    (void)state;
    setenv("SDL_VIDEODRIVER", "x11", 1);
    const char *const arguments[] = {PROGRAM_DIR "/reenact", "drive", "sim:1", "--map", NULL};
    int left = 0, right = 0;
    watcher = process_start(arguments);
    for (int i = 0; i < 600 * PROCESS_PATIENCE && (left < 300 || right < 100); i++) {
        clock_sleep_until_ns(clock_now_ns() + 100000000);
        if (!display_read(&display))
            continue;
        left = find_robot(0);
        right = find_robot(1);
    }
    print_message("%d pixels of the robot's edges in the picture, %d in the map\n", left, right);
    EXPECT_AT_LEAST(left, 300);
    EXPECT_AT_LEAST(right, 100);
    end_watcher();
}

// From a desktop there is no terminal to say why; from one, no window opens.
static void test_a_damaged_file_opened_by_a_desktop(void **state)
{
    (void)state;
    setenv("SDL_VIDEODRIVER", "x11", 1);
    scratch_text(&rehearsal.scratch, "notes.reenact", "no recording");
    char path[300];
    snprintf(path, sizeof path, "%s", scratch_file(&rehearsal.scratch, "notes.reenact"));
    const char *const arguments[] = {PROGRAM_DIR "/reenact", "--say-in-window", path, NULL};
    int button = 0;
    watcher = process_start(arguments);
    for (int i = 0; i < 300 * PROCESS_PATIENCE && button < 1500; i++) {
        clock_sleep_until_ns(clock_now_ns() + 100000000);
        if (display_read(&display))
            button = display_count(&display, ACCENT, 540, 380, 740, 520);
    }
    print_message("%d pixels of the button that closes\n", button);
    EXPECT_AT_LEAST(button, 1500);
    const int status = end(&watcher);
    EXPECT_TRUE(WIFEXITED(status));
    EXPECT_INT(WEXITSTATUS(status), 1);
    const struct process_result said = PROCESS(PROGRAM_DIR "/reenact", path);
    EXPECT_INT(said.exit_code, 1);
    EXPECT_TRUE(strstr(said.err, "not a recording") != NULL);
}

// In a window of the desktop's own, until it is closed.
static void test_a_studio_that_cannot_begin(void **state)
{
    (void)state;
    setenv("SDL_VIDEODRIVER", "x11", 1);
    scratch_text(&rehearsal.scratch, "notes.reenact", "no recording");
    char path[300];
    snprintf(path, sizeof path, "%s", scratch_file(&rehearsal.scratch, "notes.reenact"));
    const char *const arguments[] = {PROGRAM_DIR "/reenact-capture", "studio", "--say-in-window", path, NULL};
    int ended = 0, status = 0, colors = 0;
    watcher = process_start(arguments);
    for (int i = 0; i < 300 * PROCESS_PATIENCE && colors < 3; i++) {
        clock_sleep_until_ns(clock_now_ns() + 100000000);
        colors = display_read(&display) ? display_colors(&display, 0, 0, WIDTH, HEIGHT) : 0;
    }
    EXPECT_AT_LEAST(colors, 3);
    EXPECT_INT(waitpid(watcher, &status, WNOHANG), 0); // it waits to be read
    for (int i = 0; i < 100 * PROCESS_PATIENCE && !ended; i++) {
        display_close_window(&display);
        clock_sleep_until_ns(clock_now_ns() + 100000000);
        ended = waitpid(watcher, &status, WNOHANG);
    }
    EXPECT_INT(ended, watcher);
    watcher = 0;
    EXPECT_TRUE(WIFEXITED(status) && WEXITSTATUS(status) == 1);
}

static int set_up(void **state)
{
    (void)state;
    // Drivers and the desktop bus, loaded and unloaded by SDL, leak; leaks of this program are checked in test_screens.
    setenv("ASAN_OPTIONS", "detect_leaks=0:verify_asan_link_order=0", 1);
    rehearsal = rehearsal_make();
    return display_open(&display, rehearsal.scratch.path, WIDTH, HEIGHT) ? 0 : -1;
}

static int tear_down(void **state)
{
    (void)state;
    end(&watcher);
    end(&weston);
    display_close(&display);
    rehearsal_end(&rehearsal);
    return 0;
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_x11),
        cmocka_unit_test(test_start_screen),
        cmocka_unit_test(test_wayland),
        cmocka_unit_test(test_lost_graphics_context_is_recreated),
        cmocka_unit_test(test_driving_with_the_map_beside),
        cmocka_unit_test(test_a_damaged_file_opened_by_a_desktop),
        cmocka_unit_test(test_a_studio_that_cannot_begin),
        cmocka_unit_test(test_missing_display_is_reported),
        cmocka_unit_test(test_missing_graphics_driver_is_reported),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
