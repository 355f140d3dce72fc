// The driver's window on a real X server (Xvfb): a played robot is found in the recorded place while the window runs,
// and what stands there appears in the map; M hides it, Escape leaves.
#include "tests/support/test.h"

#include "base/clock.h"
#include "recording/recorded_things.h"
#include "tests/support/display.h"
#include "tests/support/film.h"
#include "tests/support/process.h"
#include "tests/support/robot_film.h"

#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/wait.h>

enum { WIDTH = 1280, HEIGHT = 800 };
static const uint32_t ACCENT = 0x2dd4bf, KEY_ESCAPE = 0xff1b;

static struct scratch scratch;
static struct display display;
static pid_t driver; // 0: not running

static int make(void **state)
{
    (void)state;
    struct world_options options = world_default_options();
    struct world *world;
    struct recording_writer *writer;
    struct surround_picture pictures[ROBOT_CAPTURES];
    struct recorded_thing thing = {
        .name = "chair", .world_from_thing = {{0, 0, 0, 1}, {0.4, -0.7, 0.4}}, .width_m = 0.6, .height_m = 0.6};
    options.threads = 2;
    EXPECT_STATUS(world_open(&world, &options), OK);
    scratch = scratch_make();
    struct place place = film_true_place(world, 1);
    for (int i = 0; i < ROBOT_CAPTURES; i++)
        pictures[i] = robot_panorama(world, i);
    robot_film(&scratch, "robot", pictures, NULL);
    EXPECT_STATUS(recording_create(&writer, scratch_file(&scratch, "room.reenact")), OK);
    EXPECT_STATUS(recording_put_place(writer, &place), OK);
    EXPECT_STATUS(recording_close(&writer), OK);
    EXPECT_STATUS(recording_write_things(scratch_file(&scratch, "room.reenact"), &thing, 1), OK);
    for (int i = 0; i < ROBOT_CAPTURES; i++)
        surround_picture_free(&pictures[i]);
    place_free(&place);
    world_close(&world);
    setenv("SDL_VIDEODRIVER", "x11", 1);
    return !display_open(&display, scratch.path, WIDTH, HEIGHT);
}

static int tidy(void **state)
{
    (void)state;
    if (driver) {
        kill(driver, SIGKILL);
        waitpid(driver, NULL, 0);
    }
    display_close(&display);
    scratch_remove(&scratch);
    return 0;
}

// Waits until the right half has so many pixels of the accent or, `fewer`, at most so many.
static int wait_accent(int wanted, bool fewer)
{
    int count = -1;
    for (int i = 0; i < 600 * PROCESS_PATIENCE && (count < 0 || (fewer ? count > wanted : count < wanted)); i++) {
        clock_sleep_until_ns(clock_now_ns() + 100000000);
        if (display_read(&display))
            count = display_count(&display, ACCENT, WIDTH / 2, 0, WIDTH, HEIGHT);
    }
    return count;
}

static void test_the_map_has_the_rooms_things(void **state)
{
    (void)state;
    char uri[300], file[256];
    snprintf(uri, sizeof uri, "folder:%s/robot", scratch.path);
    snprintf(file, sizeof file, "%s", scratch_file(&scratch, "room.reenact"));
    const char *const arguments[] = {PROGRAM_DIR "/reenact", "drive", uri, file, "--map", NULL};
    driver = process_start(arguments);
    const int found = wait_accent(100, false);
    print_message("%d pixels of the thing\n", found);
    EXPECT_AT_LEAST(found, 100);
    EXPECT_AT_MOST(display_count(&display, ACCENT, 0, 0, WIDTH / 2, HEIGHT), 20);
    display_key(&display, 'm');
    EXPECT_AT_MOST(wait_accent(20, true), 20);
    display_key(&display, KEY_ESCAPE);
    int status = 0;
    EXPECT_INT(waitpid(driver, &status, 0), driver);
    driver = 0;
    EXPECT_TRUE(WIFEXITED(status));
    EXPECT_INT(WEXITSTATUS(status), 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_the_map_has_the_rooms_things),
    };
    // Drivers and the desktop bus, loaded and unloaded by SDL, leak; leaks of the screen are checked in
    // test_drive_screen.
    setenv("ASAN_OPTIONS", "detect_leaks=0:verify_asan_link_order=0", 1);
    return cmocka_run_group_tests(tests, make, tidy);
}
