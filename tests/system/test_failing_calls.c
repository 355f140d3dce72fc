// One allocation or one call of SQLite fails: every command says a sentence and ends with exit code 1, or does its work
// all the same; none crashes, and no recording is damaged or changed.
//
// test_failing_calls [COUNT]: that many calls of each kind and command, spread evenly; 0: every single one. Default 3.
#include "tests/support/test.h"

#include "base/clock.h"
#include "capture/recording/recording.h"
#include "platform/file.h"
#include "tests/support/process.h"
#include "tests/support/rehearsal.h"

#include <stdio.h>
#include <string.h>
#include <unistd.h>

enum { ARGUMENTS_MAX = 16 };

static long count_wanted = 3;
static struct rehearsal rehearsal;
static char made[512], counted[512], folder[512];

static struct process_result run(const char *const *argv, const char *kind, long at)
{
    char text[32];
    snprintf(text, sizeof text, "%ld", at);
    setenv("LD_PRELOAD", FAIL_CALLS, 1);
    setenv("FAIL_CALL", kind, 1);
    setenv("FAIL_AT", text, 1);
    setenv("FAIL_COUNT", counted, 1);
    struct process_result said = process_run(argv);
    unsetenv("LD_PRELOAD");
    return said;
}

static long calls_of(void)
{
    uint8_t *bytes;
    size_t size;
    EXPECT_STATUS(file_read(counted, &bytes, &size), OK);
    const long calls = atol((char *)bytes);
    free(bytes);
    return calls;
}

static void remove_made(void)
{
    char command[600];
    recording_discard(made);
    snprintf(command, sizeof command, "rm -rf %s", folder);
    EXPECT_INT(system(command), 0);
}

static size_t lines_of(const char *text)
{
    size_t lines = 0;
    for (; *text; text++)
        lines += *text == '\n';
    return lines;
}

// Each of the calls that the command makes, or some of them, fails once.
static void fail_each(const char *const *argv, const char *kind)
{
    remove_made();
    struct process_result said = run(argv, kind, 0);
    if (said.exit_code)
        print_error("%s %s: %s\n", argv[0], argv[1], said.err);
    EXPECT_INT(said.exit_code, 0);
    const long calls = calls_of(), step = count_wanted && calls > count_wanted ? calls / count_wanted : 1;
    int clean = 0, same = 0;
    for (long at = 1 + (step > 1 ? step / 2 : 0); at <= calls; at += step) {
        remove_made();
        said = run(argv, kind, at);
        if (said.exit_code == 0)
            same++;
        else if (said.exit_code == 1 && lines_of(said.err) >= 1)
            clean++;
        else {
            print_error("%s %s, %s %ld: exit code %d, '%s'\n", argv[0], argv[1], kind, at, said.exit_code, said.err);
            fail_test();
        }
        struct recording_report report;
        if (file_exists(made)) // what was written until then is sound
            EXPECT_STATUS(recording_verify(made, &report), OK);
    }
    print_message("%-8s %-6s %ld calls: %d ended with a sentence, %d did their work all the same\n", argv[1], kind,
                  calls, clean, same);
}

static void test_commands(void **state)
{
    (void)state;
    char camera[600], sensor[600], tags[512];
    snprintf(camera, sizeof camera, "folder:%s", scratch_file(&rehearsal.scratch, "viewer"));
    snprintf(sensor, sizeof sensor, "folder:%s", scratch_file(&rehearsal.scratch, "sensor"));
    snprintf(tags, sizeof tags, "%s", scratch_file(&rehearsal.scratch, "tags.json"));
    const char *capture = PROGRAM_DIR "/reenact-capture", *reenact = PROGRAM_DIR "/reenact";
    const char *const commands[][ARGUMENTS_MAX] = {
        {capture, "record", "--sensor", sensor, "--out", made, "--take", "a", "--no-body-points", NULL},
        {capture, "verify", rehearsal.file, NULL},
        {capture, "info", rehearsal.file, NULL},
        {capture, "export", rehearsal.file, "--take", "turn", "--as", "joints-csv", "--out", made, NULL},
        {capture, "map", "--sensor", sensor, "--tags", tags, "--out", made, NULL},
        {reenact, "render", rehearsal.file, "--take", "turn", "--camera", camera, "--detail", "paper", "--out", folder,
         NULL},
        {reenact, "compare", rehearsal.file, "--take", "turn", "--with", rehearsal.file, "--with-take", "turn", NULL},
    };
    uint8_t *before, *after;
    size_t size, size_after;
    EXPECT_STATUS(file_read(rehearsal.file, &before, &size), OK);
    for (size_t i = 0; i < COUNT_OF(commands); i++) {
        fail_each(commands[i], "alloc");
        fail_each(commands[i], "sqlite");
    }
    EXPECT_STATUS(file_read(rehearsal.file, &after, &size_after), OK);
    EXPECT_TRUE(size == size_after && !memcmp(before, after, size)); // none of them changes what it reads
    free(before);
    free(after);
}

// tags.json of the recording's place.
static void write_tags(void)
{
    char text[4096] = "{\"family\": \"tag36h11\", \"side_m\": {";
    struct recording *r;
    struct place place;
    EXPECT_STATUS(recording_open(&r, rehearsal.file), OK);
    EXPECT_STATUS(recording_read_place(r, &place), OK);
    for (int32_t i = 0; i < place.tag_count; i++)
        sprintf(text + strlen(text), "%s\"%d\": %g", i ? ", " : "", (int)place.tags[i].id, place.tags[i].side_m);
    strcat(text, "}}");
    scratch_text(&rehearsal.scratch, "tags.json", text);
    place_free(&place);
    recording_free(&r);
}

static int set_up(void **state)
{
    (void)state;
    rehearsal = rehearsal_make();
    snprintf(made, sizeof made, "%s", scratch_file(&rehearsal.scratch, "made"));
    snprintf(counted, sizeof counted, "%s", scratch_file(&rehearsal.scratch, "calls"));
    snprintf(folder, sizeof folder, "%s", scratch_file(&rehearsal.scratch, "pictures"));
    write_tags();
    return 0;
}

static int tear_down(void **state)
{
    (void)state;
    rehearsal_end(&rehearsal);
    return 0;
}

int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_commands)};
    if (argc > 1)
        count_wanted = atol(argv[1]);
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
