// A file of very many takes is opened, listed and verified in a time that grows as they do: quadratic, twenty thousand
// of them would take minutes.
#include "recording/recording_reader.h"
#include "tests/support/recording_sample.h"

#include <time.h>

static double cpu_s(void) { return (double)clock() / CLOCKS_PER_SEC; }

static void make(const char *path, int takes)
{
    struct recording_writer *w;
    struct database *db;
    struct statement *s;
    struct take_row take = {.calibration = sample_calibration(), .complete = true, .body.representative_frame = -1};
    uint8_t calibration[CALIBRATION_BYTES], body[BODY_BYTES];
    EXPECT_STATUS(recording_create(&w, path), OK);
    EXPECT_STATUS(recording_close(&w), OK);
    EXPECT_STATUS(database_open(&db, path, DATABASE_WRITE), OK);
    EXPECT_STATUS(database_run(db, "BEGIN"), OK);
    EXPECT_STATUS(insert_open(&s, db, TABLE_TAKE, false), OK);
    for (take.id = 1; take.id <= takes; take.id++) {
        snprintf(take.name, sizeof take.name, "take %lld", (long long)take.id);
        take_bind(s, &take, calibration, body);
        EXPECT_STATUS(statement_run(s), OK);
    }
    statement_close(&s);
    EXPECT_STATUS(database_run(db, "COMMIT"), OK);
    database_close(&db);
}

// CPU time of what `info` and `verify` do with each take; the fastest of three.
static double read_all(const char *path, int takes)
{
    double least = 1e9;
    for (int turn = 0; turn < 3; turn++) {
        const double begun = cpu_s();
        struct recording_report report;
        struct recording *r;
        EXPECT_STATUS(recording_open(&r, path), OK);
        EXPECT_INT(recording_take_count(r), takes);
        for (int i = 0; i < takes; i++) {
            struct take *take;
            struct take_sizes sizes;
            EXPECT_STATUS(take_open(&take, r, recording_take_name(r, i)), OK);
            EXPECT_STATUS(take_read_sizes(take, &sizes), OK);
            EXPECT_INT(take_frame_count(take), 0);
            take_close(&take);
        }
        recording_free(&r);
        EXPECT_STATUS(recording_verify(path, &report), OK);
        EXPECT_INT(report.takes, takes);
        least = fmin(least, cpu_s() - begun);
    }
    return least;
}

static void test_time_grows_as_the_takes_do(void **state)
{
    (void)state;
    enum { FEW = 2000, TIMES = 10 };
    char few[128], many[128];
    snprintf(few, sizeof few, "%s", sample_path("few"));
    snprintf(many, sizeof many, "%s", sample_path("many"));
    make(few, FEW);
    make(many, TIMES * FEW);
    const double few_s = read_all(few, FEW), many_s = read_all(many, TIMES * FEW);
    print_message("%d takes: %.3f s, %d takes: %.3f s\n", FEW, few_s, TIMES * FEW, many_s);
    EXPECT_AT_MOST(many_s, 3 * TIMES * few_s); // quadratic: 100 times
}

// The first of equal names, and none that only begins alike.
static void test_takes_are_found_by_name(void **state)
{
    (void)state;
    char path[128];
    struct recording *r;
    snprintf(path, sizeof path, "%s", sample_path("named"));
    make(path, 300);
    EXPECT_STATUS(recording_open(&r, path), OK);
    for (int i = 0; i < 300; i++)
        EXPECT_INT(recording_find_take(r, recording_take_name(r, i)), i);
    EXPECT_INT(recording_find_take(r, "take"), -1);
    EXPECT_INT(recording_find_take(r, "take 30 "), -1);
    EXPECT_INT(recording_find_take(r, "zebra"), -1);
    EXPECT_INT(recording_find_take(r, ""), -1);
    recording_free(&r);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_time_grows_as_the_takes_do),
        cmocka_unit_test(test_takes_are_found_by_name),
    };
    return cmocka_run_group_tests(tests, sample_folder_make, sample_folder_remove);
}
