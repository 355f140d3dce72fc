// The program on real display servers, X11 (Xvfb) and Wayland (weston within it): the contents
// of the display's memory are checked.
#include "tests/support/test.h"

#include "base/clock.h"
#include "platform/file.h"
#include "tests/support/process.h"
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
enum { ORIENTATIONS = 2 };
#endif
static const int ACCENT[3] = {45, 212, 191}; // of the play button, dark theme

static struct rehearsal rehearsal;
static pid_t xvfb, weston, watcher; // 0: not running
static uint8_t rgb[WIDTH * HEIGHT * 3];

// Xvfb keeps its frame buffer in a file, xwd format.
static bool read_display(void)
{
    uint8_t *bytes;
    size_t count;
    if (file_read(scratch_file(&rehearsal.scratch, "Xvfb_screen0"), &bytes, &count) != OK)
        return false;
    uint32_t head[25];
    bool whole = count > sizeof head;
    for (size_t i = 0; i < COUNT_OF(head) && whole; i++)
        head[i] = (uint32_t)bytes[4 * i] << 24 | (uint32_t)bytes[4 * i + 1] << 16 | (uint32_t)bytes[4 * i + 2] << 8 |
                  bytes[4 * i + 3];
    size_t start = whole ? head[0] + 12 * (size_t)head[19] : 0, row = whole ? head[12] : 0;
    whole = whole && head[4] == WIDTH && head[5] == HEIGHT && count >= start + row * HEIGHT;
    for (size_t y = 0; y < HEIGHT && whole; y++)
        for (size_t x = 0; x < WIDTH; x++)
            for (size_t c = 0; c < 3; c++)
                rgb[3 * (y * WIDTH + x) + c] = bytes[start + y * row + 4 * x + 2 - c];
    free(bytes);
    return whole;
}

// How many pixels of the accent colour are within a box.
static int find_accent(int left, int top, int right, int bottom)
{
    int count = 0;
    for (int y = top; y < bottom; y++)
        for (int x = left; x < right; x++) {
            const uint8_t *p = rgb + 3 * (y * WIDTH + x);
            count += abs(p[0] - ACCENT[0]) < 6 && abs(p[1] - ACCENT[1]) < 6 && abs(p[2] - ACCENT[2]) < 6;
        }
    return count;
}

// Number of distinct colours in the middle of the screen: tells an image from a plain background.
static int colorfulness(void)
{
    static bool seen[4096];
    int count = 0;
    memset(seen, 0, sizeof seen);
    for (int y = 200; y < 600; y++)
        for (int x = 300; x < 980; x++) {
            const uint8_t *p = rgb + 3 * (y * WIDTH + x);
            int which = (p[0] >> 4) << 8 | (p[1] >> 4) << 4 | p[2] >> 4;
            count += !seen[which];
            seen[which] = true;
        }
    return count;
}

// Waits until the play button is there, at the bottom or, upside down, at the top, and an image with it.
static void expect_screen(bool upside_down)
{
    const int top = upside_down ? 20 : HEIGHT - 120;
    int accent = 0, other = 0, colors = 0;
    for (int i = 0; i < 1200 * PROCESS_PATIENCE && (accent < 1500 || colors < 100); i++) {
        clock_sleep_until_ns(clock_now_ns() + 100000000);
        if (!read_display())
            continue;
        accent = find_accent(580, top, 700, top + 100);
        other = find_accent(580, HEIGHT - 120 - top, 700, HEIGHT - 20 - top);
        colors = colorfulness();
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

// Exit code 1 and exactly one sentence on stderr, with the word.
static void expect_refusal(const struct process_result *said, const char *word)
{
    const char *end = strchr(said->err, '\n');
    print_message("%s", said->err);
    EXPECT_INT(said->exit_code, 1);
    EXPECT_TRUE(strstr(said->err, word));
    EXPECT_TRUE(end && !end[1]);
}

static void test_missing_display_is_reported(void **state)
{
    (void)state;
    setenv("SDL_VIDEODRIVER", "wayland", 1);
    setenv("WAYLAND_DISPLAY", "nowhere", 1);
    struct process_result said = PROCESS(PROGRAM_DIR "/reenact", rehearsal.file, "--camera", "none");
    expect_refusal(&said, "display");
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
    expect_refusal(&watched, "OpenGL ES 3");
    expect_refusal(&rendered, "graphics driver");
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
            const uint8_t *p = rgb + 3 * (y * WIDTH + x);
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
        if (!read_display())
            continue;
        left = find_robot(0);
        right = find_robot(1);
    }
    print_message("%d pixels of the robot's edges in the picture, %d in the map\n", left, right);
    EXPECT_AT_LEAST(left, 300);
    EXPECT_AT_LEAST(right, 100);
    end_watcher();
}

static int set_up(void **state)
{
    (void)state;
    static char folder[300], display[16];
    // Drivers and the desktop bus, loaded and unloaded by SDL, leak; leaks of this program are checked in test_screens.
    setenv("ASAN_OPTIONS", "detect_leaks=0:verify_asan_link_order=0", 1);
    rehearsal = rehearsal_make();
    snprintf(folder, sizeof folder, "%s", rehearsal.scratch.path);
    // A display number of its own.
    snprintf(display, sizeof display, ":%d", 1000 + (int)getpid() % 50000);
    const char *const arguments[] = {
        "/usr/bin/Xvfb", display,     "-screen", "0",        "1280x800x24", "-fbdir",
        folder,          "-nolisten", "tcp",     "-noreset", NULL}; // no reset when the last window closes
    xvfb = process_start(arguments);
    setenv("DISPLAY", display, 1);
    for (int i = 0; i < 100 && !read_display(); i++)
        clock_sleep_until_ns(clock_now_ns() + 100000000);
    return read_display() ? 0 : -1;
}

static int tear_down(void **state)
{
    (void)state;
    end(&watcher);
    end(&weston);
    end(&xvfb);
    rehearsal_end(&rehearsal);
    return 0;
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_x11),
        cmocka_unit_test(test_wayland),
        cmocka_unit_test(test_lost_graphics_context_is_recreated),
        cmocka_unit_test(test_driving_with_the_map_beside),
        cmocka_unit_test(test_missing_display_is_reported),
        cmocka_unit_test(test_missing_graphics_driver_is_reported),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
