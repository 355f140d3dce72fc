// The files that SQLite keeps beside a recording, its log and its journal, and the recording's names: by a link from
// another folder they are found, of two names none is written to, and those of another recording are not taken for a
// new one's.
#include "platform/files/file.h"
#include "recording/recording_reader.h"
#include "tests/support/recording_sample.h"
#include "tests/support/single_file.h"

#include <sys/stat.h>
#include <sys/wait.h>

static char real[128], by_link[128]; // names of one file

static int set_up(void **state)
{
    char made[128];
    if (sample_folder_make(state))
        return -1;
    snprintf(made, sizeof made, "%s/elsewhere", folder);
    snprintf(real, sizeof real, "%s/elsewhere/film.reenact", folder);
    snprintf(by_link, sizeof by_link, "%s/link.reenact", folder);
    if (mkdir(made, 0755) || symlink("elsewhere/film.reenact", by_link))
        return -1;
    sample_recording_write(real);
    return 0;
}

static enum status verify(const char *path, int takes)
{
    struct recording_report report;
    const enum status status = recording_verify(path, &report);
    EXPECT_INT(report.takes, takes);
    return status;
}

static void test_takes_are_changed_and_added(void **state)
{
    (void)state;
    const struct calibration calibration = sample_calibration();
    struct recording_writer *w;
    EXPECT_STATUS(recording_rename_take(by_link, "höher", "other"), OK);
    EXPECT_STATUS(recording_append(&w, by_link), OK);
    EXPECT_STATUS(recording_begin_take(w, "third", &calibration), OK);
    sample_frames_add(w, 0, 4);
    EXPECT_STATUS(recording_end_take(w), OK);
    EXPECT_STATUS(recording_close(&w), OK);
    EXPECT_STATUS(verify(by_link, 3), OK);
    EXPECT_TRUE(database_is_single_file(real) && database_is_single_file(by_link));
}

// Whatever the file is called by: one writer at a time.
static void test_second_writer_is_refused(void **state)
{
    (void)state;
    const char *const names[2] = {real, by_link};
    for (int i = 0; i < 2; i++) {
        struct recording_writer *first, *second;
        EXPECT_STATUS(recording_append(&first, names[i]), OK);
        EXPECT_STATUS(recording_append(&second, names[!i]), ERR_IO);
        EXPECT_SAYS("being written by another program");
        EXPECT_STATUS(recording_check_change(names[!i]), ERR_IO);
        EXPECT_SAYS("being written by another program");
        EXPECT_STATUS(recording_close(&first), OK);
    }
}

// A hard link has no log of its own: what is written by one name would be half seen, and overwritten, by the other.
static void test_hard_links_are_only_read(void **state)
{
    (void)state;
    char other[128];
    struct recording_writer *w;
    snprintf(other, sizeof other, "%s/other.reenact", folder);
    EXPECT_INT(link(real, other), 0);
    const char *const names[] = {real, other, by_link};
    for (size_t i = 0; i < COUNT_OF(names); i++) {
        EXPECT_STATUS(recording_append(&w, names[i]), ERR_IO);
        EXPECT_SAYS("another name");
        EXPECT_STATUS(recording_check_change(names[i]), ERR_IO);
        EXPECT_SAYS("another name");
        EXPECT_STATUS(recording_rename_take(names[i], "other", "again"), ERR_IO);
        EXPECT_STATUS(verify(names[i], 3), OK);
    }
    EXPECT_INT(unlink(other), 0);
    EXPECT_STATUS(recording_append(&w, real), OK);
    EXPECT_STATUS(recording_close(&w), OK);
}

// What is looked at before long work stays as it is, byte for byte, with nothing beside it.
static void test_the_check_changes_nothing(void **state)
{
    (void)state;
    uint8_t *before, *after;
    size_t count, count_after;
    char none[128];
    snprintf(none, sizeof none, "%s/none.reenact", folder);
    EXPECT_STATUS(file_read(real, &before, &count), OK);
    EXPECT_STATUS(recording_check_change(real), OK);
    EXPECT_STATUS(recording_check_change(by_link), OK);
    EXPECT_TRUE(database_is_single_file(real));
    EXPECT_STATUS(file_read(real, &after, &count_after), OK);
    EXPECT_TRUE(count == count_after && !memcmp(before, after, count));
    free(before);
    free(after);
    EXPECT_STATUS(recording_check_change(none), ERR_MISSING);
    EXPECT_STATUS(recording_check_change(folder), ERR_FORMAT);
    EXPECT_TRUE(!file_exists(none));
}

// Adds a take, and ends like a program that is killed: its last part is in the log.
static void add_and_die(const char *path, const char *take)
{
    fflush(NULL);
    const pid_t child = fork();
    if (!child) {
        const struct calibration calibration = sample_calibration();
        struct recording_writer *w;
        if (recording_append(&w, path) != OK || recording_begin_take(w, take, &calibration) != OK)
            _exit(1);
        sample_frames_add(w, 0, 20);
        if (recording_put_place(w, &(struct place){.calibration = calibration}) != OK) // commits what there is
            _exit(1);
        _exit(0);
    }
    int how;
    waitpid(child, &how, 0);
    EXPECT_TRUE(WIFEXITED(how) && !WEXITSTATUS(how));
}

// What was filmed last lies in the log: it is read by the link, too, and where nothing can be written.
static void test_last_part_of_a_killed_writer(void **state)
{
    (void)state;
    add_and_die(by_link, "last");
    EXPECT_TRUE(!database_is_single_file(by_link));
    struct stat about;
    EXPECT_INT(stat(real, &about), 0);
    EXPECT_AT_LEAST(recording_bytes(by_link), about.st_size + 1);
    EXPECT_NEAR((double)recording_bytes(by_link), (double)recording_bytes(real), 0);

    char log[160], shm[160], elsewhere[128];
    snprintf(log, sizeof log, "%s-wal", real);
    snprintf(shm, sizeof shm, "%s-shm", real);
    snprintf(elsewhere, sizeof elsewhere, "%s/elsewhere", folder);
    EXPECT_TRUE(!unlink(shm) && !chmod(real, 0444) && !chmod(log, 0444) && !chmod(elsewhere, 0555) &&
                !chmod(folder, 0755));
    fflush(NULL);
    const pid_t child = fork();
    if (!child) {
        struct recording_report report;
        if (!geteuid() && (setgid(65534) || setuid(65534)))
            _exit(9);
        _exit(recording_verify(by_link, &report) == OK && report.takes == 4 ? 0 : 1);
    }
    int how;
    waitpid(child, &how, 0);
    EXPECT_TRUE(!chmod(elsewhere, 0755) && !chmod(real, 0644) && !chmod(log, 0644));
    EXPECT_TRUE(WIFEXITED(how) && !WEXITSTATUS(how));
    EXPECT_STATUS(verify(by_link, 4), OK);
}

// Who removes the file of a killed writer and leaves its log does not film the next one into the wreck of both.
static void test_log_of_another_recording(void **state)
{
    (void)state;
    char path[128], log[160], kept[128];
    struct recording_writer *w;
    struct recording_report report;
    snprintf(path, sizeof path, "%s/again.reenact", folder);
    snprintf(log, sizeof log, "%s-wal", path);
    snprintf(kept, sizeof kept, "%s/kept", folder);
    sample_recording_write(path);
    add_and_die(path, "last");
    EXPECT_INT(rename(path, kept), 0);
    EXPECT_TRUE(file_exists(log));
    EXPECT_STATUS(recording_check_new(path), ERR_EXISTS);
    EXPECT_SAYS("again.reenact-wal holds the last part of another file");
    EXPECT_STATUS(recording_create(&w, path), ERR_EXISTS);
    EXPECT_TRUE(!file_exists(path) && file_exists(log));
    EXPECT_INT(rename(kept, path), 0); // nothing was lost
    EXPECT_STATUS(recording_verify(path, &report), OK);
    EXPECT_INT(report.takes, 3);
    EXPECT_INT(unlink(path), 0);
    EXPECT_INT(unlink(log), 0);
    EXPECT_STATUS(recording_create(&w, path), OK);
    EXPECT_STATUS(recording_close(&w), OK);
}

// Nor is it taken for that of a copy which is put in the file's place.
static void test_copy_beside_the_log_of_another(void **state)
{
    (void)state;
    char path[128], log[160], away[160], copy[128];
    uint8_t *bytes;
    size_t count;
    struct recording *r;
    struct recording_writer *w;
    struct recording_report report;
    snprintf(path, sizeof path, "%s/restored.reenact", folder);
    snprintf(log, sizeof log, "%s-wal", path);
    snprintf(away, sizeof away, "%s/away", folder);
    snprintf(copy, sizeof copy, "%s/copy.reenact", folder);
    sample_recording_write(path);
    EXPECT_STATUS(file_read(path, &bytes, &count), OK); // as it was before it was filmed into again
    add_and_die(path, "last");
    EXPECT_STATUS(recording_open(&r, path), OK); // its own log
    EXPECT_INT(recording_take_count(r), 3);
    recording_free(&r);
    EXPECT_INT(unlink(path), 0);
    EXPECT_STATUS(file_write_unsynced(path, bytes, count), OK);
    EXPECT_STATUS(recording_open(&r, path), ERR_IO);
    EXPECT_SAYS("restored.reenact-wal holds the last part of another file");
    EXPECT_STATUS(recording_append(&w, path), ERR_IO);
    EXPECT_STATUS(recording_verify(path, &report), ERR_IO);
    EXPECT_STATUS(recording_repair(path, copy, &report), ERR_IO);
    EXPECT_INT(rename(log, away), 0);
    EXPECT_STATUS(recording_verify(path, &report), OK);
    EXPECT_INT(report.takes, 2);
    free(bytes);
}

// Of a file that was closed, whose log the power left there: all of it is in the file, and the file is read.
static void test_log_whose_removal_was_lost(void **state)
{
    (void)state;
    char path[128], log[160];
    uint8_t *bytes;
    size_t count;
    struct recording_writer *w;
    struct recording_report report;
    snprintf(path, sizeof path, "%s/closed.reenact", folder);
    snprintf(log, sizeof log, "%s-wal", path);
    sample_recording_write(path);
    add_and_die(path, "last");
    EXPECT_STATUS(file_read(log, &bytes, &count), OK);
    EXPECT_STATUS(recording_append(&w, path), OK);
    EXPECT_STATUS(recording_close(&w), OK);
    EXPECT_TRUE(database_is_single_file(path));
    EXPECT_STATUS(file_write_unsynced(log, bytes, count), OK);
    EXPECT_STATUS(recording_verify(path, &report), OK);
    EXPECT_INT(report.takes, 3);
    EXPECT_STATUS(recording_append(&w, path), OK);
    EXPECT_STATUS(recording_close(&w), OK);
    EXPECT_STATUS(recording_verify(path, &report), OK);
    EXPECT_INT(report.takes, 3);
    free(bytes);
}

static int64_t frames_of(struct recording *r, const char *name)
{
    struct take *t = NULL;
    EXPECT_STATUS(take_open(&t, r, name), OK);
    int64_t frames = 0;
    for (; t && frames < take_frame_count(t); frames++) {
        struct take_images images;
        EXPECT_STATUS(take_read(t, frames, TAKE_COLOR | TAKE_DEPTH | TAKE_MASK, &images), OK);
    }
    take_close(&t);
    return frames;
}

// How many frames a handle sees that was opened earlier; the file is sound to it.
static int64_t all_frames_of(struct recording *r)
{
    int64_t frames = -1;
    EXPECT_STATUS(database_check(recording_database(r)), OK);
    EXPECT_STATUS(database_number(recording_database(r), "SELECT count(*) FROM frame", &frames), OK);
    return frames;
}

// Who looks at a file whose last part is in the log of a killed writer keeps nobody from filming into it, and sees what
// comes to it. Only while it is reading, a writer waits.
static void test_reader_of_a_log_that_was_left(void **state)
{
    (void)state;
    char path[128];
    struct recording *watching;
    struct recording_writer *w;
    const struct calibration calibration = sample_calibration();
    snprintf(path, sizeof path, "%s/watched.reenact", folder);
    sample_recording_write(path);
    add_and_die(path, "last");
    EXPECT_STATUS(recording_open(&watching, path), OK);
    EXPECT_INT(frames_of(watching, "last"), 20);

    struct database *db; // who has not made itself the file's writer
    EXPECT_STATUS(database_open(&db, path, DATABASE_WRITE), OK);
    EXPECT_STATUS(database_run(recording_database(watching), "BEGIN; SELECT count(*) FROM take"), OK);
    EXPECT_STATUS(recording_append(&w, path), ERR_IO);
    EXPECT_SAYS("is in use by another program");
    EXPECT_STATUS(database_run(db, "UPDATE take SET note = 'seen'"), ERR_IO);
    EXPECT_STATUS(database_run(recording_database(watching), "COMMIT"), OK);
    EXPECT_STATUS(database_run(db, "BEGIN IMMEDIATE; ROLLBACK"), OK);
    database_close(&db);

    EXPECT_STATUS(recording_append(&w, path), OK);
    EXPECT_STATUS(recording_begin_take(w, "now", &calibration), OK);
    sample_frames_add(w, 0, 30);
    EXPECT_STATUS(recording_end_take(w), OK);
    EXPECT_INT(frames_of(watching, "last"), 20); // beside the writer
    EXPECT_INT(all_frames_of(watching), FRAMES + 3 + 20 + 30);
    EXPECT_STATUS(recording_close(&w), OK);
    EXPECT_INT(all_frames_of(watching), FRAMES + 3 + 20 + 30);
    recording_free(&watching);
    EXPECT_STATUS(verify(path, 4), OK);
    EXPECT_STATUS(recording_rename_take(path, "now", "then"), OK);
    EXPECT_TRUE(database_is_single_file(path));
}

// Of a change that was not finished, likewise: put back by a writer, it is the same to who had it open.
static void test_reader_of_a_journal_that_was_left(void **state)
{
    (void)state;
    char path[128];
    struct recording *watching;
    snprintf(path, sizeof path, "%s/halfway.reenact", folder);
    sample_recording_write(path);
    fflush(NULL);
    const pid_t child = fork();
    if (!child) {
        struct database *db;
        _exit(database_open(&db, path, DATABASE_WRITE) != OK ||
              database_run(db, "PRAGMA cache_size = 4; BEGIN; UPDATE picture SET depth = randomblob(70000)") != OK);
    }
    int how;
    waitpid(child, &how, 0);
    EXPECT_TRUE(WIFEXITED(how) && !WEXITSTATUS(how));
    EXPECT_STATUS(recording_open(&watching, path), OK);
    EXPECT_INT(frames_of(watching, "höher"), FRAMES);
    EXPECT_TRUE(!database_is_single_file(path));
    EXPECT_STATUS(recording_rename_take(path, "second", "other"), OK);
    EXPECT_TRUE(database_is_single_file(path));
    EXPECT_INT(frames_of(watching, "höher"), FRAMES);
    EXPECT_INT(all_frames_of(watching), FRAMES + 3);
    recording_free(&watching);
}

// The name is a file's, not an address with settings in it, which could name another layer than ours.
static void test_name_that_looks_like_an_address(void **state)
{
    (void)state;
    char here[512];
    EXPECT_TRUE(getcwd(here, sizeof here) != NULL && !chdir(folder));
    sample_recording_write("file:odd?vfs=unix-none&mode=memory");
    EXPECT_STATUS(verify("file:odd?vfs=unix-none&mode=memory", 2), OK);
    EXPECT_TRUE(file_exists(sample_path("file:odd?vfs=unix-none&mode=memory")));
    EXPECT_INT(chdir(here), 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_takes_are_changed_and_added),
        cmocka_unit_test(test_the_check_changes_nothing),
        cmocka_unit_test(test_second_writer_is_refused),
        cmocka_unit_test(test_hard_links_are_only_read),
        cmocka_unit_test(test_last_part_of_a_killed_writer),
        cmocka_unit_test(test_log_of_another_recording),
        cmocka_unit_test(test_copy_beside_the_log_of_another),
        cmocka_unit_test(test_log_whose_removal_was_lost),
        cmocka_unit_test(test_reader_of_a_log_that_was_left),
        cmocka_unit_test(test_reader_of_a_journal_that_was_left),
        cmocka_unit_test(test_name_that_looks_like_an_address),
    };
    return cmocka_run_group_tests(tests, set_up, sample_folder_remove);
}
