// Where a robot was driven, in a recording: written, read, replaced, carried over by repair; older files have none;
// damage is noticed.
#include "tests/support/test.h"

#include "platform/files/database.h"
#include "recording/recorded_things.h"
#include "tests/support/scratch.h"

#include <stdio.h>

static char path[256];

static enum status read_drive(const char *file, struct recorded_drive *out)
{
    struct recording *r;
    EXPECT_STATUS(recording_open(&r, file), OK);
    const enum status status = recording_read_drive(r, out);
    recording_free(&r);
    return status;
}

static void damage(const char *statement)
{
    struct database *db;
    EXPECT_STATUS(database_open(&db, path, DATABASE_WRITE), OK);
    EXPECT_STATUS(database_run(db, statement), OK);
    database_close(&db);
}

static void test_a_drive_is_kept(void **state)
{
    (void)state;
    struct scratch scratch = scratch_make();
    struct recording_writer *w;
    struct recording_report report;
    char repaired[256];
    const struct recorded_thing thing = {.name = "mug", .world_from_thing = {{0, 0, 0, 1}, {0, 0, 0}}};
    struct recorded_drive drive = {.size_m = {0.6, 0.5, 1.2},
                                   .world_from_body = {quat_from_rotation_vector(v3(0, 0, 0.7)), v3(3, -1, 0)},
                                   .path = {{0, 0, 0}, {1.5, 0.25, 0}},
                                   .path_count = 2},
                          back = {.path_count = 7};
    snprintf(path, sizeof path, "%s", scratch_file(&scratch, "a.reenact"));
    snprintf(repaired, sizeof repaired, "%s", scratch_file(&scratch, "b.reenact"));
    EXPECT_STATUS(recording_create(&w, path), OK);
    EXPECT_STATUS(recording_close(&w), OK);
    EXPECT_STATUS(read_drive(path, &back), NOTHING);
    EXPECT_INT(back.path_count, 7);
    EXPECT_STATUS(recording_write_drive(path, &drive), OK);
    drive.path[1].y = 0.5; // the second one counts
    EXPECT_STATUS(recording_write_drive(path, &drive), OK);
    drive.path[1].x = NAN;
    EXPECT_STATUS(recording_write_drive(path, &drive), ERR_INPUT);
    EXPECT_STATUS(recording_verify(path, &report), OK);
    EXPECT_STATUS(recording_write_things(path, &thing, 1), OK);
    damage("UPDATE thing SET note = 'other'");
    EXPECT_STATUS(recording_repair(path, repaired, &report), OK);
    for (int i = 0; i < 2; i++) {
        EXPECT_STATUS(read_drive(i ? repaired : path, &back), OK);
        EXPECT_INT(back.path_count, 2);
        EXPECT_NEAR(back.path[1].x, 1.5, 0);
        EXPECT_NEAR(back.path[1].y, 0.5, 0);
        EXPECT_NEAR(back.size_m[1], 0.5, 0);
        EXPECT_NEAR(back.world_from_body.translation.x, 3, 0);
        EXPECT_NEAR(back.world_from_body.rotation.z, drive.world_from_body.rotation.z, 0);
    }
    EXPECT_STATUS(recording_write_things(path, NULL, 0), OK);
    damage("UPDATE drive SET path = zeroblob(48)");
    EXPECT_STATUS(read_drive(path, &back), ERR_CORRUPT);
    EXPECT_STATUS(recording_verify(path, &report), ERR_CORRUPT);
    EXPECT_INT(report.findings, 1);
    scratch_remove(&scratch);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_a_drive_is_kept)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
