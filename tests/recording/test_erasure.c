// What is deleted is no longer in the file nor beside it, whoever else has the file open; where that cannot be had it
// is said, and asking again finishes it. Nothing of one person comes into another's file.
#include "recording/prepared.h"
#include "recording/recording_reader.h"
#include "recording/recording_takes.h"
#include "tests/support/copy_file.h"
#include "tests/support/random.h"
#include "tests/support/recording_sample.h"

static struct recording *recording;
static struct take *take;

// As the program that watches a take has it open: between two reads.
static void open_take(const char *path, const char *name)
{
    struct take_images images;
    EXPECT_STATUS(recording_open(&recording, path), OK);
    EXPECT_STATUS(take_open(&take, recording, name), OK);
    EXPECT_STATUS(take_read(take, 0, TAKE_COLOR, &images), OK);
}

static void close_take(void)
{
    take_close(&take);
    recording_free(&recording);
}

static void fresh(char path[128], const char *name)
{
    snprintf(path, 128, "%s", sample_path(name));
    sample_recording_write(path);
}

static void add_take(const char *path, const char *name, int first, int frames)
{
    const struct calibration calibration = sample_calibration();
    struct recording_writer *w;
    EXPECT_STATUS(recording_append(&w, path), OK);
    EXPECT_STATUS(recording_begin_take(w, name, &calibration), OK);
    sample_frames_add(w, first, frames);
    EXPECT_STATUS(recording_end_take(w), OK);
    EXPECT_STATUS(recording_close(&w), OK);
}

// How often these bytes lie in the file and in what lies beside it.
static int found_beside(const char *path, const void *wanted, size_t wanted_count)
{
    static const char *const endings[] = {"", "-wal", "-journal", "-shm"};
    int found = 0;
    for (size_t i = 0; i < COUNT_OF(endings); i++) {
        char name[140];
        uint8_t *bytes, *at;
        size_t count;
        snprintf(name, sizeof name, "%s%s", path, endings[i]);
        if (!file_exists(name))
            continue;
        EXPECT_STATUS(file_read(name, &bytes, &count), OK);
        for (at = bytes; (at = memmem(at, count - (size_t)(at - bytes), wanted, wanted_count)); at++)
            found++;
        free(bytes);
    }
    return found;
}

// Of the sample's frames `first` to `last`, how many colour images are found, each by 200 bytes in its middle.
static int images_in(const char *path, int first, int last)
{
    static struct sample_frame m;
    int images = 0;
    for (int i = first; i <= last; i++) {
        sample_frame_make(&m, i);
        images += m.jpeg && found_beside(path, m.jpeg + 700, 200) > 0;
        free(m.jpeg);
    }
    return images;
}

static int takes_in(const char *path)
{
    struct recording_report report;
    EXPECT_STATUS(recording_verify(path, &report), OK);
    return report.takes;
}

enum { FIRST = 5, LAST = FRAMES - 1 }; // frames that only the take "höher" has

// A take that was deleted before has left copies of all others in the log, which a program that has the file open keeps
// from being started anew.
static void test_beside_a_program_that_has_it_open(void **state)
{
    (void)state;
    char path[128];
    int64_t freed;
    fresh(path, "watched");
    EXPECT_AT_LEAST(images_in(path, FIRST, LAST), 20);
    open_take(path, "second");
    add_take(path, "third", 0, 3);
    EXPECT_STATUS(recording_delete_take(path, "third", &freed), OK);
    EXPECT_STATUS(recording_delete_take(path, "höher", &freed), OK);
    EXPECT_INT(images_in(path, FIRST, LAST), 0);
    close_take();
    EXPECT_INT(images_in(path, FIRST, LAST), 0);
    EXPECT_INT(takes_in(path), 1);
}

static void test_trimmed_beside_a_program_that_has_it_open(void **state)
{
    (void)state;
    char path[128];
    int64_t freed;
    fresh(path, "watched-trim");
    open_take(path, "second");
    const int rest = images_in(path, 20, 29);
    add_take(path, "third", 0, 3);
    EXPECT_STATUS(recording_delete_take(path, "third", &freed), OK);
    close_take();
    open_take(path, "höher");
    const int64_t from_ns = take_entry(take, 20)->time_ns - take_entry(take, 0)->time_ns,
                  to_ns = take_entry(take, 29)->time_ns - take_entry(take, 0)->time_ns;
    EXPECT_STATUS(recording_trim_take(path, "höher", from_ns, to_ns, NULL), OK);
    EXPECT_INT(images_in(path, FIRST, 19), 0);
    EXPECT_INT(images_in(path, 30, LAST), 0);
    EXPECT_INT(images_in(path, 20, 29), rest);
    close_take();
}

// A program in the middle of reading needs what is deleted: refused, and nothing has changed. Afterwards it is done.
static void test_beside_a_program_that_reads(void **state)
{
    (void)state;
    char path[128];
    int64_t freed;
    fresh(path, "read");
    open_take(path, "second");
    add_take(path, "third", 0, 3);
    const int images = images_in(path, FIRST, LAST);
    for (int way = 0; way < 2; way++) {
        const bool trims = way == 0, logged = way == 1;
        struct recording_writer *w = NULL; // with the reader, it leaves the file with a log
        if (logged) {
            EXPECT_STATUS(recording_append(&w, path), OK);
            EXPECT_STATUS(database_run(recording_database(recording), "SELECT count(*) FROM take"), OK);
            EXPECT_STATUS(recording_close(&w), OK);
        }
        EXPECT_STATUS(database_run(recording_database(recording), "BEGIN; SELECT count(*) FROM take"), OK);
        EXPECT_STATUS(trims ? recording_trim_take(path, "höher", 0, 100000000, &freed)
                            : recording_delete_take(path, "höher", &freed),
                      ERR_IO);
        EXPECT_SAYS("close the other program, then run it again");
        if (logged)
            EXPECT_SAYS("nothing is changed");
        EXPECT_STATUS(database_run(recording_database(recording), "COMMIT"), OK);
        EXPECT_INT(images_in(path, FIRST, LAST), images);
        EXPECT_INT(takes_in(path), 3);
    }
    EXPECT_STATUS(recording_delete_take(path, "höher", &freed), OK);
    EXPECT_INT(images_in(path, FIRST, LAST), 0);
    EXPECT_STATUS(recording_delete_take(path, "höher", &freed), ERR_MISSING);
    close_take();
}

// The file's only writer, with what was deleted committed, while another program has begun to read in between.
static void delete_halfway(const char *path, struct recording *reader)
{
    struct database *db;
    struct erasure_request request = {.what = "delete", .take = "höher"};
    EXPECT_STATUS(database_open(&db, path, DATABASE_WRITE), OK);
    EXPECT_STATUS(database_lock_writer(db), OK);
    EXPECT_STATUS(erasure_begin(db, &request), OK);
    EXPECT_STATUS(database_run(recording_database(reader), "BEGIN; SELECT count(*) FROM take"), OK);
    EXPECT_STATUS(database_run(db,
                               "BEGIN; DELETE FROM frame WHERE id >> 32 = 1; DELETE FROM picture WHERE id >> 32 = 1;"
                               "DELETE FROM joint_error WHERE id >> 32 = 1; DELETE FROM take WHERE id = 1"),
                  OK);
    EXPECT_STATUS(erasure_note(db, &request), OK);
    EXPECT_STATUS(database_run(db, "COMMIT"), OK);
    EXPECT_STATUS(erasure_finish(db, "take 'höher' is deleted"), ERR_IO);
    EXPECT_SAYS("take 'höher' is deleted, but");
    EXPECT_SAYS("close the other program, then run it again");
    database_close(&db);
    EXPECT_STATUS(database_run(recording_database(reader), "COMMIT"), OK);
}

static void test_asked_again_it_is_finished(void **state)
{
    (void)state;
    char path[128];
    int64_t freed;
    fresh(path, "halfway");
    open_take(path, "second");
    delete_halfway(path, recording);
    EXPECT_AT_LEAST(images_in(path, FIRST, LAST), 1);
    EXPECT_STATUS(recording_delete_take(path, "nobody", &freed), ERR_MISSING); // another one
    EXPECT_STATUS(recording_delete_take(path, "höher", &freed), OK);
    EXPECT_INT(images_in(path, FIRST, LAST), 0);
    EXPECT_STATUS(recording_delete_take(path, "höher", &freed), ERR_MISSING);
    close_take();
    EXPECT_INT(takes_in(path), 1);

    // A new take that was given the name meanwhile is no longer the one whose deletion is to be finished.
    fresh(path, "halfway-again");
    open_take(path, "second");
    delete_halfway(path, recording);
    close_take();
    add_take(path, "höher", 0, LAST + 1);
    EXPECT_STATUS(recording_delete_take(path, "höher", &freed), OK);
    EXPECT_INT(takes_in(path), 1);
    EXPECT_INT(images_in(path, FIRST, LAST), 0);
}

// ------------------------------------------------------------- what is kept beside a take

enum { KEPT_BYTES = 200000 };

static void make_kept(uint8_t kept[KEPT_BYTES], uint64_t seed) // numbers that do not compress
{
    struct rng rng = {seed};
    for (int i = 0; i < KEPT_BYTES; i++)
        kept[i] = (uint8_t)(256 * rng_uniform(&rng));
}

static uint8_t kept[KEPT_BYTES];

static enum status keep(const char *path, int version)
{
    return prepared_write(path, take, PREPARED_AVATAR, version, kept, sizeof kept);
}

static bool is_kept(const char *path) { return found_beside(path, kept + KEPT_BYTES / 2, 200); }

static void test_a_replaced_copy_is_overwritten(void **state)
{
    (void)state;
    char path[128];
    fresh(path, "replaced-copy");
    open_take(path, "höher");
    make_kept(kept, SAMPLE_SEED);
    EXPECT_STATUS(keep(path, 1), OK);
    EXPECT_TRUE(is_kept(path));
    uint8_t *newer = kept;
    make_kept(newer, SAMPLE_SEED + 1);
    EXPECT_STATUS(keep(path, 2), OK);
    EXPECT_TRUE(is_kept(path));
    make_kept(kept, SAMPLE_SEED);
    EXPECT_TRUE(!is_kept(path));
    make_kept(kept, SAMPLE_SEED + 1);
    EXPECT_STATUS(recording_delete_take(path, "höher", NULL), OK);
    EXPECT_TRUE(!is_kept(path));
    close_take();
}

// While a take is open, its file is replaced: by another file of that name, by other bytes in the same file; or the
// take is trimmed or deleted. Nothing of the person comes into what lies there now.
static void test_nothing_is_kept_in_another_file(void **state)
{
    (void)state;
    char path[128], other[128];
    make_kept(kept, SAMPLE_SEED);
    for (int way = 0; way < 4; way++) {
        fresh(path, "mine");
        snprintf(other, sizeof other, "%s", sample_path("theirs"));
        struct recording_writer *w;
        EXPECT_STATUS(recording_create(&w, other), OK);
        EXPECT_STATUS(recording_close(&w), OK);
        add_take(other, "höher", 2, 30); // the same name and number, other frames
        open_take(path, "höher");
        if (way == 0) {
            EXPECT_INT(rename(other, path), 0);
        } else if (way == 1) {
            char command[300];
            snprintf(command, sizeof command, "cat %s > %s", other, path);
            EXPECT_INT(system(command), 0);
        } else if (way == 2) {
            EXPECT_STATUS(recording_trim_take(path, "höher", 0, 300000000, NULL), OK);
        } else {
            EXPECT_STATUS(recording_delete_take(path, "höher", NULL), OK);
        }
        EXPECT_STATUS(keep(path, 1), NOTHING);
        EXPECT_TRUE(!is_kept(path));
        close_take();
        unlink(path);
        unlink(other);
    }
    fresh(path, "mine"); // and into its own it comes
    open_take(path, "höher");
    EXPECT_STATUS(keep(path, 1), OK);
    EXPECT_TRUE(is_kept(path));
    close_take();
}

int main(void)
{
    printf("seed %d\n", SAMPLE_SEED);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_beside_a_program_that_has_it_open),
        cmocka_unit_test(test_trimmed_beside_a_program_that_has_it_open),
        cmocka_unit_test(test_beside_a_program_that_reads),
        cmocka_unit_test(test_asked_again_it_is_finished),
        cmocka_unit_test(test_a_replaced_copy_is_overwritten),
        cmocka_unit_test(test_nothing_is_kept_in_another_file),
    };
    return cmocka_run_group_tests(tests, sample_folder_make, sample_folder_remove);
}
