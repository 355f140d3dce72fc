// What is expected of a take in a recording: kept, replaced, removed, carried by rename, copy and repair, gone with the
// take; older files have none; damage is found and costs nothing else.
#include "recording/recorded_expectation.h"
#include "tests/support/recording_sample.h"
#include "tests/support/sql.h"

static enum status read_expected(const char *path, const char *name, struct take_expectation *out)
{
    struct recording *r;
    struct take *take;
    EXPECT_STATUS(recording_open(&r, path), OK);
    EXPECT_STATUS(take_open(&take, r, name), OK);
    const enum status status = recorded_expectation_read(take, out);
    take_close(&take);
    recording_free(&r);
    return status;
}

static int64_t number_of(const char *path, const char *name)
{
    struct recording *r;
    EXPECT_STATUS(recording_open(&r, path), OK);
    const int64_t number = recording_take_number(r, name);
    const char *back = recording_numbered_take(r, number);
    EXPECT_TRUE(number < 0 ? !back : !strcmp(back, name));
    recording_free(&r);
    return number;
}

static const char *fresh(const char *name)
{
    unlink(sample_path(name));
    sample_recording_write(sample_path(name));
    return sample_path(name);
}

static struct take_expectation sample_expectation(int64_t reference)
{
    struct take_expectation e = {.ignored = 1 << PART_HEAD,
                                 .from_ns = -1000000000,
                                 .to_ns = 4500000000,
                                 .reference_count = 1,
                                 .reference = {reference}};
    e.tolerance_rad[PART_RIGHT_SHIN] = 0.35;
    return e;
}

static void expect_sample(const char *path, const char *name, int references)
{
    struct take_expectation e;
    EXPECT_STATUS(read_expected(path, name, &e), OK);
    EXPECT_INT(e.ignored, 1 << PART_HEAD);
    EXPECT_NEAR(e.tolerance_rad[PART_RIGHT_SHIN], 0.35, 0);
    EXPECT_NEAR(e.tolerance_rad[PART_LEFT_SHIN], 0, 0);
    EXPECT_INT(e.from_ns, -1000000000);
    EXPECT_INT(e.to_ns, 4500000000);
    EXPECT_INT(e.reference_count, references);
}

static void test_it_is_kept_and_removed(void **state)
{
    (void)state;
    char path[128];
    struct take_expectation back;
    struct recording_report report;
    snprintf(path, sizeof path, "%s", fresh("kept"));
    const int64_t take = number_of(path, "höher"), other = number_of(path, "second");
    EXPECT_INT(number_of(path, "nope"), -1);
    EXPECT_STATUS(read_expected(path, "höher", &back), NOTHING);
    EXPECT_TRUE(take_expectation_is_empty(&back));
    struct take_expectation e = sample_expectation(other);
    e.ignored = 0;
    EXPECT_STATUS(recorded_expectation_write(path, take, &e), OK);
    e.ignored = 1 << PART_HEAD;
    EXPECT_STATUS(recorded_expectation_write(path, take, &e), OK); // the second one counts
    expect_sample(path, "höher", 1);
    EXPECT_STATUS(read_expected(path, "second", &back), NOTHING);
    EXPECT_STATUS(recording_verify(path, &report), OK);
    struct take_expectation wrong[6];
    for (size_t i = 0; i < COUNT_OF(wrong); i++)
        wrong[i] = e;
    wrong[0].tolerance_rad[0] = NAN;
    wrong[1].tolerance_rad[0] = 7;
    wrong[2].ignored = (1 << PART_COUNT) - 1;
    wrong[3].from_ns = wrong[3].to_ns + 1;
    wrong[4].reference_count = EXPECTATION_REFERENCES_MAX + 1;
    wrong[5].reference[0] = 0;
    for (size_t i = 0; i < COUNT_OF(wrong); i++)
        EXPECT_STATUS(recorded_expectation_write(path, take, &wrong[i]), ERR_INPUT);
    expect_sample(path, "höher", 1);
    EXPECT_STATUS(recorded_expectation_write(path, take, &(struct take_expectation){.ignored = 0}), OK);
    EXPECT_STATUS(read_expected(path, "höher", &back), NOTHING);
    EXPECT_STATUS(recording_verify(path, &report), OK);
}

static void test_it_goes_with_its_take(void **state)
{
    (void)state;
    char path[128], other[128];
    struct take_expectation back;
    struct take_copy_report copied;
    struct recording_report report;
    snprintf(path, sizeof path, "%s", fresh("goes"));
    snprintf(other, sizeof other, "%s", sample_path("other"));
    const int64_t take = number_of(path, "höher"), further = number_of(path, "second");
    struct take_expectation e = sample_expectation(further);
    EXPECT_STATUS(recorded_expectation_write(path, take, &e), OK);
    EXPECT_STATUS(recording_rename_take(path, "höher", "high"), OK);
    EXPECT_STATUS(recording_rename_take(path, "second", "2nd"), OK);
    expect_sample(path, "high", 1);
    EXPECT_INT(number_of(path, "2nd"), further);
    EXPECT_STATUS(recording_copy_take(path, "high", path, "copy", &copied), OK);
    expect_sample(path, "copy", 1);
    EXPECT_STATUS(recording_copy_take(path, "high", other, "high", &copied), OK);
    expect_sample(other, "high", 0); // further takes are in the other file
    EXPECT_STATUS(recording_trim_take(path, "high", 100000000, 500000000, NULL), OK);
    expect_sample(path, "high", 1);
    EXPECT_STATUS(recording_delete_take(path, "2nd", NULL), OK);
    expect_sample(path, "high", 0);
    expect_sample(path, "copy", 0);
    EXPECT_STATUS(recording_verify(path, &report), OK);
    EXPECT_STATUS(recording_delete_take(path, "high", NULL), OK);
    EXPECT_STATUS(recording_rename_take(path, "copy", "last"), OK);
    expect_sample(path, "last", 0);
    EXPECT_STATUS(recording_delete_take(path, "last", NULL), OK);
    EXPECT_STATUS(recording_copy_take(other, "high", path, "new", &copied), OK);
    expect_sample(path, "new", 0);
    EXPECT_STATUS(recorded_expectation_write(path, number_of(path, "new"), &(struct take_expectation){.ignored = 0}),
                  OK);
    EXPECT_STATUS(read_expected(path, "new", &back), NOTHING);
}

static void test_damage_costs_it_alone(void **state)
{
    (void)state;
    char path[128], saved[128];
    struct take_expectation back;
    struct recording_report report;
    static const char *const damage[] = {
        "UPDATE expectation SET numbers = zeroblob(106)", "UPDATE expectation SET numbers = zeroblob(3)",
        "UPDATE expectation SET takes = x'0102'",         "UPDATE expectation SET takes = zeroblob(8000)",
        "UPDATE expectation SET crc = crc + 1",           "UPDATE expectation SET numbers = NULL, takes = 'text'"};
    for (size_t i = 0; i < COUNT_OF(damage); i++) {
        snprintf(path, sizeof path, "%s", fresh("damaged"));
        snprintf(saved, sizeof saved, "%s", sample_path("saved"));
        unlink(saved);
        const struct take_expectation e = sample_expectation(number_of(path, "second"));
        EXPECT_STATUS(recorded_expectation_write(path, number_of(path, "höher"), &e), OK);
        EXPECT_STATUS(recorded_expectation_write(path, number_of(path, "second"), &e), OK);
        char sql[200];
        snprintf(sql, sizeof sql, "%s WHERE id = %d", damage[i], (int)number_of(path, "höher"));
        run_sql(path, sql);
        EXPECT_STATUS(read_expected(path, "höher", &back), ERR_CORRUPT); // the take itself opens
        EXPECT_TRUE(take_expectation_is_empty(&back));
        expect_sample(path, "second", 1);
        EXPECT_STATUS(recording_verify(path, &report), ERR_CORRUPT);
        EXPECT_INT(report.findings, 1);
        EXPECT_STATUS(recording_repair(path, saved, &report), OK);
        EXPECT_INT(report.lost_takes, 0);
        EXPECT_STATUS(read_expected(saved, "höher", &back), NOTHING);
        expect_sample(saved, "second", 1);
        EXPECT_STATUS(recording_verify(saved, &report), OK);
        // It can be said anew over what is damaged, and the take can be deleted.
        EXPECT_STATUS(recorded_expectation_write(path, number_of(path, "höher"), &e), OK);
        EXPECT_STATUS(recording_verify(path, &report), OK);
        run_sql(path, sql);
        EXPECT_STATUS(recording_delete_take(path, "höher", NULL), OK);
        EXPECT_STATUS(recording_verify(path, &report), OK);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_it_is_kept_and_removed),
        cmocka_unit_test(test_it_goes_with_its_take),
        cmocka_unit_test(test_damage_costs_it_alone),
    };
    return cmocka_run_group_tests(tests, sample_folder_make, sample_folder_remove);
}
