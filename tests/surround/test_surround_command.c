// What `reenact surround` writes: pictures, where they were taken from and how it went; never over anything without
// --force, never over a recording, and that is checked before anything is drawn.
#include "tests/support/test.h"

#include "platform/files/file.h"
#include "recording/recording.h"
#include "tests/support/answer.h"
#include "tests/support/robot_film.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

static struct scratch scratch;
static char folder[300], views[300], out[300];

static int make(void **state)
{
    (void)state;
    struct world_options options = world_default_options();
    struct world *world;
    struct surround_picture pictures[ROBOT_CAPTURES];
    options.plain = options.unshadowed = true;
    EXPECT_STATUS(world_open(&world, &options), OK);
    scratch = scratch_make();
    for (int i = 0; i < ROBOT_CAPTURES; i++)
        pictures[i] = robot_panorama(world, i);
    robot_film(&scratch, "robot", pictures, NULL);
    for (int i = 0; i < ROBOT_CAPTURES; i++)
        surround_picture_free(&pictures[i]);
    world_close(&world);
    snprintf(folder, sizeof folder, "%s", scratch_file(&scratch, "robot"));
    snprintf(views, sizeof views, "%s", scratch_file(&scratch, "views.txt"));
    snprintf(out, sizeof out, "%s", scratch_file(&scratch, "out"));
    scratch_text(&scratch, "views.txt", "a 0001 0 0 1.2 -0.5 0.5 -0.5 0.5\n");
    return 0;
}

static int tidy(void **state)
{
    (void)state;
    scratch_remove(&scratch);
    return 0;
}

static void expect_refused(const char *name, const char *words)
{
    const struct process_result said =
        PROCESS(PROGRAM_DIR "/reenact", "surround", folder, "--views", views, "--out", out);
    EXPECT_SENTENCE(said, name);
    EXPECT_SENTENCE(said, words);
}

static void test_nothing_is_overwritten(void **state)
{
    (void)state;
    static const char *const names[] = {"trajectory.txt", "stats.json", "a/0001.png"};
    char path[100];
    uint8_t *bytes;
    size_t count;
    for (size_t i = 0; i < COUNT_OF(names); i++) {
        snprintf(path, sizeof path, "out/%s", names[i]);
        scratch_text(&scratch, path, "mine");
        expect_refused(names[i], "--force");
        EXPECT_STATUS(file_read(scratch_file(&scratch, path), &bytes, &count), OK);
        EXPECT_INT(count, 4);
        free(bytes);
        EXPECT_INT(unlink(scratch_file(&scratch, path)), 0);
    }
    EXPECT_TRUE(!file_exists(scratch_file(&scratch, "out/a/0001.png"))); // refused before it was drawn
}

// By a link in the folder, and with --force.
static void test_a_recording_is_never_overwritten(void **state)
{
    (void)state;
    struct recording_writer *w;
    uint8_t *before, *after;
    size_t count, count_after;
    const char *film = scratch_file(&scratch, "film.reenact"), *to = scratch_file(&scratch, "out/trajectory.txt");
    EXPECT_STATUS(recording_create(&w, film), OK);
    EXPECT_STATUS(recording_close(&w), OK);
    EXPECT_STATUS(file_read(film, &before, &count), OK);
    EXPECT_INT(symlink(film, to), 0);
    const struct process_result said =
        PROCESS(PROGRAM_DIR "/reenact", "surround", folder, "--views", views, "--out", out, "--force");
    print_message("%s", said.err);
    EXPECT_TRUE(said.exit_code == 1 && strstr(said.err, "recording"));
    EXPECT_STATUS(file_read(film, &after, &count_after), OK);
    EXPECT_TRUE(count == count_after && !memcmp(before, after, count));
    free(before);
    free(after);
    EXPECT_INT(unlink(to), 0);
}

static void test_what_is_written(void **state)
{
    (void)state;
    struct process_result said =
        PROCESS(PROGRAM_DIR "/reenact", "surround", folder, "--views", views, "--out", out, "--layers");
    print_message("%s%s", said.out, said.err);
    EXPECT_INT(said.exit_code, 0);
    static const char *const names[] = {"out/trajectory.txt", "out/stats.json", "out/a/0001.png",
                                        "out/a/0001_source.png"};
    for (size_t i = 0; i < COUNT_OF(names); i++)
        EXPECT_TRUE(file_exists(scratch_file(&scratch, names[i])));
    uint8_t *text;
    size_t count;
    double v[8];
    EXPECT_STATUS(file_read(scratch_file(&scratch, names[0]), &text, &count), OK);
    const char *line = strchr((const char *)text, '\n'); // after the comment
    EXPECT_TRUE(line && sscanf(line, "%lf %lf %lf %lf %lf %lf %lf %lf", v, v + 1, v + 2, v + 3, v + 4, v + 5, v + 6,
                               v + 7) == 8);
    free(text);
    expect_refused("trajectory.txt", "--force");
    said = PROCESS(PROGRAM_DIR "/reenact", "surround", folder, "--views", views, "--out", out, "--force");
    EXPECT_INT(said.exit_code, 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_nothing_is_overwritten),
        cmocka_unit_test(test_a_recording_is_never_overwritten),
        cmocka_unit_test(test_what_is_written),
    };
    return cmocka_run_group_tests(tests, make, tidy);
}
