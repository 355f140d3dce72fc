// The writer of frames by itself: what it was given is read back through a connection of our own, and its database is
// made to fail at a known row.
#include "tests/support/test.h"

#include "base/clock.h"
#include "recording/async_writer.h"
#include "tests/support/scratch.h"

#include <signal.h>
#include <stdio.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

// Of the sentence that says what SQLite found.
#define REFUSED "UNIQUE constraint failed: frame.id"

enum { SEED = 1970, FRAMES = 60, IMAGE_BYTES = 3000, SPACING_NS = 33333333 };

static struct scratch scratch;
static const char *path;
static struct database *db; // the writer's
static struct async_writer *writer;

static void open_writer(void)
{
    EXPECT_STATUS(database_open(&db, path, DATABASE_WRITE), OK);
    EXPECT_STATUS(database_lock_writer(db), OK);
    EXPECT_STATUS(async_writer_open(&writer, db), OK);
}

static int make_database(void **state)
{
    (void)state;
    scratch = scratch_make();
    path = scratch_file(&scratch, "recording");
    EXPECT_STATUS(database_open(&db, path, DATABASE_CREATE), OK);
    EXPECT_STATUS(recording_make_tables(db), OK);
    database_close(&db);
    open_writer();
    return 0;
}

static int remove_database(void **state)
{
    (void)state;
    EXPECT_STATUS(async_writer_close(&writer), OK); // a test has closed it, or it did not fail
    database_close(&db);
    scratch_remove(&scratch);
    return 0;
}

static int64_t count_of(const char *sql)
{
    struct database *reader;
    int64_t count = -1;
    EXPECT_STATUS(database_open(&reader, path, DATABASE_READ), OK);
    EXPECT_STATUS(database_number(reader, sql, &count), OK);
    database_close(&reader);
    return count;
}

// Frame i's images, of any length, the depth image of none at all now and then.
struct images {
    uint8_t color[IMAGE_BYTES], depth[IMAGE_BYTES], mask[IMAGE_BYTES];
    size_t color_bytes, depth_bytes, mask_bytes;
};

static void make_images(int i, struct images *images)
{
    struct rng rng = rng_of(SEED, i);
    for (int k = 0; k < IMAGE_BYTES; k++) {
        images->color[k] = (uint8_t)rng_pick(&rng, 256);
        images->depth[k] = (uint8_t)rng_pick(&rng, 256);
        images->mask[k] = (uint8_t)rng_pick(&rng, 256);
    }
    images->color_bytes = 1 + (size_t)rng_pick(&rng, IMAGE_BYTES);
    images->depth_bytes = (size_t)(i % 7 == 3 ? 0 : 1 + rng_pick(&rng, IMAGE_BYTES));
    images->mask_bytes = (size_t)(i % 5 == 2 ? 0 : 1 + rng_pick(&rng, IMAGE_BYTES));
}

static struct frame_row row_of(int i, const struct images *images)
{
    return (struct frame_row){.key = frame_key(1, i),
                              .time_ns = (int64_t)i * SPACING_NS,
                              .located = i % 2,
                              .world_from_camera = {{0, 0, 0, 1}, {0.25 * i, -1, 3}},
                              .color = images->color,
                              .depth = images->depth_bytes ? images->depth : NULL,
                              .mask = images->mask_bytes ? images->mask : NULL,
                              .color_bytes = images->color_bytes,
                              .depth_bytes = images->depth_bytes,
                              .mask_bytes = images->mask_bytes};
}

// The row's memory is spoilt as soon as the writer has it.
static enum status add_frame(int i)
{
    struct images images;
    make_images(i, &images);
    const struct frame_row row = row_of(i, &images);
    const enum status status = async_writer_add_frame(writer, &row);
    memset(&images, 0xee, sizeof images);
    return status;
}

// The pause ends before the answer is judged: a failed check must not leave the lock taken.
static enum status commit(void)
{
    const enum status status = async_writer_pause(writer);
    async_writer_resume(writer, OK);
    return status;
}

static void expect_image(struct statement *row, int column, const uint8_t *wanted, size_t wanted_bytes)
{
    size_t count;
    const uint8_t *bytes = statement_blob(row, column, &count);
    EXPECT_INT(count, wanted_bytes);
    EXPECT_TRUE(!wanted_bytes == statement_is_null(row, column));
    EXPECT_TRUE(!wanted_bytes || !memcmp(bytes, wanted, wanted_bytes));
}

static void expect_frames(int frames)
{
    struct database *reader;
    struct statement *row;
    EXPECT_STATUS(database_open(&reader, path, DATABASE_READ), OK);
    EXPECT_STATUS(statement_open(&row, reader,
                                 "SELECT frame.id, time_ns, located, world_from_camera, color, depth, mask "
                                 "FROM frame JOIN picture USING (id) ORDER BY frame.id"),
                  OK);
    for (int i = 0; i < frames; i++) {
        struct images images;
        make_images(i, &images);
        EXPECT_STATUS(statement_step(row), OK);
        EXPECT_INT(statement_number(row, 0), frame_key(1, i));
        EXPECT_INT(statement_number(row, 1), (int64_t)i * SPACING_NS);
        EXPECT_INT(statement_number(row, 2), i % 2);
        size_t count;
        struct pose pose;
        const uint8_t *bytes = statement_blob(row, 3, &count);
        EXPECT_INT(count, POSE_BYTES);
        get_pose(bytes, &pose);
        EXPECT_NEAR(pose.translation.x, 0.25 * i, 0);
        expect_image(row, 4, images.color, images.color_bytes);
        expect_image(row, 5, images.depth, images.depth_bytes);
        expect_image(row, 6, images.mask, images.mask_bytes);
    }
    EXPECT_STATUS(statement_step(row), NOTHING);
    statement_close(&row);
    database_close(&reader);
}

// Waits until the counters hold; false after `seconds`.
static bool wait_until(bool (*holds)(const struct recording_counters *), double seconds)
{
    const int64_t end_ns = clock_now_ns() + (int64_t)(seconds * 1e9);
    struct recording_counters counters;
    for (;;) {
        async_writer_count(writer, &counters);
        if (holds(&counters))
            return true;
        if (clock_now_ns() > end_ns)
            return false;
        usleep(2000);
    }
}

static bool has_committed(const struct recording_counters *c) { return c->committed_frames > 0; }
static bool has_synced(const struct recording_counters *c) { return c->synced_frames == FRAMES; }
static bool has_failed(const struct recording_counters *c) { return c->failed; }

// ------------------------------------------------------------- what is written

static void test_nothing_added_writes_nothing(void **state)
{
    (void)state;
    struct recording_counters counters;
    async_writer_count(writer, &counters);
    EXPECT_INT(counters.waiting_frames + counters.committed_frames + counters.written_bytes, 0);
    EXPECT_TRUE(counters.committed_ns == INT64_MIN && counters.synced_ns == INT64_MIN && !counters.failed);
    EXPECT_STATUS(commit(), OK);
    EXPECT_STATUS(async_writer_close(&writer), OK);
    assert_null(writer);
    EXPECT_INT(count_of("SELECT count(*) FROM frame"), 0);
}

static void test_every_row_arrives_as_it_was(void **state)
{
    (void)state;
    for (int i = 0; i < FRAMES; i++)
        EXPECT_STATUS(add_frame(i), OK);
    EXPECT_STATUS(async_writer_close(&writer), OK);
    expect_frames(FRAMES);
}

// Without images or skeleton a frame has no row of images.
static void test_bare_frame(void **state)
{
    (void)state;
    const struct frame_row row = {.key = frame_key(3, 0), .world_from_camera = POSE_IDENTITY};
    EXPECT_STATUS(async_writer_add_frame(writer, &row), OK);
    EXPECT_STATUS(async_writer_close(&writer), OK);
    EXPECT_INT(count_of("SELECT count(*) FROM frame WHERE skeleton IS NULL AND pictures = 0"), 1);
    EXPECT_INT(count_of("SELECT count(*) FROM picture"), 0);
    EXPECT_INT(count_of("SELECT count(*) FROM joint_error"), 0);
}

static void test_later_take_row_replaces_the_earlier(void **state)
{
    (void)state;
    struct take_row take = {.id = 1, .name = "a", .frames = -1};
    EXPECT_STATUS(async_writer_put_take(writer, &take), OK);
    take.dropped = 7;
    EXPECT_STATUS(async_writer_put_take(writer, &take), OK); // within a batch
    EXPECT_STATUS(commit(), OK);
    EXPECT_INT(count_of("SELECT dropped FROM take"), 7);
    take.dropped = 9;
    EXPECT_STATUS(async_writer_put_take(writer, &take), OK); // and over a commit
    EXPECT_STATUS(async_writer_close(&writer), OK);
    EXPECT_INT(count_of("SELECT count(*) FROM take"), 1);
    EXPECT_INT(count_of("SELECT dropped FROM take"), 9);
}

// Between pause and resume the caller alone writes; what it added before is there.
static void test_pause_commits(void **state)
{
    (void)state;
    for (int i = 0; i < 5; i++)
        EXPECT_STATUS(add_frame(i), OK);
    EXPECT_STATUS(async_writer_pause(writer), OK);
    expect_frames(5);
    EXPECT_STATUS(database_run(db, "CREATE TABLE own(id INTEGER PRIMARY KEY); INSERT INTO own VALUES(4)"), OK);
    EXPECT_STATUS(async_writer_resume(writer, OK), OK);
    EXPECT_STATUS(add_frame(5), OK);
    EXPECT_STATUS(async_writer_close(&writer), OK);
    expect_frames(6);
    EXPECT_INT(count_of("SELECT id FROM own"), 4);
}

// The sensor's clock has passed BATCH_NS: the batch is written at once, without anybody waiting for it.
static void test_batch_is_due_by_the_sensors_clock(void **state)
{
    (void)state;
    int added = 0;
    do
        EXPECT_STATUS(add_frame(added), OK);
    while ((int64_t)added++ * SPACING_NS < BATCH_NS);
    EXPECT_TRUE(wait_until(has_committed, 10));
    for (; added < FRAMES; added++)
        EXPECT_STATUS(add_frame(added), OK);
    EXPECT_STATUS(commit(), OK);
    EXPECT_TRUE(wait_until(has_synced, 20));
    struct recording_counters counters;
    async_writer_count(writer, &counters);
    EXPECT_INT(counters.waiting_frames, 0);
    EXPECT_INT(counters.waiting_bytes, 0);
    EXPECT_INT(counters.synced_ns, (int64_t)(FRAMES - 1) * SPACING_NS);
    EXPECT_TRUE(counters.waiting_frames_max >= 1 && counters.waiting_frames_max <= FRAMES);
}

// And by the wall clock, if the sensor falls silent after one frame.
static void test_batch_is_due_by_the_wall_clock(void **state)
{
    (void)state;
    EXPECT_STATUS(add_frame(0), OK);
    EXPECT_TRUE(wait_until(has_committed, 10));
    expect_frames(1);
}

// ------------------------------------------------------------- failures

// The database refuses frame `number`, whose id it has: its batch is undone, and from then on nothing is written.
static void refuse(int number)
{
    char sql[200];
    snprintf(sql, sizeof sql, "INSERT INTO frame(id) VALUES(%lld)", (long long)frame_key(1, number));
    EXPECT_STATUS(async_writer_pause(writer), OK);
    EXPECT_STATUS(async_writer_resume(writer, database_run(db, sql)), OK);
}

static void test_first_error_stays(void **state)
{
    (void)state;
    refuse(8);
    for (int i = 0; i < 6; i++)
        EXPECT_STATUS(add_frame(i), OK);
    EXPECT_STATUS(commit(), OK);
    for (int i = 6; i < 11; i++)
        EXPECT_STATUS(add_frame(i), OK); // the error is met when they are written
    const enum status first = commit();
    EXPECT_TRUE(first < 0);
    EXPECT_SAYS(REFUSED);
    for (int i = 0; i < 3; i++) {
        EXPECT_STATUS(fail(ERR_INPUT, "another sentence"), ERR_INPUT);
        EXPECT_STATUS(add_frame(20 + i), first);
        EXPECT_SAYS(REFUSED);
        EXPECT_STATUS(async_writer_put_take(writer, &(struct take_row){.id = 1}), first);
        EXPECT_STATUS(commit(), first);
    }
    struct recording_counters counters;
    async_writer_count(writer, &counters);
    EXPECT_TRUE(counters.failed);
    EXPECT_INT(counters.committed_frames, 6);
    EXPECT_TRUE(!database_in_transaction(db));
    EXPECT_STATUS(async_writer_close(&writer), first);
    EXPECT_SAYS(REFUSED);
    assert_null(writer);
    expect_frames(6); // and nothing of the batch that failed
}

// The thread that writes meets it, while nobody calls.
static void test_error_of_the_writing_thread(void **state)
{
    (void)state;
    refuse(1);
    EXPECT_STATUS(add_frame(0), OK);
    EXPECT_STATUS(add_frame(1), OK);
    EXPECT_TRUE(wait_until(has_failed, 10));
    const enum status status = add_frame(2);
    EXPECT_TRUE(status < 0);
    EXPECT_SAYS(REFUSED);
    EXPECT_STATUS(async_writer_close(&writer), status);
    expect_frames(0);
}

static void test_key_that_is_taken(void **state)
{
    (void)state;
    EXPECT_STATUS(add_frame(0), OK);
    EXPECT_STATUS(add_frame(0), OK);
    EXPECT_TRUE(async_writer_close(&writer) < 0);
    expect_frames(0);
}

static void test_callers_own_error(void **state)
{
    (void)state;
    EXPECT_STATUS(add_frame(0), OK);
    EXPECT_STATUS(async_writer_pause(writer), OK);
    EXPECT_STATUS(async_writer_resume(writer, fail(ERR_CORRUPT, "the caller's own")), ERR_CORRUPT);
    EXPECT_STATUS(add_frame(1), ERR_CORRUPT);
    EXPECT_STATUS(async_writer_close(&writer), ERR_CORRUPT);
    EXPECT_SAYS("the caller's own");
    expect_frames(1);
}

static void test_no_tables(void **state)
{
    (void)state;
    EXPECT_STATUS(async_writer_pause(writer), OK);
    EXPECT_STATUS(async_writer_resume(writer, database_run(db, "DROP TABLE picture")), OK);
    EXPECT_STATUS(async_writer_close(&writer), OK);
    struct async_writer *second = (struct async_writer *)&scratch;
    EXPECT_TRUE(async_writer_open(&second, db) < 0);
    assert_null(second);
}

// A file that may not grow: in a process of its own, for the limit stays. Returns 0 if all is as async_writer.h says.
static int fill_disk(void)
{
    signal(SIGXFSZ, SIG_IGN);
    const struct rlimit limit = {300000, 300000};
    if (setrlimit(RLIMIT_FSIZE, &limit))
        return 1;
    enum status status = OK;
    int added = 0;
    for (; added < 2000 && status == OK; added++)
        status = added % 10 == 9 ? commit() : add_frame(added - added / 10);
    if (status != ERR_IO || !strstr(status_message(), path))
        return 2;
    struct recording_counters counters;
    async_writer_count(writer, &counters);
    if (!counters.failed || counters.committed_frames >= added)
        return 3;
    const enum status closed = async_writer_close(&writer);
    return closed == ERR_IO ? 0 : 4;
}

static void test_full_disk(void **state)
{
    (void)state;
    EXPECT_STATUS(async_writer_close(&writer), OK);
    database_close(&db);
    fflush(NULL);
    const pid_t child = fork();
    if (!child) {
        open_writer();
        _exit(fill_disk());
    }
    int how;
    waitpid(child, &how, 0);
    EXPECT_INT(how, 0);
    const int64_t frames = count_of("SELECT count(*) FROM frame"); // whole batches, from the first on
    print_message("%lld frames were kept\n", (long long)frames);
    EXPECT_INT(count_of("SELECT count(*) FROM picture"), frames);
    EXPECT_AT_LEAST((double)frames, 9); // measured 45
    expect_frames((int)frames);
}

static void test_closing_nothing(void **state)
{
    (void)state;
    struct async_writer *none = NULL;
    EXPECT_STATUS(async_writer_close(&none), OK);
}

int main(void)
{
#define WITH_WRITER(test) cmocka_unit_test_setup_teardown(test, make_database, remove_database)
    const struct CMUnitTest tests[] = {
        WITH_WRITER(test_nothing_added_writes_nothing),
        WITH_WRITER(test_every_row_arrives_as_it_was),
        WITH_WRITER(test_bare_frame),
        WITH_WRITER(test_later_take_row_replaces_the_earlier),
        WITH_WRITER(test_pause_commits),
        WITH_WRITER(test_batch_is_due_by_the_sensors_clock),
        WITH_WRITER(test_batch_is_due_by_the_wall_clock),
        WITH_WRITER(test_first_error_stays),
        WITH_WRITER(test_error_of_the_writing_thread),
        WITH_WRITER(test_key_that_is_taken),
        WITH_WRITER(test_callers_own_error),
        WITH_WRITER(test_no_tables),
        WITH_WRITER(test_full_disk),
        cmocka_unit_test(test_closing_nothing),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
