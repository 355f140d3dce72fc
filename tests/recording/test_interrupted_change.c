// A program that was killed while it changed a recording: what it had overwritten is in SQLite's rollback journal. Who
// reads the file reads that from there, and changes nothing; who writes to it puts it back first.
#include "platform/files/file.h"
#include "tests/support/recording_hash.h"
#include "tests/support/recording_sample.h"
#include "tests/support/single_file.h"
#include "tests/support/sql.h"

#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

static const char *path_of_journal(const char *path)
{
    static char journal[256];
    snprintf(journal, sizeof journal, "%s-journal", path);
    return journal;
}

// Waits for the child; its exit code, -1 where it was killed.
static int end_of(pid_t child)
{
    int state;
    EXPECT_INT(waitpid(child, &state, 0), child);
    return WIFEXITED(state) ? WEXITSTATUS(state) : -1;
}

// Half a change, of more pages than the cache holds, so that it is in the file already.
static void change_halfway(const char *path)
{
    struct stat about;
    const pid_t child = fork();
    if (!child) {
        struct database *db;
        enum status status = database_open(&db, path, DATABASE_WRITE);
        if (status == OK)
            status = database_run(db, "PRAGMA journal_mode = DELETE; PRAGMA cache_size = 4; BEGIN;"
                                      "UPDATE picture SET depth = randomblob(length(depth)), mask = randomblob(9000);"
                                      "DELETE FROM frame WHERE id % 2");
        _exit(status != OK);
    }
    EXPECT_INT(end_of(child), 0);
    EXPECT_INT(stat(path_of_journal(path), &about), 0);
    EXPECT_AT_LEAST(about.st_size, 4096);
}

static void expect_same_bytes(const char *path, const uint8_t *bytes, size_t count)
{
    uint8_t *now;
    size_t count_now;
    EXPECT_STATUS(file_read(path, &now, &count_now), OK);
    EXPECT_INT(count_now, count);
    EXPECT_TRUE(count_now == count && !memcmp(now, bytes, count));
    free(now);
}

static enum status verify(const char *path)
{
    struct recording_report report;
    return recording_verify(path, &report);
}

static enum status repair(const char *path)
{
    struct recording_report report;
    return recording_repair(path, sample_path("needless"), &report);
}

static enum status open_and_read(const char *path)
{
    struct recording *r;
    struct take *take = NULL;
    enum status status = recording_open(&r, path);
    if (status == OK)
        status = take_open(&take, r, "höher");
    if (status == OK)
        EXPECT_INT(take_frame_count(take), FRAMES);
    take_close(&take);
    recording_free(&r);
    return status;
}

static enum status add_nothing(const char *path)
{
    struct recording_writer *w;
    const enum status status = recording_append(&w, path);
    return status == OK ? recording_close(&w) : status;
}

static enum status annotate(const char *path) { return recording_annotate_take(path, "höher", NULL, NULL); }

static enum status check_change(const char *path) { return recording_check_change(path); }

static void test_readers_leave_it_as_it_is(void **state)
{
    (void)state;
    static const struct {
        enum status (*read)(const char *path);
        enum status wanted;
    } readers[] = {{verify, OK}, {repair, NOTHING}, {open_and_read, OK}};
    char path[128];
    snprintf(path, sizeof path, "%s", sample_path("halfway"));
    sample_recording_write(path);
    const uint64_t before = hash_of(path);
    change_halfway(path);
    uint8_t *bytes, *journal;
    size_t count, journal_count;
    EXPECT_STATUS(file_read(path, &bytes, &count), OK);
    EXPECT_STATUS(file_read(path_of_journal(path), &journal, &journal_count), OK);
    for (size_t i = 0; i < COUNT_OF(readers); i++) {
        EXPECT_STATUS(readers[i].read(path), readers[i].wanted);
        EXPECT_TRUE(hash_of(path) == before);
        expect_same_bytes(path, bytes, count);
        expect_same_bytes(path_of_journal(path), journal, journal_count);
    }
    free(bytes);
    free(journal);
}

static void test_writers_put_it_back(void **state)
{
    (void)state;
    enum status (*const writers[])(const char *path) = {add_nothing, annotate, check_change};
    char path[128];
    snprintf(path, sizeof path, "%s", sample_path("written"));
    sample_recording_write(path);
    const uint64_t before = hash_of(path);
    for (size_t i = 0; i < COUNT_OF(writers); i++) {
        change_halfway(path);
        EXPECT_STATUS(writers[i](path), OK);
        EXPECT_TRUE(database_is_single_file(path));
        EXPECT_TRUE(hash_of(path) == before);
        EXPECT_STATUS(verify(path), OK);
    }
}

// Nothing has to be written for that.
static void test_folder_that_cannot_be_written(void **state)
{
    (void)state;
    char path[128];
    snprintf(path, sizeof path, "%s", sample_path("read-only"));
    sample_recording_write(path);
    const uint64_t before = hash_of(path);
    change_halfway(path);
    EXPECT_TRUE(!chmod(path, 0444) && !chmod(path_of_journal(path), 0444) && !chmod(folder, 0555));
    fflush(NULL);
    const pid_t child = fork();
    if (!child) {
        if (!geteuid() && (setgid(65534) || setuid(65534)))
            _exit(9);
        _exit(hash_of(path) != before || verify(path) != OK);
    }
    const int code = end_of(child);
    EXPECT_TRUE(!chmod(folder, 0755) && !chmod(path, 0644) && !chmod(path_of_journal(path), 0644));
    EXPECT_INT(code, 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_readers_leave_it_as_it_is),
        cmocka_unit_test(test_writers_put_it_back),
        cmocka_unit_test(test_folder_that_cannot_be_written),
    };
    return cmocka_run_group_tests(tests, sample_folder_make, sample_folder_remove);
}
