// A recording whose tables are not exactly as these programs make them is read like any other, and never written to: a
// rule in it could delete takes when another is added. `repair` copies what is in it. Files of every older version are
// written to.
#include "recording/recorded_things.h"
#include "tests/support/copy_file.h"
#include "tests/support/recording_hash.h"
#include "tests/support/recording_sample.h"
#include "tests/support/single_file.h"
#include "tests/support/sql.h"

#define TAKE_BEHIND_NAME                                                                                               \
    " calibration BLOB, complete INTEGER, dropped INTEGER, body BLOB, crc INTEGER, frames INTEGER, lost INTEGER,"      \
    " note TEXT, alias TEXT, seal INTEGER"
#define NEW_TAKE(columns) "ALTER TABLE take RENAME TO old; CREATE TABLE take(" columns
#define END_TAKE          "; INSERT INTO take SELECT * FROM old; DROP TABLE old"

static const struct {
    const char *name, *sql;
} crafted[] = {
    {"replaces takes of a name",
     NEW_TAKE("id INTEGER PRIMARY KEY, name TEXT UNIQUE ON CONFLICT REPLACE," TAKE_BEHIND_NAME ")" END_TAKE)},
    {"replaces takes of a length", NEW_TAKE("id INTEGER PRIMARY KEY, name TEXT," TAKE_BEHIND_NAME
                                            ", UNIQUE(id, complete) ON CONFLICT REPLACE)" END_TAKE)},
    {"replaces rows of an id",
     NEW_TAKE("id INTEGER PRIMARY KEY ON CONFLICT REPLACE, name TEXT," TAKE_BEHIND_NAME ")" END_TAKE)},
    {"default", NEW_TAKE("id INTEGER PRIMARY KEY, name TEXT DEFAULT 'x'," TAKE_BEHIND_NAME ")" END_TAKE)},
    {"collation", NEW_TAKE("id INTEGER PRIMARY KEY, name TEXT COLLATE NOCASE," TAKE_BEHIND_NAME ")" END_TAKE)},
    {"check",
     NEW_TAKE("id INTEGER PRIMARY KEY, name TEXT CHECK(length(hex(name)) > 0)," TAKE_BEHIND_NAME ")" END_TAKE)},
    {"check of the table", NEW_TAKE("id INTEGER PRIMARY KEY, name TEXT," TAKE_BEHIND_NAME ", CHECK(id < 3))" END_TAKE)},
    {"not null", NEW_TAKE("id INTEGER PRIMARY KEY, name TEXT NOT NULL," TAKE_BEHIND_NAME ")" END_TAKE)},
    {"reference", NEW_TAKE("id INTEGER PRIMARY KEY, name TEXT REFERENCES frame," TAKE_BEHIND_NAME ")" END_TAKE)},
    {"autoincrement", NEW_TAKE("id INTEGER PRIMARY KEY AUTOINCREMENT, name TEXT," TAKE_BEHIND_NAME ")" END_TAKE)},
    {"another type", NEW_TAKE("id INTEGER PRIMARY KEY, name BLOB," TAKE_BEHIND_NAME ")" END_TAKE)},
    {"another column", "ALTER TABLE take ADD COLUMN extra INTEGER"},
    {"unique index", "CREATE UNIQUE INDEX one ON take(name)"},
    {"costly index", "CREATE INDEX two ON frame(length(hex(zeroblob(100000))))"},
    {"partial index", "CREATE INDEX three ON picture(id) WHERE id > 7"},
    {"trigger", "CREATE TRIGGER four AFTER INSERT ON take BEGIN DELETE FROM take WHERE id < new.id; END"},
    {"view", "CREATE VIEW five AS SELECT * FROM take"},
    {"view like the mark", "DROP VIEW identity; CREATE VIEW identity AS SELECT name FROM take"},
    {"table", "CREATE TABLE six(id INTEGER PRIMARY KEY, name TEXT)"},
    {"statistics", "ANALYZE"},
};

static enum status append(const char *path)
{
    struct recording_writer *w;
    const enum status status = recording_append(&w, path);
    return status == OK ? recording_close(&w) : status;
}

static enum status rename_it(const char *path) { return recording_rename_take(path, "second", "third"); }

static enum status note_it(const char *path) { return recording_annotate_take(path, "second", "a note", NULL); }

static enum status delete_it(const char *path)
{
    int64_t freed;
    return recording_delete_take(path, "second", &freed);
}

static enum status trim_it(const char *path)
{
    int64_t freed;
    return recording_trim_take(path, "höher", 0, 300000000, &freed);
}

static enum status copy_into(const char *path)
{
    struct take_copy_report report;
    return recording_copy_take(sample_path("plain"), "second", path, "copy", &report);
}

static enum status drive_in(const char *path)
{
    const struct recorded_drive drive = {.world_from_body = POSE_IDENTITY, .size_m = {1, 1, 1}};
    return recording_write_drive(path, &drive);
}

static enum status check(const char *path) { return recording_check_change(path); }

static enum status (*const writers[])(const char *path) = {append,  rename_it, note_it,  delete_it,
                                                           trim_it, copy_into, drive_in, check};

static void expect_bytes(const char *path, const uint8_t *bytes, size_t count)
{
    uint8_t *now;
    size_t count_now;
    EXPECT_STATUS(file_read(path, &now, &count_now), OK);
    EXPECT_TRUE(count_now == count && !memcmp(now, bytes, count));
    EXPECT_TRUE(database_is_single_file(path));
    free(now);
}

static void test_crafted_files_are_only_read(void **state)
{
    (void)state;
    char plain[128], path[128], copy[128];
    snprintf(plain, sizeof plain, "%s", sample_path("plain"));
    snprintf(path, sizeof path, "%s", sample_path("crafted"));
    snprintf(copy, sizeof copy, "%s", sample_path("repaired"));
    sample_recording_write(plain);
    const uint64_t hash = hash_of(plain);
    for (size_t i = 0; i < COUNT_OF(crafted); i++) {
        struct recording_report report;
        uint8_t *bytes;
        size_t count;
        copy_file(plain, path);
        run_sql(path, crafted[i].sql);
        EXPECT_STATUS(file_read(path, &bytes, &count), OK);
        EXPECT_STATUS(recording_verify(path, &report), OK);
        EXPECT_TRUE(hash_of(path) == hash);
        for (size_t k = 0; k < COUNT_OF(writers); k++) {
            const enum status status = writers[k](path);
            if (status != ERR_CORRUPT)
                print_error("%s, writer %zu\n", crafted[i].name, k);
            EXPECT_STATUS(status, ERR_CORRUPT);
            EXPECT_SAYS("so it is only read");
            expect_bytes(path, bytes, count);
        }
        EXPECT_STATUS(recording_repair(path, copy, &report), OK);
        EXPECT_TRUE(hash_of(copy) == hash);
        EXPECT_STATUS(append(copy), OK);
        expect_bytes(path, bytes, count);
        recording_discard(copy);
        recording_discard(path);
        free(bytes);
    }
}

// What a file has is what it is made with: all of these programs' own tables, added one by one.
static void test_all_own_tables_are_written_to(void **state)
{
    (void)state;
    char path[128];
    struct recording_report report;
    snprintf(path, sizeof path, "%s", sample_path("own"));
    sample_recording_write(path);
    for (size_t k = 0; k < COUNT_OF(writers); k++)
        EXPECT_STATUS(writers[k](path), k == 3 || k == 2 ? ERR_MISSING : OK); // "second" has another name by then
    EXPECT_STATUS(recording_verify(path, &report), OK);
    EXPECT_STATUS(recording_repair(path, sample_path("none"), &report), NOTHING);
}

static void test_files_of_older_versions_are_written_to(void **state)
{
    (void)state;
    static const char *const older[] = {"first", "point_side", "joint_error", "sealed", "two_states"};
    char path[128];
    snprintf(path, sizeof path, "%s", sample_path("older"));
    for (size_t i = 0; i < COUNT_OF(older); i++) {
        char from[300];
        snprintf(from, sizeof from, SOURCE_DIR "/tests/recording/data/%s.reenact", older[i]);
        copy_file(from, path);
        const uint64_t hash = hash_of(path);
        EXPECT_STATUS(recording_annotate_take(path, "one", "a note", NULL), OK);
        for (int times = 0; times < 2; times++) // the second time with what the first has added
            EXPECT_STATUS(append(path), OK);
        EXPECT_STATUS(drive_in(path), OK);
        EXPECT_TRUE(hash_of(path) == hash);
        recording_discard(path);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_crafted_files_are_only_read),
        cmocka_unit_test(test_all_own_tables_are_written_to),
        cmocka_unit_test(test_files_of_older_versions_are_written_to),
    };
    return cmocka_run_group_tests(tests, sample_folder_make, sample_folder_remove);
}
