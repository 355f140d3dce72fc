// Things in a recording: written, read, replaced; older files have none; damage is noticed.
#include "tests/support/test.h"

#include "platform/files/database.h"
#include "recording/recorded_things.h"
#include "tests/support/scratch.h"

#include <stdio.h>

static char path[256];

static struct recorded_thing thing(const char *name)
{
    struct recorded_thing t = {.world_from_thing = {{0, 0, 0, 1}, {1, 2, 3}},
                               .covariance = {1e-6, 0, 0, 2e-6, 0, 3e-6},
                               .width_m = 0.1,
                               .height_m = 0.2,
                               .sightings = 4};
    snprintf(t.name, sizeof t.name, "%s", name);
    snprintf(t.note, sizeof t.note, "keep \"dry\"");
    return t;
}

static int read_count(void)
{
    struct recording *r;
    struct recorded_thing *things;
    int count;
    EXPECT_STATUS(recording_open(&r, path), OK);
    EXPECT_STATUS(recording_read_things(r, &things, &count), OK);
    recorded_things_free(&things, count);
    recording_free(&r);
    return count;
}

static void test_things_are_kept(void **state)
{
    (void)state;
    struct scratch scratch = scratch_make();
    struct recording_writer *w;
    struct recorded_thing two[2] = {thing("mug"), thing("can")}, *back;
    struct recording *r;
    int count;
    snprintf(path, sizeof path, "%s", scratch_file(&scratch, "a.reenact"));
    EXPECT_STATUS(recording_create(&w, path), OK);
    EXPECT_STATUS(recording_close(&w), OK);
    EXPECT_INT(read_count(), 0);
    two[0].knowledge = (char *)(uintptr_t) "{\"@type\":\"Thing\"}";
    two[1].gone = true;
    EXPECT_STATUS(recording_write_things(path, two, 2), OK);
    EXPECT_STATUS(recording_open(&r, path), OK);
    EXPECT_STATUS(recording_read_things(r, &back, &count), OK);
    EXPECT_INT(count, 2);
    assert_string_equal(back[0].name, "mug");
    assert_string_equal(back[0].note, "keep \"dry\"");
    assert_string_equal(back[0].knowledge, "{\"@type\":\"Thing\"}");
    EXPECT_TRUE(!back[0].gone && back[1].gone && !back[1].knowledge);
    EXPECT_NEAR(back[1].world_from_thing.translation.z, 3, 0);
    EXPECT_NEAR(back[1].covariance.zz, 3e-6, 0);
    recorded_things_free(&back, count);
    recording_free(&r);
    // bad ones leave what was there
    two[1] = two[0];
    EXPECT_STATUS(recording_write_things(path, two, 2), ERR_INPUT);
    two[1] = thing("");
    EXPECT_STATUS(recording_write_things(path, two, 2), ERR_INPUT);
    two[1] = thing("x");
    two[1].width_m = NAN;
    EXPECT_STATUS(recording_write_things(path, two, 2), ERR_INPUT);
    EXPECT_INT(read_count(), 2);
    EXPECT_STATUS(recording_write_things(path, two, 1), OK);
    EXPECT_INT(read_count(), 1);
    scratch_remove(&scratch);
}

static void test_damage_is_noticed(void **state)
{
    (void)state;
    struct scratch scratch = scratch_make();
    struct recording_writer *w;
    struct recorded_thing one = thing("mug"), *back;
    struct recording *r;
    struct database *db;
    int count;
    snprintf(path, sizeof path, "%s", scratch_file(&scratch, "a.reenact"));
    EXPECT_STATUS(recording_create(&w, path), OK);
    EXPECT_STATUS(recording_close(&w), OK);
    EXPECT_STATUS(recording_write_things(path, &one, 1), OK);
    EXPECT_STATUS(database_open(&db, path, DATABASE_WRITE), OK);
    EXPECT_STATUS(database_run(db, "UPDATE thing SET note = 'other'"), OK);
    database_close(&db);
    EXPECT_STATUS(recording_open(&r, path), OK);
    EXPECT_STATUS(recording_read_things(r, &back, &count), ERR_CORRUPT);
    EXPECT_TRUE(back == NULL);
    recording_free(&r);
    scratch_remove(&scratch);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_things_are_kept),
        cmocka_unit_test(test_damage_is_noticed),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
