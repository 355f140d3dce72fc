// What verify finds in a place whose checksums are right but whose content cannot be (a writer's bug), or that is
// damaged, and what repair saves: each view, thing or covariance costs itself alone.
#include "recording/recorded_things.h"
#include "tests/support/expect_repair.h"
#include "tests/support/sql.h"

enum { SAMPLE_VIEWS = 3, THINGS = 3 };

// Fresh in the folder, with a place, takes and things.
static const char *sample_recording(void)
{
    static char path[128];
    struct recorded_thing things[THINGS] = {0};
    static uint8_t picture[5] = "image";
    snprintf(path, sizeof path, "%s", sample_path("place"));
    recording_remove_files(path);
    sample_recording_write(path);
    for (int i = 0; i < THINGS; i++) {
        snprintf(things[i].name, sizeof things[i].name, "thing %d", i);
        things[i].world_from_thing = POSE_IDENTITY;
    }
    things[1].image = things[2].image = (struct thing_content){picture, sizeof picture};
    EXPECT_STATUS(recording_write_things(path, things, THINGS), OK);
    return path;
}

static struct place repaired_place(void)
{
    struct recording *r;
    struct place place;
    EXPECT_STATUS(recording_open(&r, sample_path("repaired")), OK);
    EXPECT_STATUS(recording_read_place(r, &place), OK);
    recording_free(&r);
    return place;
}

// Replaces view 0 by one without depth, with the right checksums.
static void put_view(const char *path, const struct pose *world_from_camera, const uint8_t *jpeg, size_t jpeg_bytes)
{
    struct database *db;
    struct statement *s;
    uint8_t pose[POSE_BYTES];
    put_pose(pose, world_from_camera);
    const uint32_t crc = view_crc(pose, NULL, 0, jpeg, jpeg_bytes);
    EXPECT_STATUS(database_open(&db, path, DATABASE_WRITE), OK);
    EXPECT_STATUS(insert_open(&s, db, TABLE_VIEW, true), OK);
    statement_bind_number(s, 1, 0);
    statement_bind_blob(s, 2, pose, sizeof pose);
    statement_bind_blob(s, 4, jpeg, jpeg_bytes);
    statement_bind_number(s, 5, crc);
    statement_bind_number(s, VIEW_SEAL + 1, row_seal(0, crc));
    EXPECT_STATUS(statement_run(s), OK);
    statement_close(&s);
    database_close(&db);
}

static void test_a_view_costs_itself_alone(void **state)
{
    (void)state;
    const uint8_t no_jpeg[] = "\xff\xd8 no picture";
    const char *path = sample_recording();
    put_view(path, &POSE_IDENTITY, no_jpeg, sizeof no_jpeg);
    struct recording_report report = expect_repair(path, "1 views of the place cannot be decoded");
    EXPECT_INT(report.lost_views, 1);
    EXPECT_INT(report.lost_map_covariances, false);
    struct place place = repaired_place();
    EXPECT_INT(place.view_count, SAMPLE_VIEWS - 1);
    place_free(&place);

    path = sample_recording();
    put_view(path, &(struct pose){{0, 0, 0, 1}, {NAN, 0, 0}}, NULL, 0);
    report = expect_repair(path, "1 of 3 views of the place");
    EXPECT_INT(report.lost_views, 1);
    EXPECT_INT(report.lost_place, false);
    place = repaired_place();
    EXPECT_INT(place.view_count, SAMPLE_VIEWS - 1);
    place_free(&place);
}

static void test_an_unreadable_place_is_said(void **state)
{
    (void)state;
    const char *path = sample_recording();
    run_sql(path, "UPDATE place SET points = x'00'");
    const struct recording_report report = expect_repair(path, "the place cannot be read");
    EXPECT_INT(report.lost_place, true);
    EXPECT_INT(report.frames, FRAMES + 3);
}

// With the right checksum.
static void put_infinite_covariance(const char *path)
{
    struct recording *r;
    struct place place;
    struct database *db;
    struct statement *s;
    EXPECT_STATUS(recording_open(&r, path), OK);
    EXPECT_STATUS(recording_read_place(r, &place), OK);
    recording_free(&r);
    const size_t bytes = (size_t)place.point_count * POINT_ERROR_BYTES;
    uint8_t *covariances = calloc(1, bytes);
    place.points[0].covariance[0] = INFINITY;
    put_point_error(covariances, &place.points[0]);
    place_free(&place);
    EXPECT_STATUS(database_open(&db, path, DATABASE_WRITE), OK);
    EXPECT_STATUS(statement_open(&s, db, "UPDATE point_error SET covariances = ?, crc = ?"), OK);
    statement_bind_blob(s, 1, covariances, bytes);
    statement_bind_number(s, 2, crc32_of(0, covariances, bytes));
    EXPECT_STATUS(statement_run(s), OK);
    statement_close(&s);
    database_close(&db);
    free(covariances);
}

// Those of the tags stay, and the points' directions.
static void test_points_covariances_cost_themselves_alone(void **state)
{
    (void)state;
    for (int i = 0; i < 2; i++) {
        const char *path = sample_recording();
        if (i)
            put_infinite_covariance(path);
        else
            run_sql(path, "UPDATE point_error SET crc = 0");
        struct recording_report verified;
        EXPECT_STATUS(recording_verify(path, &verified), ERR_CORRUPT);
        EXPECT_INT(verified.lost_map_covariances, true);
        const struct recording_report report = expect_repair(path, "covariances or viewing directions");
        EXPECT_INT(report.lost_place, false);
        EXPECT_INT(report.lost_map_covariances, true);
        struct place place = repaired_place();
        EXPECT_NEAR(place.points[3].covariance[0], 0, 0);
        EXPECT_NEAR(place.points[3].seen_from[0], 3e-3F, 0);
        EXPECT_NEAR(place.tags[2].covariance[0], 2e-6F, 0);
        place_free(&place);
    }
}

static void expect_repaired_things(int count, int images)
{
    struct recording *r;
    struct recorded_thing *things;
    int found, with_image = 0;
    EXPECT_STATUS(recording_open(&r, sample_path("repaired")), OK);
    EXPECT_STATUS(recording_read_things(r, &things, &found), OK);
    recording_free(&r);
    EXPECT_INT(found, count);
    for (int i = 0; i < found; i++)
        with_image += things[i].image.bytes != NULL;
    EXPECT_INT(with_image, images);
    recorded_things_free(&things, found);
}

static void test_a_thing_costs_itself_alone(void **state)
{
    (void)state;
    const char *path = sample_recording();
    run_sql(path, "UPDATE thing SET note = 'other' WHERE id = 0");
    struct recording_report report = expect_repair(path, "1 of the place's things");
    EXPECT_INT(report.lost_things, 1);
    expect_repaired_things(THINGS - 1, 2); // the pictures stay with theirs

    path = sample_recording();
    run_sql(path, "UPDATE thing_content SET bytes = x'00' WHERE thing = 2");
    report = expect_repair(path, "1 pictures or models");
    EXPECT_INT(report.lost_things, 1);
    expect_repaired_things(THINGS, 1);

    // Names that no thing can have, with the right checksum: another's, and none. The crc begins with the name.
    path = sample_recording();
    run_sql(path, "UPDATE thing SET name = (SELECT name FROM thing WHERE id = 1),"
                  " crc = (SELECT crc FROM thing WHERE id = 1) WHERE id = 2");
    report = expect_repair(path, "1 of the place's things");
    EXPECT_INT(report.lost_things, 2); // with its picture
    expect_repaired_things(THINGS - 1, 1);
}

// Of a stranger's recording, with the right checksums: what is read is shown on terminals and sent to servers.
static void test_texts_of_things_are_printable(void **state)
{
    (void)state;
    const char *path = sample_recording();
    struct recorded_thing thing = {.name = "\x1b[2Jlamp",
                                   .url = "http://a/\xff",
                                   .etag = "a\r\nCookie: b",
                                   .note = "höher \xc2\x9b",
                                   .world_from_thing = POSE_IDENTITY};
    struct recorded_thing *things;
    struct recording_report report;
    struct recording *r;
    int count;
    EXPECT_STATUS(recording_write_things(path, &thing, 1), OK);
    EXPECT_STATUS(recording_verify(path, &report), OK);
    EXPECT_STATUS(recording_open(&r, path), OK);
    EXPECT_STATUS(recording_read_things(r, &things, &count), OK);
    recording_free(&r);
    EXPECT_INT(count, 1);
    assert_string_equal(things[0].name, "?[2Jlamp");
    assert_string_equal(things[0].url, "http://a/?");
    assert_string_equal(things[0].etag, "a??Cookie: b");
    assert_string_equal(things[0].note, "höher ?");
    recorded_things_free(&things, count);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_a_view_costs_itself_alone),
        cmocka_unit_test(test_an_unreadable_place_is_said),
        cmocka_unit_test(test_points_covariances_cost_themselves_alone),
        cmocka_unit_test(test_a_thing_costs_itself_alone),
        cmocka_unit_test(test_texts_of_things_are_printable),
    };
    return cmocka_run_group_tests(tests, sample_folder_make, sample_folder_remove);
}
