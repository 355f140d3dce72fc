// What the commands write: never over a recording, over nothing without --force, checked before long work. And the
// commands that look after a recording.
#include "tests/support/test.h"

#include "platform/files/file.h"
#include "platform/files/output.h"
#include "recording/recording.h"
#include "tests/support/answer.h"
#include "tests/support/scratch.h"
#include "tests/support/sql.h"

#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#define CAPTURE PROGRAM_DIR "/reenact-capture"
#define REENACT PROGRAM_DIR "/reenact"

static struct scratch scratch;
static char file[512];

static const char *path_of(const char *name)
{
    static char ring[8][512];
    static int next;
    char *path = ring[next++ % 8];
    snprintf(path, sizeof ring[0], "%s", scratch_file(&scratch, name));
    return path;
}

// `...`: the output, and options after it.
#define EXPORT(...) PROCESS(CAPTURE, "export", file, "--take", "one", "--as", "joints-csv", "--out", __VA_ARGS__)

static void test_a_recording_is_never_overwritten(void **state)
{
    (void)state;
    uint8_t *before, *after;
    size_t count, count_after;
    char other_path[600];
    EXPECT_STATUS(file_read(file, &before, &count), OK);
    EXPECT_INT(symlink(file, path_of("link")), 0);
    EXPECT_INT(link(file, path_of("hard")), 0);
    snprintf(other_path, sizeof other_path, "%s/../%s/old.reenact", scratch.path, strrchr(scratch.path, '/') + 1);
    const char *const names[] = {file, path_of("link"), path_of("hard"), other_path};
    for (size_t i = 0; i < COUNT_OF(names); i++) {
        EXPECT_SENTENCE(EXPORT(names[i]), "recording");
        EXPECT_SENTENCE(EXPORT(names[i], "--force"), "recording");
        EXPECT_SENTENCE(PROCESS(REENACT, "locate", file, "--camera", "folder:nowhere", "--force", "--out", names[i]),
                        "recording");
        EXPECT_SENTENCE(PROCESS(REENACT, "compare", file, "--with", file, "--force", "--html", names[i]), "compared");
        EXPECT_SENTENCE(PROCESS(CAPTURE, "library", scratch.path, "--force", "--html", names[i]), "recording");
        EXPECT_SENTENCE(PROCESS(CAPTURE, "repair", file, "--out", names[i]), "recording");
        EXPECT_SENTENCE(PROCESS(CAPTURE, "map", "--sensor", "folder:nowhere", "--out", names[i]), "recording");
        EXPECT_SENTENCE(PROCESS(CAPTURE, "record", "--sensor", "folder:nowhere", "--take", "x", "--out", names[i]),
                        "recording");
        EXPECT_STATUS(file_write(names[i], "x", 1), ERR_EXISTS); // the last guard
    }
    // Pages to print have names of their own ending, and a list beside them.
    EXPECT_INT(symlink(file, path_of("pages.pdf")), 0);
    EXPECT_INT(symlink(file, path_of("list.json")), 0);
    EXPECT_SENTENCE(PROCESS(CAPTURE, "tags", "--out", path_of("pages.pdf")), "recording");
    EXPECT_SENTENCE(PROCESS(CAPTURE, "tags", "--out", path_of("pages.pdf"), "--force"), "recording");
    EXPECT_SENTENCE(PROCESS(CAPTURE, "tags", "--out", path_of("list.pdf"), "--force"), "recording");
    EXPECT_TRUE(!file_exists(path_of("list.pdf")));
    EXPECT_SENTENCE(PROCESS(CAPTURE, "calibrate", "--board", path_of("pages.pdf"), "--force"), "recording");
    EXPECT_STATUS(file_read(file, &after, &count_after), OK);
    EXPECT_TRUE(count == count_after && !memcmp(before, after, count));
    free(before);
    free(after);
}

static void test_nothing_is_overwritten_without_force(void **state)
{
    (void)state;
    const char *out = path_of("joints.csv");
    scratch_text(&scratch, "joints.csv", "mine");
    EXPECT_SENTENCE(EXPORT(out), "--force");
    uint8_t *bytes;
    size_t count;
    EXPECT_STATUS(file_read(out, &bytes, &count), OK);
    EXPECT_INT(count, 4);
    free(bytes);
    EXPECT_INT(EXPORT(out, "--force").exit_code, 0);
    EXPECT_INT(EXPORT("/dev/null").exit_code, 0); // a device is no file to lose
    scratch_text(&scratch, "pictures/mine.txt", "mine");
    EXPECT_SENTENCE(
        PROCESS(REENACT, "render", file, "--take", "one", "--camera", "folder:nowhere", "--out", path_of("pictures")),
        "not empty");
}

// Before long work, and before the inputs are even looked at.
static void test_outputs_are_checked_first(void **state)
{
    (void)state;
    const char *nowhere = path_of("no/such/folder/x");
    EXPECT_SENTENCE(EXPORT(nowhere), "folder");
    EXPECT_SENTENCE(PROCESS(CAPTURE, "map", "--sensor", "folder:nowhere", "--out", nowhere), "no/such");
    EXPECT_SENTENCE(PROCESS(CAPTURE, "record", "--sensor", "folder:nowhere", "--take", "x", "--out", nowhere),
                    "no/such");
    EXPECT_SENTENCE(
        PROCESS(REENACT, "render", file, "--take", "one", "--camera", "folder:nowhere", "--out", path_of("joints.csv")),
        "is a file");
}

// What is added to a recording, too: before the sweep, the search and the drive, however long those take.
static void test_recordings_to_add_to_are_checked_first(void **state)
{
    (void)state;
    const char *other = path_of("second-name");
    EXPECT_INT(link(file, other), 0);
    EXPECT_SENTENCE(PROCESS(CAPTURE, "map", "--sensor", "folder:nowhere", "--into", other), "another name");
    EXPECT_SENTENCE(PROCESS(CAPTURE, "objects", "--camera", "folder:nowhere", "--objects", "nowhere", "--into", other),
                    "another name");
    EXPECT_SENTENCE(
        PROCESS(CAPTURE, "objects", "--stereo", "nowhere", "--rig", "nowhere", "--objects", "nowhere", "--into", other),
        "another name");
    EXPECT_SENTENCE(PROCESS(REENACT, "drive", "folder:nowhere", other, "--keep", "--out", path_of("drive")),
                    "another name");
    EXPECT_SENTENCE(PROCESS(CAPTURE, "studio", other), "another name");
    EXPECT_INT(unlink(other), 0);
    EXPECT_SENTENCE(PROCESS(REENACT, "drive", "sim:", other, "--out", path_of("drive")), "No such file");
    EXPECT_TRUE(!file_exists(path_of("drive")));
}

static void test_a_board_on_standard_output(void **state)
{
    (void)state;
    const struct process_result said = PROCESS(CAPTURE, "calibrate", "--board", "-");
    EXPECT_INT(said.exit_code, 0);
    EXPECT_TRUE(!strncmp(said.out, "%PDF-", 5) && strstr(said.err, "circles"));
}

static void test_a_folder_named_with_a_slash(void **state)
{
    (void)state;
    char out[600];
    snprintf(out, sizeof out, "%s//", path_of("folder"));
    const struct process_result said =
        PROCESS(CAPTURE, "export", file, "--take", "one", "--as", "folder", "--out", out);
    if (said.exit_code)
        print_error("%s", said.err);
    EXPECT_INT(said.exit_code, 0);
    EXPECT_TRUE(file_exists(path_of("folder/calibration.json")));
    EXPECT_SENTENCE(PROCESS(CAPTURE, "export", file, "--take", "one", "--as", "folder", "--out", out), "folder");
}

// A link at the output itself is replaced, not followed. (The temporary name beside it is random.)
static void test_links_are_not_followed(void **state)
{
    (void)state;
    scratch_text(&scratch, "victim", "precious");
    EXPECT_INT(symlink(path_of("victim"), path_of("linked.csv")), 0);
    EXPECT_INT(EXPORT(path_of("out.csv")).exit_code, 0);
    EXPECT_INT(EXPORT(path_of("linked.csv"), "--force").exit_code, 0);
    uint8_t *bytes;
    size_t count;
    EXPECT_STATUS(file_read(path_of("victim"), &bytes, &count), OK);
    EXPECT_TRUE(count == 8 && !memcmp(bytes, "precious", 8));
    free(bytes);
}

// A recording made under that name while the output was written.
static void test_a_recording_that_appears_meanwhile_stays(void **state)
{
    (void)state;
    struct output *out;
    struct recording_writer *w;
    struct recording *r;
    const char *path = path_of("meanwhile");
    EXPECT_STATUS(output_check(path, NULL, false), OK);
    EXPECT_STATUS(output_open(&out, path), OK);
    EXPECT_TRUE(fputs("text", output_file(out)) >= 0);
    EXPECT_STATUS(recording_create(&w, path), OK);
    EXPECT_STATUS(recording_close(&w), OK);
    EXPECT_STATUS(output_close(&out, OK), ERR_EXISTS);
    EXPECT_STATUS(recording_open(&r, path), OK);
    recording_free(&r);
}

static void test_full_output_is_no_success(void **state)
{
    (void)state;
    char command[1200];
    snprintf(command, sizeof command, "%s info %s > /dev/full 2> %s", CAPTURE, file, path_of("said"));
    EXPECT_INT(WEXITSTATUS(system(command)), 1);
    snprintf(command, sizeof command, "%s verify --json %s > /dev/full 2> %s", CAPTURE, file, path_of("said"));
    EXPECT_INT(WEXITSTATUS(system(command)), 1);
}

static void test_watching_says_what_is_wrong(void **state)
{
    (void)state;
    EXPECT_SENTENCE(PROCESS(REENACT, path_of("nope.reenact")), "nope.reenact");
    scratch_text(&scratch, "text", "no recording");
    EXPECT_SENTENCE(PROCESS(REENACT, path_of("text")), "not a recording");
    EXPECT_SENTENCE(PROCESS(REENACT, file, "--take", "nope"), "nope");
}

static void test_verify_and_repair(void **state)
{
    (void)state;
    const char *bad = path_of("bad.reenact");
    uint8_t *bytes;
    size_t count;
    struct process_result said = PROCESS(CAPTURE, "repair", file);
    EXPECT_INT(said.exit_code, 0);
    EXPECT_TRUE(strstr(said.out, "sound"));
    EXPECT_STATUS(file_read(file, &bytes, &count), OK);
    scratch_write(&scratch, "bad.reenact", bytes, count);
    free(bytes);
    run_sql(bad, "UPDATE take SET id = 33; DELETE FROM frame WHERE id % 4294967296 = 1");
    said = PROCESS(CAPTURE, "verify", bad);
    EXPECT_INT(said.exit_code, 1);
    EXPECT_TRUE(strstr(said.err, "belong to no take") && strstr(said.out, "frames cannot be read"));
    said = PROCESS(CAPTURE, "repair", bad);
    EXPECT_INT(said.exit_code, 0);
    EXPECT_TRUE(strstr(said.out, "bad-repaired.reenact") && strstr(said.out, "lost: 1 frames"));
    EXPECT_INT(PROCESS(CAPTURE, "verify", path_of("bad-repaired.reenact")).exit_code, 0);
    said = PROCESS(CAPTURE, "info", path_of("bad-repaired.reenact"));
    EXPECT_TRUE(strstr(said.out, "2 frames") && strstr(said.out, "1 lost to damage, interrupted"));
    EXPECT_SENTENCE(PROCESS(CAPTURE, "repair", bad), "already"); // not over the first one
}

static void test_takes_and_library(void **state)
{
    (void)state;
    const char *copy = path_of("library/copy.reenact");
    EXPECT_STATUS(folder_make(path_of("library")), OK);
    EXPECT_INT(PROCESS(CAPTURE, "take", "copy", file, "--take", "one", "--into", copy).exit_code, 0);
    EXPECT_INT(PROCESS(CAPTURE, "take", "rename", copy, "--take", "one", "--name", "two").exit_code, 0);
    EXPECT_INT(PROCESS(CAPTURE, "take", "copy", copy, "--take", "two", "--name", "three").exit_code, 0);
    EXPECT_INT(
        PROCESS(CAPTURE, "take", "note", copy, "--take", "two", "--note", "<slow>", "--alias", "dancer 7").exit_code,
        0);
    EXPECT_INT(PROCESS(CAPTURE, "take", "trim", copy, "--take", "two", "--to", "0.04").exit_code, 0);
    struct process_result said = PROCESS(CAPTURE, "library", path_of("library"), "--html", path_of("takes.html"));
    EXPECT_INT(said.exit_code, 0);
    EXPECT_TRUE(strstr(said.out, "two") && strstr(said.out, "dancer 7") && strstr(said.out, "shorter than a second"));
    uint8_t *page;
    size_t count;
    EXPECT_STATUS(file_read(path_of("takes.html"), &page, &count), OK);
    EXPECT_TRUE(strstr((char *)page, "&lt;slow&gt;") && strstr((char *)page, "data:image/jpeg;base64,/9j/"));
    free(page);
    EXPECT_INT(PROCESS(CAPTURE, "take", "delete", copy, "--take", "two").exit_code, 0);
    EXPECT_SENTENCE(PROCESS(CAPTURE, "take", "delete", copy, "--take", "two"), "no take 'two'");
    EXPECT_INT(PROCESS(CAPTURE, "take", "rename", copy, "--take", "three").exit_code, 2);
    EXPECT_INT(PROCESS(CAPTURE, "take", "burn", copy, "--take", "three").exit_code, 2);
    said = PROCESS(CAPTURE, "library", path_of("library"), "--json");
    EXPECT_TRUE(strstr(said.out, "\"three\"") && !strstr(said.out, "\"two\""));
    EXPECT_INT(PROCESS(CAPTURE, "verify", copy).exit_code, 0);
    // A name that a terminal would obey, and that is no JSON.
    EXPECT_INT(rename(copy, path_of("library/a\x1b[2J\xff.reenact")), 0);
    for (int json = 0; json < 2; json++) {
        said = PROCESS(CAPTURE, "library", path_of("library"), json ? "--json" : NULL);
        EXPECT_INT(said.exit_code, 0);
        EXPECT_TRUE(strstr(said.out, "a?[2J?.reenact") && !strchr(said.out, 0x1b));
    }
}

static bool holds(const char *recording, const char *take)
{
    struct recording *r;
    bool there = false;
    EXPECT_STATUS(recording_open(&r, recording), OK);
    for (int i = 0; i < recording_take_count(r); i++)
        there |= !strcmp(recording_take_name(r, i), take);
    recording_free(&r);
    return there;
}

// What cannot be brought back is asked for on a terminal; --yes answers, and where there is no terminal nobody is
// asked.
static void test_a_terminal_is_asked_first(void **state)
{
    (void)state;
    static const struct {
        const char *typed;
        bool yes, asked, done;
    } cases[] = {{"\n", false, true, false},  {"n\n", false, true, false}, {"nay, yes\n", false, true, false},
                 {"\4", false, true, false},  {"\4", true, false, true},   {"y\n", false, true, true},
                 {"YES\n", false, true, true}};
    const char *const copy = path_of("asked.reenact");
    for (size_t i = 0; i < COUNT_OF(cases); i++)
        for (int trim = 0; trim < 2; trim++) {
            EXPECT_INT(PROCESS(CAPTURE, "take", "copy", file, "--take", "one", "--into", copy).exit_code, 0);
            const char *const words[] = {CAPTURE,
                                         "take",
                                         trim ? "trim" : "delete",
                                         copy,
                                         "--take",
                                         "one",
                                         cases[i].yes ? "--yes"
                                         : trim       ? "--to=0.04"
                                                      : NULL,
                                         trim ? "--to=0.04" : NULL,
                                         NULL};
            const struct process_result said = process_run_on_terminal(cases[i].typed, words);
            const bool asked = strstr(said.err, "[y/N]"), done = strstr(said.out, trim ? "is trimmed" : "is deleted");
            if (asked != cases[i].asked || done != cases[i].done || said.exit_code != !done)
                print_error("'%s' to %s: exit code %d, '%s', '%s'\n", cases[i].typed, words[2], said.exit_code,
                            said.err, said.out);
            EXPECT_TRUE(asked == cases[i].asked && done == cases[i].done && said.exit_code == !done);
            EXPECT_TRUE(!asked || (strstr(said.err, "'one'") && strstr(said.err, copy)));
            EXPECT_TRUE(holds(copy, "one") == (trim || !done));
            EXPECT_INT(unlink(copy), 0);
        }
    // What is not there is said without a question.
    EXPECT_INT(PROCESS(CAPTURE, "take", "copy", file, "--take", "one", "--into", copy).exit_code, 0);
    const struct process_result said = process_run_on_terminal(
        "y\n", (const char *const[]){CAPTURE, "take", "delete", copy, "--take", "nobody", NULL});
    EXPECT_SENTENCE(said, "no take 'nobody'");
    EXPECT_TRUE(!strstr(said.err, "[y/N]"));
}

#ifndef EMULATED // the limit is bash's
// Runs the words in a shell in which no file may grow beyond so many kilobytes.
static struct process_result run_within(int kilobytes, const char *words)
{
    char script[1500];
    snprintf(script, sizeof script, "ulimit -f %d; %s", kilobytes, words);
    return PROCESS("/usr/bin/bash", "-c", script);
}

// Where there is no room to overwrite what is deleted, the take stays, and another way is said.
static void test_a_take_is_not_deleted_without_room(void **state)
{
    (void)state;
    static const char *const actions[] = {"delete", "trim --to 0.04"};
    const char *const copy = path_of("tight.reenact");
    EXPECT_INT(PROCESS(CAPTURE, "take", "copy", file, "--take", "one", "--into", copy).exit_code, 0);
    for (size_t i = 0; i < COUNT_OF(actions); i++) {
        char words[1200];
        snprintf(words, sizeof words, "%s take %s %s --take one", CAPTURE, actions[i], copy);
        EXPECT_SENTENCE(run_within(4, words), "copy the takes that stay to another disk");
        EXPECT_INT(PROCESS(CAPTURE, "verify", copy).exit_code, 0);
        EXPECT_TRUE(holds(copy, "one"));
    }
    EXPECT_INT(unlink(copy), 0);
}
#endif

// Who asks for JSON gets it, and who drives no trial, too; a list of nothing is said to be one.
static void test_no_report_is_empty(void **state)
{
    (void)state;
    EXPECT_ANSWER(PROCESS(CAPTURE, "objects", "list", file), "holds no things");
    EXPECT_ANSWER(PROCESS(REENACT, "drive", "sim:", "--seconds", "0.5", "--out", path_of("reported"), "--json"),
                  "\"pictures\":");
    EXPECT_ANSWER(PROCESS(REENACT, "drive", "sim:", "--seconds", "0.5", "--out", path_of("driven")), "pictures");
}

static int set_up(void **state)
{
    (void)state;
    uint8_t *bytes;
    size_t count;
    scratch = scratch_make();
    EXPECT_STATUS(file_read(SOURCE_DIR "/tests/recording/data/joint_error.reenact", &bytes, &count), OK);
    scratch_write(&scratch, "old.reenact", bytes, count);
    snprintf(file, sizeof file, "%s", scratch_file(&scratch, "old.reenact"));
    free(bytes);
    return 0;
}

static int tear_down(void **state)
{
    (void)state;
    scratch_remove(&scratch);
    return 0;
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_a_recording_is_never_overwritten),
        cmocka_unit_test(test_a_terminal_is_asked_first),
        cmocka_unit_test(test_no_report_is_empty),
#ifndef EMULATED
        cmocka_unit_test(test_a_take_is_not_deleted_without_room),
#endif
        cmocka_unit_test(test_nothing_is_overwritten_without_force),
        cmocka_unit_test(test_outputs_are_checked_first),
        cmocka_unit_test(test_recordings_to_add_to_are_checked_first),
        cmocka_unit_test(test_links_are_not_followed),
        cmocka_unit_test(test_a_board_on_standard_output),
        cmocka_unit_test(test_a_folder_named_with_a_slash),
        cmocka_unit_test(test_a_recording_that_appears_meanwhile_stays),
        cmocka_unit_test(test_full_output_is_no_success),
        cmocka_unit_test(test_watching_says_what_is_wrong),
        cmocka_unit_test(test_verify_and_repair),
        cmocka_unit_test(test_takes_and_library),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
