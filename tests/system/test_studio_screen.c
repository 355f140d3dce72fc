// The studio's program on a real X server (Xvfb), with OpenNI2's fake sensor: keys and the pointer are pressed, the
// screen is read, and what the file holds afterwards is checked.
//
//     test_studio_screen             the tests
//     test_studio_screen FOLDER      pictures of its pages, wide and upright, dark and light, for the documents
#include "tests/support/test.h"

#include "base/clock.h"
#include "capture/recorder.h"
#include "platform/files/file.h"
#include "platform/files/png.h"
#include "recording/recording.h"
#include "tests/support/display.h"
#include "tests/support/film.h"
#include "tests/support/process.h"

#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>

static const int64_t SECOND_NS = 1000000000;
static const double FILM_HZ = 10; // slow enough that a slow machine keeps up
enum { SWEEP_IMAGES = 24, ACTOR_IMAGES = 20 };
static const uint32_t KEY_ENTER = 0xff0d, KEY_ESCAPE = 0xff1b; // keysyms; those of letters are the letters

struct area {
    int left, top, right, bottom;
};

// Where the pages have what they are known by, with a pixel a dp.
struct layout {
    const char *name;
    int width, height;
    struct area picture, main, keep, done, keep_room, plan;
};

static const struct layout layouts[] = {{.name = "wide",
                                         .width = 1280,
                                         .height = 800,
                                         .picture = {20, 86, 854, 712},
                                         .main = {1156, 722, 1260, 778}, // Film, and Stop
                                         .keep = {20, 722, 262, 780},
                                         .done = {1104, 724, 1258, 778},
                                         .keep_room = {20, 722, 428, 780},
                                         .plan = {632, 86, 1260, 712}},
                                        {.name = "upright",
                                         .width = 800,
                                         .height = 1280,
                                         .picture = {20, 86, 780, 656},
                                         .main = {695, 1195, 776, 1235}, // its middle: the texts beside it break
                                         .keep = {20, 1202, 149, 1260},
                                         .done = {622, 1202, 780, 1260},
                                         .keep_room = {20, 1202, 248, 1260},
                                         .plan = {20, 578, 780, 1190}}};
static const struct layout *layout = layouts;
static bool light;

static struct scratch scratch;
static struct display display;
static pid_t studio;                           // 0: not running
static const char *const file = "gym.reenact"; // in the scratch folder, where it runs
static const char *pictures;                   // folder; NULL: none are wanted

static uint32_t accent(void) { return light ? 0x0b8578 : 0x2dd4bf; }
static uint32_t warn(void) { return light ? 0xb45309 : 0xfbbf24; }
static const uint32_t RED = 0xef4444; // of the recording mark

// ---------------------------------------------------------------- the screen

static bool filled(struct area a, uint32_t color, double share)
{
    return display_count(&display, color, a.left, a.top, a.right, a.bottom) >
           share * (a.right - a.left) * (a.bottom - a.top);
}

static bool shows_film_button(void) { return filled(layout->main, accent(), 0.6); }
static bool shows_keep(void) { return filled(layout->keep, accent(), 0.7); }
static bool shows_keep_room(void) { return filled(layout->keep_room, accent(), 0.6); }
static bool shows_done(void) { return filled(layout->done, accent(), 0.6); }
static bool shows_red_mark(void)
{
    return display_count(&display, RED, layout->picture.left, layout->picture.top, layout->picture.left + 60,
                         layout->picture.top + 60) > 120;
}
// The countdown's ring and the pause's bars, in the picture's middle.
static int in_the_middle(uint32_t color)
{
    const struct area p = layout->picture;
    const int x = (p.left + p.right) / 2, y = (p.top + p.bottom) / 2;
    return display_count(&display, color, x - 80, y - 80, x + 80, y + 80);
}
static bool shows_countdown(void) { return in_the_middle(accent()) > 2000; }
static bool shows_pause(void) { return in_the_middle(warn()) > 1500; }
static bool shows_no_pause(void) { return in_the_middle(warn()) < 1000; }
// The numbers of most of the fifteen tags (some 9000 pixels): with those of one side of the room alone the sensor of
// the takes would not be located. The documents' sweep is longer, and one of their pages small.
static bool shows_plan(void)
{
    const struct area p = layout->plan;
    return shows_done() &&
           display_count(&display, accent(), p.left, p.top, p.right, p.bottom) > (pictures ? 6000 : 7500);
}
static bool shows_live_picture(void)
{
    const struct area p = layout->picture;
    return shows_film_button() &&
           display_colors(&display, p.left + 100, p.top + 20, p.right - 100, p.bottom - 100) > 100;
}

// Until the program's screen is as wanted; time plays no part in the result.
static void wait_screen(bool (*wanted)(void), const char *what)
{
    const int64_t until = clock_now_ns() + 120 * SECOND_NS * PROCESS_PATIENCE;
    bool there = false;
    while (!there && clock_now_ns() < until) {
        clock_sleep_until_ns(clock_now_ns() + 30000000);
        if (waitpid(studio, NULL, WNOHANG) == studio) {
            studio = 0;
            print_error("the program has ended before it showed %s\n", what);
            break;
        }
        there = display_read(&display) && wanted();
    }
    if (!there)
        print_error("%s is not on the screen\n", what);
    EXPECT_TRUE(there);
}

static void save(const char *page)
{
    char path[600];
    if (!pictures)
        return;
    clock_sleep_until_ns(clock_now_ns() + SECOND_NS / 2); // the whole page, not half of it
    EXPECT_TRUE(display_read(&display));
    snprintf(path, sizeof path, "%s/studio-%s-%s-%s.png", pictures, page, layout->name, light ? "light" : "dark");
    EXPECT_STATUS(png_write(path, PNG_RGB8, display.rgb, display.width, display.height), OK);
}

static void click(struct area a) { display_click(&display, (a.left + a.right) / 2, (a.top + a.bottom) / 2); }

// ---------------------------------------------------------------- the program

static void fake(const char *name, const char *value)
{
    char full[64];
    snprintf(full, sizeof full, "REENACT_FAKE_SENSOR%s%s", *name ? "_" : "", name);
    setenv(full, value, 1);
}

static void end_studio(void)
{
    if (studio) {
        kill(studio, SIGKILL);
        waitpid(studio, NULL, 0);
    }
    studio = 0;
}

// 160 dots an inch: a pixel is a dp.
static void start_studio(const char *sensor)
{
    char size[32];
    end_studio(); // what a failed test left
    snprintf(size, sizeof size, "%dx%d", layout->width, layout->height);
    fake("", scratch_file(&scratch, sensor));
    const char *const arguments[] = {
        PROGRAM_DIR "/reenact-capture", "studio", file, "--sensor", "openni", "--dpi", "160", "--size", size,
        light ? "--light" : NULL,       NULL};
    studio = process_start(arguments);
    wait_screen(shows_live_picture, "the sensor's picture");
}

// It was asked to end.
static void expect_end(void)
{
    int status = 0;
    EXPECT_INT(waitpid(studio, &status, 0), studio);
    studio = 0;
    EXPECT_TRUE(WIFEXITED(status));
    EXPECT_INT(WEXITSTATUS(status), 0);
}

// ---------------------------------------------------------------- the file

// Frames of a take, and the time of the last from the first on, as another program reads them; -1: none yet.
static int64_t frames_in(const char *name, int64_t *last_ns)
{
    struct recording *recording = NULL;
    struct take *take = NULL;
    int64_t frames = -1;
    if (file_exists(file) && recording_open(&recording, file) == OK && take_open(&take, recording, name) == OK)
        frames = take_frame_count(take);
    *last_ns = frames > 0 ? take_entry(take, frames - 1)->time_ns - take_entry(take, 0)->time_ns : 0;
    take_close(&take);
    recording_free(&recording);
    return frames;
}

static void wait_frames(const char *name, int64_t wanted)
{
    const int64_t until = clock_now_ns() + 120 * SECOND_NS * PROCESS_PATIENCE;
    int64_t last_ns, frames = 0;
    while ((frames = frames_in(name, &last_ns)) < wanted && clock_now_ns() < until)
        clock_sleep_until_ns(clock_now_ns() + 30000000);
    EXPECT_AT_LEAST((double)frames, (double)wanted);
}

static int tags_in_the_place(void)
{
    struct recording *recording = NULL;
    struct place place = {0};
    int count = -1;
    if (file_exists(file) && recording_open(&recording, file) == OK && recording_read_place(recording, &place) == OK)
        count = place.tag_count;
    place_free(&place);
    recording_free(&recording);
    return count;
}

static void expect_sound(int takes, int interrupted)
{
    struct recording_report report;
    EXPECT_STATUS(recording_verify(file, &report), OK);
    EXPECT_INT(report.findings, 0);
    EXPECT_INT(report.takes, takes);
    EXPECT_INT(report.interrupted_takes, interrupted);
}

// ---------------------------------------------------------------- the tests

static void test_the_room_is_swept(void **state)
{
    (void)state;
    fake("FPS", "10");
    start_studio("sweep");
    display_key(&display, 'm');
    wait_screen(shows_plan, "the plan of the room");
    save("room");
    click(layout->done);
    wait_screen(shows_keep_room, "the choice to keep the room");
    EXPECT_INT(tags_in_the_place(), -1);
    save("room-review");
    display_key(&display, 'k');
    const int64_t until = clock_now_ns() + 60 * SECOND_NS * PROCESS_PATIENCE;
    while (tags_in_the_place() < 3 && clock_now_ns() < until)
        clock_sleep_until_ns(clock_now_ns() + 30000000);
    EXPECT_AT_LEAST(tags_in_the_place(), 3);
    display_key(&display, 'q');
    expect_end();
    expect_sound(0, 0);
}

static void begin_take(void)
{
    display_key(&display, ' ');
    wait_screen(shows_countdown, "the countdown");
    save("countdown");
    wait_screen(shows_red_mark, "the mark of a recording");
}

// By keys and by the pointer; in the place that was swept before.
static void test_a_take_pauses_and_is_kept(void **state)
{
    (void)state;
    struct recording *recording;
    struct take *take;
    if (pictures)
        fake("FPS", "30");
    start_studio("actor");
    save("live");
    begin_take();
    wait_frames("take-1", 8);
    save("recording");
    display_key(&display, 'p');
    wait_screen(shows_pause, "that it pauses");
    save("paused");
    clock_sleep_until_ns(clock_now_ns() + SECOND_NS / 2); // no pause where the sensor has no frame in it
    display_key(&display, 'p');
    wait_screen(shows_no_pause, "that it goes on");
    int64_t last_ns;
    wait_frames("take-1", frames_in("take-1", &last_ns) + 12);
    click(layout->main);
    wait_screen(shows_keep, "the choice to keep the take");
    save("review");
    display_key(&display, 'n');
    clock_sleep_until_ns(clock_now_ns() + 2 * SECOND_NS); // what is typed before the page is seen is not meant for it
    for (const char *key = "\b\b\b\b\b\bkata"; *key; key++)
        display_key(&display, *key == '\b' ? 0xff08 : (uint32_t)*key);
    save("rename");
    display_key(&display, KEY_ENTER);
    wait_screen(shows_keep, "the choice to keep the take");
    if (pictures) {
        display_key(&display, 'p');
        clock_sleep_until_ns(clock_now_ns() + 8 * SECOND_NS); // until its avatar is made
        save("playback");
        display_key(&display, KEY_ESCAPE);
        wait_screen(shows_keep, "the choice to keep the take");
    }
    click(layout->keep);
    wait_screen(shows_live_picture, "the sensor's picture");
    display_key(&display, 'q');
    expect_end();
    expect_sound(1, 0);
    EXPECT_STATUS(recording_open(&recording, file), OK);
    EXPECT_STATUS(take_open(&take, recording, "kata"), OK);
    int64_t longest_ns = 0; // the pause's; longer where a busy machine left out the frames beside it, too
    for (int64_t i = 1; i < take_frame_count(take); i++) {
        const int64_t gap_ns = take_entry(take, i)->time_ns - take_entry(take, i - 1)->time_ns;
        longest_ns = gap_ns > longest_ns ? gap_ns : longest_ns;
    }
    EXPECT_AT_LEAST((double)longest_ns, (double)RECORDER_PAUSE_NS);
    EXPECT_TRUE(take_entry(take, take_frame_count(take) - 1)->located);
    take_close(&take);
    recording_free(&recording);
}

// The window is closed during a take: it is ended first, whole.
static void test_a_closed_window_keeps_the_take(void **state)
{
    (void)state;
    int64_t last_ns;
    start_studio("actor");
    begin_take();
    wait_frames("take-1", 8);
    display_close_window(&display);
    expect_end();
    expect_sound(2, 0);
    EXPECT_AT_LEAST((double)frames_in("take-1", &last_ns), 8);
}

static void test_a_kill_costs_at_most_a_second(void **state)
{
    (void)state;
    int64_t before_ns, kept_ns;
    start_studio("actor");
    begin_take();
    wait_frames("take-2", 8);
    const int64_t frames = frames_in("take-2", &before_ns), from_ns = clock_now_ns();
    clock_sleep_until_ns(from_ns + SECOND_NS + SECOND_NS / 2);
    const int64_t filmed_ns = before_ns + clock_now_ns() - from_ns; // by the sensor, at least
    end_studio();
    expect_sound(3, 1);
    EXPECT_AT_LEAST((double)frames_in("take-2", &kept_ns), (double)frames);
    print_message("%.2f s filmed at least, %.2f s kept\n", 1e-9 * (double)filmed_ns, 1e-9 * (double)kept_ns);
    EXPECT_AT_LEAST(1e-9 * (double)kept_ns, 1e-9 * (double)(filmed_ns - SECOND_NS));
}

// A sensor that is unplugged while it sweeps: what it saw until then is a map.
static void test_map_of_a_sweep_cut_off(void **state)
{
    (void)state;
    char tags[300], cut[300];
    struct recording *recording;
    struct place place;
    snprintf(tags, sizeof tags, "%s", scratch_file(&scratch, "tags.json"));
    snprintf(cut, sizeof cut, "%s", scratch_file(&scratch, "cut.reenact"));
    fake("", scratch_file(&scratch, "sweep"));
    fake("UNPLUG_AFTER", "16");
    const struct process_result said =
        PROCESS(PROGRAM_DIR "/reenact-capture", "map", "--sensor", "openni", "--tags", tags, "--out", cut);
    fake("UNPLUG_AFTER", "-1");
    print_message("%s%s", said.out, said.err);
    EXPECT_INT(said.exit_code, 1);
    EXPECT_TRUE(strstr(said.err, "unplugged: the map is of what was swept until then"));
    EXPECT_STATUS(recording_open(&recording, cut), OK);
    EXPECT_STATUS(recording_read_place(recording, &place), OK);
    EXPECT_AT_LEAST(place.tag_count, 3);
    place_free(&place);
    recording_free(&recording);
}

// ---------------------------------------------------------------- all of it

static void film(void)
{
    struct world *world;
    struct world_options o = world_default_options();
    o.motion = "kata";
    o.threads = 2;
    EXPECT_STATUS(world_open(&world, &o), OK);
    film_sweep(world, &scratch, "sweep", 1, pictures ? 72 : SWEEP_IMAGES, "tags.json");
    film_sensor_at(world, &scratch, "actor", 1, pictures ? 30 : FILM_HZ, pictures ? 120 : ACTOR_IMAGES);
    world_close(&world);
}

static int set_up(void **state)
{
    (void)state;
    // Drivers and the desktop bus, loaded and unloaded by SDL, leak; leaks of the studio are checked in test_studio.
    setenv("ASAN_OPTIONS", "detect_leaks=0:verify_asan_link_order=0", 1);
    setenv("SDL_VIDEODRIVER", "x11", 1);
    setenv("LD_LIBRARY_PATH", OPENNI2_DIR, 1);
    scratch = scratch_make();
    setenv("XDG_DATA_HOME", scratch.path, 1); // no networks: the same on every machine
    EXPECT_INT(chdir(scratch.path), 0);
    fake("AT_END", "loop");
    film();
    return display_open(&display, scratch.path, layout->width, layout->height) ? 0 : -1;
}

static int tear_down(void **state)
{
    (void)state;
    end_studio();
    display_close(&display);
    EXPECT_INT(chdir("/"), 0);
    scratch_remove(&scratch);
    return 0;
}

// One display of each size, from nothing to a take that is kept.
static void test_pictures(void **state)
{
    for (size_t i = 0; i < 2 * COUNT_OF(layouts); i++) {
        layout = &layouts[i / 2];
        light = i % 2;
        display_close(&display);
        EXPECT_TRUE(display_open(&display, scratch.path, layout->width, layout->height));
        remove(file);
        test_the_room_is_swept(state);
        test_a_take_pauses_and_is_kept(state);
    }
}

int main(int argc, char **argv)
{
    const struct CMUnitTest all[] = {cmocka_unit_test(test_pictures)};
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_the_room_is_swept),
        cmocka_unit_test(test_a_take_pauses_and_is_kept),
        cmocka_unit_test(test_a_closed_window_keeps_the_take),
        cmocka_unit_test(test_a_kill_costs_at_most_a_second),
        cmocka_unit_test(test_map_of_a_sweep_cut_off),
    };
    pictures = argc > 1 ? argv[1] : NULL;
    return pictures ? cmocka_run_group_tests(all, set_up, tear_down) : cmocka_run_group_tests(tests, set_up, tear_down);
}
