// The start screen: which recordings it finds, what touching it chooses, what it keeps; and that no word and no control
// is cut on screens of different shapes.
//
//     test_start          the tests
//     test_start FOLDER   and pictures of the screen
#include "tests/support/test.h"

#include "app/start/start.h"
#include "base/clock.h"
#include "platform/files/file.h"
#include "platform/files/png.h"
#include "tests/support/rehearsal.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

enum { WIDTH = 1280, HEIGHT = 800 };
static const double SCALE = 149 / 160.0; // px per dp of a 10-inch tablet

static const char *pictures; // NULL: none are wanted
static struct rehearsal rehearsal;
static struct gpu *gpu;
static char home[512], recents[600], settings[600];

static struct start start;
static struct gpu_target *target;
static int width, height;

static const char *in_home(const char *name)
{
    static char path[800];
    snprintf(path, sizeof path, "%s/%s", home, name);
    return path;
}

static void copy_to(const char *name)
{
    uint8_t *bytes;
    size_t count;
    EXPECT_STATUS(file_read(rehearsal.file, &bytes, &count), OK);
    EXPECT_STATUS(file_write_unsynced(in_home(name), bytes, count), OK);
    free(bytes);
}

static int set_up(void **state)
{
    (void)state;
    rehearsal = rehearsal_make();
    snprintf(home, sizeof home, "%s", scratch_file(&rehearsal.scratch, "home"));
    snprintf(recents, sizeof recents, "%s/state/reenact/recent", home);
    snprintf(settings, sizeof settings, "%s/config/reenact/settings", home);
    EXPECT_STATUS(folder_make(in_home("Films/Reenact/deep/er")), OK);
    EXPECT_STATUS(folder_make(in_home("Downloads")), OK);
    EXPECT_STATUS(folder_make(in_home("config")), OK);
    EXPECT_STATUS(file_write(in_home("config/user-dirs.dirs"), "# ours\nXDG_VIDEOS_DIR=\"$HOME/Films\"\n", 36), OK);
    setenv("HOME", home, 1);
    setenv("XDG_CONFIG_HOME", in_home("config"), 1);
    unsetenv("USER");
    return gpu_open(&gpu) == OK ? 0 : -1;
}

static int tear_down(void **state)
{
    (void)state;
    gpu_close(&gpu);
    rehearsal_end(&rehearsal);
    return 0;
}

// ---------------------------------------------------------------- the screen

static void open_screen(int wide, int high, const char *sample)
{
    const struct start_options options = {.settings = settings, .recents = recents, .sample = sample};
    width = wide, height = high;
    EXPECT_STATUS(gpu_target_open(&target, gpu, width, height), OK);
    EXPECT_STATUS(start_open(&start, gpu, &options), OK);
}

static void close_screen(void)
{
    start_close(&start);
    gpu_target_close(&target);
}

static void draw(void)
{
    const struct viewer_surface surface = {target, width, height, 0, SCALE};
    bool more = true;
    EXPECT_STATUS(start_draw(&start, &surface, clock_now_ns()), OK);
    while (more)
        EXPECT_STATUS(start_update(&start, &more), OK);
    EXPECT_STATUS(start_draw(&start, &surface, clock_now_ns()), OK);
}

static void save(const char *name)
{
    char path[700];
    if (!pictures)
        return;
    uint8_t *rgba = malloc((size_t)width * (size_t)height * 4);
    EXPECT_STATUS(gpu_target_read(target, rgba), OK);
    snprintf(path, sizeof path, "%s/start-%s-%dx%d.png", pictures, name, width, height);
    EXPECT_STATUS(png_write(path, PNG_RGBA8, rgba, width, height), OK);
    free(rgba);
}

static bool find(bool text, const char *words, struct ui_box *out)
{
    int count;
    const struct ui_mark *marks = ui_marks(start.ui, &count);
    for (int i = 0; i < count; i++)
        if (marks[i].is_text == text && strstr(marks[i].text, words)) {
            *out = marks[i].box;
            return true;
        }
    return false;
}

static void expect_text(const char *words)
{
    struct ui_box box;
    if (!find(true, words, &box)) {
        print_error("'%s' is not on the screen\n", words);
        fail_test();
    }
}

static void tap(const char *name)
{
    struct ui_box box = {0};
    draw();
    if (!find(false, name, &box)) {
        print_error("there is no '%s' to touch\n", name);
        fail_test();
    }
    // Not in the middle of a card, where nothing else may be; a card's picture is above.
    struct window_event finger = {.kind = WINDOW_POINTER_DOWN,
                                  .pointer = 3,
                                  .x = (box.x + 0.4 * box.w) * SCALE,
                                  .y = (box.y + 0.4 * box.h) * SCALE};
    (void)start_event(&start, &finger, SCALE, clock_now_ns());
    draw();
    finger.kind = WINDOW_POINTER_UP;
    (void)start_event(&start, &finger, SCALE, clock_now_ns());
    draw();
}

static struct start_choice chosen(void)
{
    struct start_choice choice;
    start_take_choice(&start, &choice);
    return choice;
}

// ---------------------------------------------------------------- tests

static void test_nothing_yet(void **state)
{
    (void)state;
    open_screen(WIDTH, HEIGHT, NULL);
    draw();
    save("empty");
    EXPECT_INT(start.shelf.count, 0);
    expect_text("Nothing has been recorded");
    tap("start-film");
    const struct start_choice choice = chosen();
    EXPECT_INT(choice.wish, START_WISHES_FILM);
    EXPECT_TRUE(strstr(choice.file, "/Films/Reenact/20") && strstr(choice.file, ".reenact"));
    EXPECT_INT(chosen().wish, START_WISHES_NOTHING);
    close_screen();
}

static void test_recordings_are_found_and_chosen(void **state)
{
    (void)state;
    copy_to("Films/Reenact/kata.reenact");
    copy_to("Films/Reenact/deep/er/older one.reenact");
    copy_to("Downloads/from a friend.reenact");
    copy_to("elsewhere.reenact");
    EXPECT_STATUS(file_write(in_home("Downloads/broken.reenact"), "no recording", 12), OK);
    EXPECT_STATUS(file_write(in_home("Downloads/notes.txt"), "text", 4), OK);
    EXPECT_STATUS(recent_add(recents, in_home("elsewhere.reenact"), INT64_C(32503680000)), OK); // in the year 3000
    open_screen(WIDTH, HEIGHT, in_home("elsewhere.reenact"));
    draw();
    save("shelf");
    EXPECT_INT(start.shelf.count, 5);
    EXPECT_TRUE(!strcmp(start.shelf.entries[0].name, "elsewhere"));
    expect_text("2 takes");
    expect_text("cannot be read");
    tap("start-card-0");
    struct start_choice choice = chosen();
    EXPECT_INT(choice.wish, START_WISHES_RECORDING);
    EXPECT_INT(choice.mode, START_WATCH);
    EXPECT_TRUE(strstr(choice.file, "/elsewhere.reenact"));
    tap("start-beside");
    tap("start-card-0");
    choice = chosen();
    EXPECT_INT(choice.mode, START_BESIDE);
    tap("start-sample");
    choice = chosen();
    EXPECT_INT(choice.wish, START_WISHES_RECORDING);
    EXPECT_INT(choice.mode, START_WATCH);
    close_screen();
}

static void test_a_file_is_dropped(void **state)
{
    (void)state;
    open_screen(WIDTH, HEIGHT, NULL);
    draw();
    start_drop(&start, "/somewhere/a file");
    const struct start_choice choice = chosen();
    EXPECT_INT(choice.wish, START_WISHES_RECORDING);
    EXPECT_TRUE(!strcmp(choice.file, "/somewhere/a file"));
    close_screen();
}

static void test_two_are_compared(void **state)
{
    (void)state;
    open_screen(WIDTH, HEIGHT, NULL);
    tap("start-compare");
    expect_text("Choose the reference");
    tap("start-card-0");
    EXPECT_INT(chosen().wish, START_WISHES_NOTHING);
    draw();
    expect_text("Choose the attempt");
    save("compare");
    start_back(&start.state);
    draw();
    expect_text("Choose the reference");
    tap("start-card-0");
    tap("start-card-2"); // after the broken one, which was written last
    const struct start_choice choice = chosen();
    EXPECT_INT(choice.wish, START_WISHES_RECORDING);
    EXPECT_INT(choice.mode, START_COMPARE);
    EXPECT_TRUE(strstr(choice.file, "/elsewhere.reenact"));
    EXPECT_TRUE(*choice.with && strcmp(choice.with, choice.file) != 0);
    close_screen();
}

static void test_what_cannot_be_read_is_said(void **state)
{
    (void)state;
    open_screen(WIDTH, HEIGHT, NULL);
    draw();
    for (int i = 0; i < start.shelf.count; i++)
        if (!strcmp(start.shelf.entries[i].name, "broken"))
            start_choose_recording(&start.state, i);
    EXPECT_INT(chosen().wish, START_WISHES_NOTHING);
    draw();
    expect_text("broken: cannot be read");
    close_screen();
}

static void test_forgotten_stays_on_the_disk(void **state)
{
    (void)state;
    struct recent_list list;
    open_screen(WIDTH, HEIGHT, NULL);
    tap("start-forget-0");
    EXPECT_INT(chosen().wish, START_WISHES_NOTHING);
    draw();
    EXPECT_INT(start.shelf.count, 4);
    expect_text("not listed any more");
    recent_read(recents, &list);
    EXPECT_INT(list.count, 0);
    EXPECT_TRUE(file_exists(in_home("elsewhere.reenact")));
    close_screen();
}

static void test_choices_of_the_screen_last(void **state)
{
    (void)state;
    open_screen(WIDTH, HEIGHT, NULL);
    draw();
    const bool dark = start.state.dark;
    tap("start-theme");
    close_screen();
    open_screen(WIDTH, HEIGHT, NULL);
    EXPECT_TRUE(start.state.dark != dark);
    close_screen();
}

static void test_nothing_is_cut(void **state)
{
    (void)state;
    static const int sizes[][2] = {{1280, 800}, {800, 1280}, {800, 480}, {480, 320}};
    for (size_t i = 0; i < COUNT_OF(sizes); i++) {
        int count, bad = 0;
        open_screen(sizes[i][0], sizes[i][1], in_home("elsewhere.reenact"));
        draw();
        save("shelf");
        const struct ui_mark *marks = ui_marks(start.ui, &count);
        for (int k = 0; k < count; k++) {
            const struct ui_box b = marks[k].box;
            const bool outside = b.x < -0.5 || b.x + b.w > width / SCALE + 0.5;
            if ((marks[k].is_text && marks[k].shortened) || outside) {
                print_error("%dx%d: '%s' is cut\n", width, height, marks[k].text);
                bad++;
            }
        }
        EXPECT_INT(bad, 0);
        close_screen();
    }
}

// ---------------------------------------------------------------- the list of what was opened

static void test_recents(void **state)
{
    (void)state;
    struct recent_list list;
    char file[600];
    snprintf(file, sizeof file, "%s/other/recent", home);
    recent_read(file, &list);
    EXPECT_INT(list.count, 0);
    const char *const names[] = {"a.reenact", "b.reenact", "a.reenact"};
    for (size_t i = 0; i < COUNT_OF(names); i++) {
        EXPECT_STATUS(file_write(in_home(names[i]), "x", 1), OK);
        EXPECT_STATUS(recent_add(file, in_home(names[i]), (int64_t)i), OK);
    }
    EXPECT_STATUS(recent_add(file, in_home("missing.reenact"), 9), ERR_INPUT);
    recent_read(file, &list);
    EXPECT_INT(list.count, 2);
    EXPECT_TRUE(strstr(list.at[0].path, "/a.reenact"));
    EXPECT_INT(list.at[0].opened_s, 2);
    EXPECT_TRUE(strstr(list.at[1].path, "/b.reenact"));
    static const char nonsense[] =
        "x\n5\n 7 /c\n8 relative\n9 /good one.reenact\n9 /good one.reenact\n\xff\xfe /d\n12 /";
    EXPECT_STATUS(file_write(file, nonsense, sizeof nonsense - 1), OK);
    recent_read(file, &list);
    EXPECT_TRUE(list.count >= 1 && strstr(list.at[list.count > 1 ? 1 : 0].path, "/"));
    for (int i = 0; i < RECENT_MAX + 5; i++) {
        char name[64];
        snprintf(name, sizeof name, "many-%d.reenact", i);
        EXPECT_STATUS(file_write_unsynced(in_home(name), "x", 1), OK);
        EXPECT_STATUS(recent_add(file, in_home(name), 100 + i), OK);
    }
    recent_read(file, &list);
    EXPECT_INT(list.count, RECENT_MAX);
    EXPECT_INT(list.at[0].opened_s, 100 + RECENT_MAX + 4);
}

int main(int argc, char **argv)
{
    pictures = argc > 1 ? argv[1] : NULL;
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_nothing_yet),
        cmocka_unit_test(test_recordings_are_found_and_chosen),
        cmocka_unit_test(test_a_file_is_dropped),
        cmocka_unit_test(test_two_are_compared),
        cmocka_unit_test(test_what_cannot_be_read_is_said),
        cmocka_unit_test(test_forgotten_stays_on_the_disk),
        cmocka_unit_test(test_choices_of_the_screen_last),
        cmocka_unit_test(test_nothing_is_cut),
        cmocka_unit_test(test_recents),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
