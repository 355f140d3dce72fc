// What the user chose is found again at the next start; nonsense in the file is left out with one line, and the file is
// whole or not there.
#include "tests/support/test.h"

#include "app/viewer/settings.h"
#include "tests/support/scratch.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

static void test_choices_are_found_again(void **state)
{
    (void)state;
    char why[512], path[600];
    struct scratch scratch = scratch_make();
    snprintf(path, sizeof path, "%s/config/reenact/settings", scratch.path); // folders that are not there yet
    struct view_state s = view_state_start(1, true, 0), again = s;
    view_state_do(&s, DO_THEME, 0);
    view_state_do(&s, DO_SKELETON, 0);
    view_state_do(&s, DO_INSET, 0);
    view_state_do(&s, DO_FILMED, 0);
    view_state_do(&s, DO_NAMES, 0);
    view_state_do(&s, DO_LOOP, 0);
    view_state_do(&s, DO_TEXT_SIZE, 0);
    view_state_do(&s, (enum view_action)(DO_DETAIL + DETAIL_PARTS), 0);
    view_state_set_speed(&s, 0.25, 0);
    const struct settings chosen = settings_of(&s);
    EXPECT_STATUS(settings_file_write(path, &chosen), OK);
    struct settings read = settings_of(&again);
    EXPECT_TRUE(!settings_equal(&read, &chosen));
    settings_file_read(path, &read, why, sizeof why);
    EXPECT_TRUE(!*why);
    settings_apply(&read, &again, 0);
    EXPECT_TRUE(!again.dark && again.skeleton == s.skeleton && again.inset == s.inset);
    EXPECT_TRUE(again.room.filmed == s.room.filmed && again.room.names == s.room.names);
    EXPECT_INT(again.playback.loop, s.playback.loop);
    EXPECT_NEAR(again.text_size, 1.25, 0);
    EXPECT_NEAR(again.playback.speed, 0.25, 0);
    EXPECT_INT(again.detail, DETAIL_PARTS);
    scratch_remove(&scratch);
}

static void test_nonsense_is_left_out(void **state)
{
    (void)state;
    static const struct {
        const char *text;
        int wrong;
    } cases[] = {{"", 0},
                 {"dark 0\n", 0},
                 {"dark", 1},
                 {"dark 7\n", 1},
                 {"dark 0x\n\nspeed 99\ntext nan\n", 3},
                 {"speed 1e999\ntext -1\nunknown 1\n", 3},
                 {"dark 0\nspeed 0.5\ngarbage\xff\xfe\n", 1},
                 {"detail full\ndetail finest\ndetail \n", 2}};
    const struct view_state start = view_state_start(1, true, 0);
    for (size_t i = 0; i < COUNT_OF(cases); i++) {
        struct settings settings = settings_of(&start);
        EXPECT_INT(settings_read(&settings, cases[i].text), cases[i].wrong);
        EXPECT_TRUE(settings.text_size >= 1 && settings.text_size <= 1.5);
        EXPECT_TRUE(settings.speed >= 0.1 && settings.speed <= 2);
    }
    struct settings settings = settings_of(&start);
    (void)settings_read(&settings, cases[6].text);
    EXPECT_TRUE(!settings.dark); // the good lines hold
    EXPECT_NEAR(settings.speed, 0.5, 0);
}

static void test_odd_files_harm_nothing(void **state)
{
    (void)state;
    char why[512], path[600];
    struct scratch scratch = scratch_make();
    const struct view_state start = view_state_start(1, true, 0);
    const struct settings before = settings_of(&start);
    struct settings settings = before;
    snprintf(path, sizeof path, "%s/settings", scratch.path);
    settings_file_read(path, &settings, why, sizeof why); // none
    EXPECT_TRUE(!*why && settings_equal(&settings, &before));
    char *large = calloc(1, 100001);
    memset(large, 'x', 100000);
    scratch_text(&scratch, "settings", large);
    settings_file_read(path, &settings, why, sizeof why);
    EXPECT_TRUE(*why && !strchr(why, '\n') && settings_equal(&settings, &before));
    free(large);
    EXPECT_INT(unlink(path), 0);
    EXPECT_INT(mkdir(path, 0700), 0);
    settings_file_read(path, &settings, why, sizeof why);
    EXPECT_TRUE(*why && settings_equal(&settings, &before));
    EXPECT_TRUE(settings_file_write(path, &settings) < 0);
    scratch_remove(&scratch);
}

static void test_where_the_file_is(void **state)
{
    (void)state;
    char path[300];
    setenv("HOME", "/home/someone", 1);
    setenv("XDG_CONFIG_HOME", "/etc/other", 1);
    EXPECT_TRUE(settings_file_path(path, sizeof path));
    assert_string_equal(path, "/etc/other/reenact/settings");
    setenv("XDG_CONFIG_HOME", "relative", 1); // to be ignored
    EXPECT_TRUE(settings_file_path(path, sizeof path));
    assert_string_equal(path, "/home/someone/.config/reenact/settings");
    unsetenv("XDG_CONFIG_HOME");
    unsetenv("HOME");
    EXPECT_TRUE(!settings_file_path(path, sizeof path));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_choices_are_found_again),
        cmocka_unit_test(test_nonsense_is_left_out),
        cmocka_unit_test(test_odd_files_harm_nothing),
        cmocka_unit_test(test_where_the_file_is),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
