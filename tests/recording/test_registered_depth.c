// A calibration with registered depth has the identity as color_from_depth: refused when written otherwise, corrected
// when an older file is read or repaired.
#include "platform/files/database.h"
#include "recording/recording_schema.h"
#include "tests/support/recording_sample.h"

// Where depth is registered to colour, color_from_depth is the identity: the writer refuses another, and reading files
// that have one replaces it, since capture would use it and reenact would not.
static void test_registered_depth_has_no_pose_of_its_own(void **state)
{
    (void)state;
    struct calibration c = sample_calibration(), read;
    c.registered = true;
    c.color_from_depth.translation.x = 0.1;
    struct recording_writer *w;
    EXPECT_STATUS(recording_create(&w, sample_path("registered")), OK);
    EXPECT_STATUS(recording_begin_take(w, "a", &c), ERR_INPUT);
    EXPECT_STATUS(recording_close(&w), OK);
    uint8_t bytes[CALIBRATION_BYTES]; // as an earlier version may have written it
    put_calibration(bytes, &c);
    get_calibration(bytes, &read);
    EXPECT_NEAR(read.color_from_depth.translation.x, 0, 0);
    c.registered = false;
    put_calibration(bytes, &c);
    get_calibration(bytes, &read);
    EXPECT_NEAR(read.color_from_depth.translation.x, 0.1, 0);
}

// Files of earlier versions may hold one; it is read as the identity and is no damage.
static void test_older_registered_depth_with_a_pose(void **state)
{
    (void)state;
    char path[4096];
    snprintf(path, sizeof path, "%s", sample_path("registered-before"));
    struct calibration c = sample_calibration();
    c.registered = true;
    c.color_from_depth = POSE_IDENTITY;
    struct recording_writer *w;
    EXPECT_STATUS(recording_create(&w, path), OK);
    EXPECT_STATUS(recording_begin_take(w, "a", &c), OK);
    struct take_frame frame = {.world_from_camera = POSE_IDENTITY};
    EXPECT_STATUS(recording_add_frame(w, &frame), OK);
    EXPECT_STATUS(recording_close(&w), OK);
    c.color_from_depth.translation.x = 0.1;
    uint8_t calibration[CALIBRATION_BYTES], body[BODY_BYTES];
    put_calibration(calibration, &c);
    put_body(body, &(struct body){.representative_frame = -1});
    struct database *db;
    struct statement *s;
    EXPECT_STATUS(database_open(&db, path, DATABASE_WRITE), OK);
    EXPECT_STATUS(statement_open(&s, db, "UPDATE take SET calibration = ?, crc = ?, seal = NULL"), OK);
    statement_bind_blob(s, 1, calibration, sizeof calibration);
    statement_bind_number(s, 2, take_crc("a", calibration, false, 0, body));
    EXPECT_STATUS(statement_run(s), OK);
    statement_close(&s);
    database_close(&db);
    struct recording_report report;
    EXPECT_STATUS(recording_verify(path, &report), OK);
    EXPECT_INT(report.interrupted_takes, 1);
    EXPECT_STATUS(recording_repair(path, sample_path("needless"), &report), NOTHING);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_registered_depth_has_no_pose_of_its_own),
        cmocka_unit_test(test_older_registered_depth_with_a_pose),
    };
    return cmocka_run_group_tests(tests, sample_folder_make, sample_folder_remove);
}
