// What verify finds, what repair saves, and what one damaged row costs. Past versions of the file, which open for ever.
#include "base/clock.h"
#include "recording/recording_schema.h"
#include "tests/support/copy_file.h"
#include "tests/support/expect_repair.h"
#include "tests/support/recording_hash.h"
#include "tests/support/sql.h"

#define OLD SOURCE_DIR "/tests/recording/data/"
enum { OLD_FRAMES = 3, FLIP_STEP = SANITIZED ? 21 : 7 };

static const char *copy_of(const char *name)
{
    static char path[128];
    char from[512];
    snprintf(from, sizeof from, OLD "%s.reenact", name);
    snprintf(path, sizeof path, "%s", sample_path(name));
    copy_file(from, path);
    return path;
}

// ------------------------------------------------------------- past versions

static void test_past_versions_open(void **state)
{
    (void)state;
    static const char *const names[] = {"first", "point_side", "joint_error", "sealed", "two_states"};
    for (size_t i = 0; i < COUNT_OF(names); i++) {
        const char *path = copy_of(names[i]);
        struct recording_report report;
        struct recording *r;
        struct take *t;
        struct place place;
        EXPECT_STATUS(recording_verify(path, &report), OK);
        EXPECT_STATUS(recording_open(&r, path), OK);
        EXPECT_STATUS(recording_read_place(r, &place), OK);
        EXPECT_INT(place.tag_count, 1);
        EXPECT_INT(place.view_count, 1);
        place_free(&place);
        EXPECT_STATUS(take_open(&t, r, "one"), OK);
        EXPECT_INT(take_frame_count(t), OLD_FRAMES);
        EXPECT_NEAR(take_entry(t, 2)->skeleton.joint[1].x, 0.1, 0);
        EXPECT_INT(isfinite(joint_sigma_m(&take_entry(t, 0)->skeleton, JOINT_HEAD)), i >= 2);
        take_close(&t);
        recording_free(&r);
        // It can be added to, and stays readable.
        const struct calibration calibration = sample_calibration();
        struct recording_writer *w;
        EXPECT_STATUS(recording_append(&w, path), OK);
        EXPECT_STATUS(recording_begin_take(w, "added", &calibration), OK);
        sample_frames_add(w, 0, 4);
        EXPECT_STATUS(recording_end_take(w), OK);
        EXPECT_STATUS(recording_close(&w), OK);
        const int64_t frames = report.frames;
        EXPECT_STATUS(recording_verify(path, &report), OK);
        EXPECT_INT(report.frames, frames + 4);
    }
}

// ------------------------------------------------------------- damaged bits

// One bit of every FLIP_STEPth byte: what verify calls sound holds what it held.
static void test_no_flipped_bit_loses_anything_unsaid(void **state)
{
    (void)state;
    static const char *const names[] = {"first", "sealed"};
    const unsigned bit = (unsigned)SAMPLE_SEED % 8;
    for (size_t n = 0; n < COUNT_OF(names); n++) {
        char path[128];
        uint8_t *bytes;
        size_t count;
        int found = 0, unsaid = 0;
        snprintf(path, sizeof path, "%s", copy_of(names[n]));
        EXPECT_STATUS(file_read(path, &bytes, &count), OK);
        const uint64_t hash = hash_of(path);
        for (size_t i = n; i < count; i += FLIP_STEP) {
            struct recording_report report;
            const uint8_t mask = (uint8_t)(1u << ((bit + i) % 8));
            bytes[i] ^= mask;
            unlink(path);
            EXPECT_STATUS(file_write_unsynced(path, bytes, count), OK);
            bytes[i] ^= mask;
            if (recording_verify(path, &report) != OK)
                found++;
            else if (hash_of(path) != hash && ++unsaid)
                print_error("%s: byte %zu, bit %u\n", names[n], i, (bit + (unsigned)i) % 8);
        }
        print_message("%s: %d of %zu flipped bits found\n", names[n], found, count / FLIP_STEP);
        EXPECT_INT(unsaid, 0);
        free(bytes);
    }
}

static void test_damaged_ids_are_found_and_put_right(void **state)
{
    (void)state;
    static const struct {
        const char *sql, *words;
    } damage[] = {
        {"UPDATE take SET id = 33", "belong to no take"},
        {"UPDATE frame SET id = id + 1 WHERE id % 4294967296 = 2", "damaged or missing"},
        {"UPDATE frame SET id = id + (1 << 40) WHERE id % 4294967296 = 0", "belong to no take"},
        {"UPDATE picture SET id = id | 128 WHERE id % 4294967296 = 1", "belong to no frame"},
    };
    static const char *const names[] = {"joint_error", "sealed"};
    for (size_t n = 0; n < COUNT_OF(names); n++)
        for (size_t i = 0; i < COUNT_OF(damage); i++) {
            const char *path = copy_of(names[n]);
            const uint64_t hash = hash_of(path);
            run_sql(path, damage[i].sql);
            print_message("%s: %s\n", names[n], damage[i].sql);
            EXPECT_INT(expect_repair(path, damage[i].words).frames, OLD_FRAMES);
            EXPECT_TRUE(hash_of(sample_path("repaired")) == hash);
        }
}

// Gives the last frame that time, with the right checksum.
static void put_last_time(const char *path, int64_t time_ns)
{
    struct database *db;
    struct statement *s;
    uint8_t pose[POSE_BYTES];
    put_pose(pose, &POSE_IDENTITY);
    EXPECT_STATUS(database_open(&db, path, DATABASE_WRITE), OK);
    EXPECT_STATUS(select_open(&s, db, TABLE_FRAME, "ORDER BY rowid DESC LIMIT 1"), OK);
    EXPECT_STATUS(statement_step(s), OK);
    const int64_t key = statement_number(s, 0), images = statement_number(s, 5);
    statement_close(&s);
    const uint32_t crc = frame_crc(time_ns, false, pose, NULL, 0, (unsigned)images);
    EXPECT_STATUS(insert_open(&s, db, TABLE_FRAME, true), OK);
    statement_bind_number(s, 1, key);
    statement_bind_number(s, 2, time_ns);
    statement_bind_number(s, 3, 0);
    statement_bind_blob(s, 4, pose, sizeof pose);
    statement_bind_number(s, 6, images);
    statement_bind_number(s, 7, crc);
    statement_bind_number(s, FRAME_SEAL + 1, row_seal(key, crc));
    EXPECT_STATUS(statement_run(s), OK);
    statement_close(&s);
    database_close(&db);
}

// A writer's bug: a time from which the time to another frame would not be a number. It is the frame that is lost.
static void test_a_time_of_no_clock_costs_its_frame_alone(void **state)
{
    (void)state;
    static const struct {
        int64_t time_ns;
        int kept;
    } times[] = {{INT64_MAX, 2}, {TAKE_TIME_MAX_NS + 1, 2}, {TAKE_TIME_MAX_NS, 3}};
    for (size_t i = 0; i < COUNT_OF(times); i++) {
        struct recording_report report;
        const char *path = copy_of("sealed");
        put_last_time(path, times[i].time_ns);
        if (times[i].kept == OLD_FRAMES) {
            EXPECT_STATUS(recording_verify(path, &report), OK);
            continue;
        }
        EXPECT_INT(expect_repair(path, "1 frames of take 'one'").frames, times[i].kept);
    }
    const struct calibration calibration = sample_calibration();
    struct recording_writer *w;
    struct take_frame frame = {.world_from_camera = POSE_IDENTITY, .time_ns = -TAKE_TIME_MAX_NS - 1};
    EXPECT_STATUS(recording_create(&w, sample_path("times")), OK);
    EXPECT_STATUS(recording_begin_take(w, "a", &calibration), OK);
    EXPECT_STATUS(recording_add_frame(w, &frame), ERR_INPUT);
    frame.time_ns++;
    EXPECT_STATUS(recording_add_frame(w, &frame), OK);
    frame.time_ns = TAKE_TIME_MAX_NS + 1;
    EXPECT_STATUS(recording_add_frame(w, &frame), ERR_INPUT);
    EXPECT_STATUS(recording_close(&w), OK);
}

static void test_missing_rows_are_found(void **state)
{
    (void)state;
    static const struct {
        const char *sql, *words;
        int kept;
    } damage[] = {
        {"DELETE FROM frame WHERE id % 4294967296 = 1", "1 frames of take 'one'", 2},
        {"DELETE FROM frame WHERE id % 4294967296 = 2", "1 frames of take 'one'", 2}, // the last one
        {"DELETE FROM picture WHERE id % 4294967296 = 1", "frame 1 is damaged", 3},
        {"DELETE FROM take", "belong to no take", 3},
        {"DELETE FROM place_view", "1 of 1 views", 3},
        {"UPDATE take SET crc = crc + 1", "a take cannot be read", 3},
        {"UPDATE take SET name = ''", "a take cannot be read", 3},
    };
    for (size_t i = 0; i < COUNT_OF(damage); i++) {
        const char *path = copy_of("sealed");
        print_message("%s\n", damage[i].sql);
        run_sql(path, damage[i].sql);
        EXPECT_INT(expect_repair(path, damage[i].words).frames, damage[i].kept);
    }
}

// What was repaired says so itself.
static void test_repaired_take_tells_the_truth(void **state)
{
    (void)state;
    const char *path = copy_of("sealed");
    run_sql(path,
            "DELETE FROM frame WHERE id % 4294967296 = 1; UPDATE picture SET depth = x'00' WHERE id % 4294967296 = 2");
    EXPECT_INT(expect_repair(path, "damaged or missing").frames, 2);
    struct recording *r;
    struct take *t;
    EXPECT_STATUS(recording_open(&r, sample_path("repaired")), OK);
    EXPECT_STATUS(take_open(&t, r, "one"), OK);
    EXPECT_TRUE(!take_is_complete(t));
    EXPECT_INT(take_lost(t), 1);
    EXPECT_TRUE(take_entry(t, 0)->has_depth && !take_entry(t, 1)->has_depth && take_entry(t, 1)->has_color);
    take_close(&t);
    recording_free(&r);
}

// One damaged frame or view costs itself alone: the rest of the take and of the place is there.
static void test_damage_costs_itself_alone(void **state)
{
    (void)state;
    const char *path = sample_path("costs");
    sample_recording_write(path);
    path = sample_path("costs");
    run_sql(path,
            "UPDATE frame SET time_ns = time_ns + 1 WHERE id % 4294967296 = 5;"
            "UPDATE picture SET color = x'00' WHERE id % 4294967296 = 8; UPDATE place_view SET crc = 1 WHERE id = 1");
    struct recording *r;
    struct take *t;
    struct place place;
    struct take_images images;
    EXPECT_STATUS(recording_open(&r, path), OK);
    EXPECT_STATUS(recording_read_place(r, &place), OK);
    EXPECT_INT(place.view_count, 2);
    EXPECT_INT(place.views_lost, 1);
    place_free(&place);
    EXPECT_STATUS(take_open(&t, r, "höher"), OK);
    EXPECT_INT(take_frame_count(t), FRAMES - 1);
    EXPECT_INT(take_lost(t), 1);
    int damaged = 0;
    for (int64_t i = 0; i < take_frame_count(t); i++)
        damaged += take_read(t, i, TAKE_COLOR | TAKE_DEPTH | TAKE_MASK, &images) != OK;
    EXPECT_INT(damaged, 1);
    take_close(&t);
    recording_free(&r);
}

// ------------------------------------------------------------- files made to harm

// A bit in a name makes two takes of one name: the repaired file has two.
static void test_two_takes_of_one_name(void **state)
{
    (void)state;
    const char *path = sample_path("two");
    const struct calibration calibration = sample_calibration();
    struct recording_writer *w;
    unlink(path);
    EXPECT_STATUS(recording_create(&w, path), OK);
    for (int i = 0; i < 2; i++) {
        EXPECT_STATUS(recording_begin_take(w, i ? "kata3" : "kata2", &calibration), OK);
        sample_frames_add(w, 0, 2 + i);
        EXPECT_STATUS(recording_end_take(w), OK);
    }
    EXPECT_STATUS(recording_close(&w), OK);
    path = sample_path("two");
    run_sql(path, "UPDATE take SET name = 'kata2'");
    EXPECT_INT(expect_repair(path, "two takes 'kata2'").frames, 5);
    struct recording *r;
    struct take *t;
    EXPECT_STATUS(recording_open(&r, sample_path("repaired")), OK);
    EXPECT_INT(recording_take_count(r), 2);
    EXPECT_STATUS(take_open(&t, r, "kata2 (2)"), OK);
    EXPECT_INT(take_frame_count(t), 3);
    take_close(&t);
    recording_free(&r);
}

// A row with a damaged id that was another's, beside that other's own: one of them is lost, and nothing else.
static void test_two_rows_of_one_take(void **state)
{
    (void)state;
    struct database *db;
    struct statement *s;
    uint8_t calibration[CALIBRATION_BYTES], body[BODY_BYTES];
    char path[128];
    snprintf(path, sizeof path, "%s", sample_path("two rows"));
    recording_remove_files(path);
    sample_recording_write(path);
    const struct take_row row = {
        .id = 2, .name = "impostor", .calibration = sample_calibration(), .body = sample_body, .frames = 3};
    EXPECT_STATUS(database_open(&db, path, DATABASE_WRITE), OK);
    EXPECT_STATUS(insert_open(&s, db, TABLE_TAKE, true), OK);
    take_bind(s, &row, calibration, body);
    statement_bind_number(s, 1, 0); // stored under another id, one bit from its own
    EXPECT_STATUS(statement_run(s), OK);
    statement_close(&s);
    database_close(&db);
    const struct recording_report report = expect_repair(path, "a take cannot be read");
    EXPECT_INT(report.lost_takes, 1);
    EXPECT_INT(report.takes, 2);
}

static void test_impossible_numbers(void **state)
{
    (void)state;
    struct recording_report report;
    struct recording *r;
    struct take *t;
    const char *path = copy_of("first");
    run_sql(path, "UPDATE take SET id = 2147483648; UPDATE frame SET id = (id & 4294967295) + (2147483648 << 32)");
    EXPECT_STATUS(recording_verify(path, &report), ERR_CORRUPT);
    EXPECT_STATUS(recording_open(&r, path), OK);
    EXPECT_STATUS(take_open(&t, r, "one"), ERR_CORRUPT);
    recording_free(&r);

    struct database *db;
    struct statement *s;
    uint8_t calibration[CALIBRATION_BYTES], body[BODY_BYTES];
    struct take_row row = {.id = 1, .name = "one", .complete = true, .calibration = sample_calibration()};
    row.body.representative_frame = INT64_MAX - 1;
    row.calibration.color = row.calibration.depth = (struct lens){16, 12, 14, 14, 7.5, 5.5, 0, 0, 0, 0, 0, 0, 0};
    path = copy_of("sealed");
    EXPECT_STATUS(database_open(&db, path, DATABASE_WRITE), OK);
    EXPECT_STATUS(insert_open(&s, db, TABLE_TAKE, true), OK);
    row.frames = OLD_FRAMES;
    take_bind(s, &row, calibration, body);
    EXPECT_STATUS(statement_run(s), OK);
    statement_close(&s);
    database_close(&db);
    EXPECT_STATUS(recording_open(&r, path), OK);
    EXPECT_STATUS(take_open(&t, r, "one"), OK);
    print_message("representative frame %d of %d\n", (int)take_body(t)->representative_frame, (int)take_frame_count(t));
    EXPECT_TRUE(take_body(t)->representative_frame < take_frame_count(t));
    take_close(&t);
    recording_free(&r);
    EXPECT_STATUS(recording_repair(path, sample_path("needless"), &report), NOTHING);

    // A picture's size from the file alone: memory is bounded whatever it says.
    row.calibration.depth.width = row.calibration.depth.height = 16384;
    EXPECT_STATUS(calibration_check(&row.calibration), ERR_INPUT);
    EXPECT_SAYS("16384 x 16384");
}

// The checksum is right, but there is no picture in the code: a writer's bug, or an attack.
static void test_code_that_does_not_decode(void **state)
{
    (void)state;
    const char *path = copy_of("first");
    struct database *db;
    struct statement *s;
    const uint8_t code[] = {1, 16, 0, 12, 0, 9, 9, 9};
    EXPECT_STATUS(database_open(&db, path, DATABASE_WRITE), OK);
    EXPECT_STATUS(statement_open(&s, db, "UPDATE picture SET depth = ?, depth_crc = ? WHERE id % 4294967296 = 1"), OK);
    statement_bind_blob(s, 1, code, sizeof code);
    statement_bind_number(s, 2, crc32_of(0, code, sizeof code));
    EXPECT_STATUS(statement_run(s), OK);
    statement_close(&s);
    database_close(&db);
    EXPECT_INT(expect_repair(path, "frame 1 is damaged").frames, OLD_FRAMES);
}

// Two columns of picture claim 900 MB each; repair once looked for the pictures of 63 numbers a frame by reading them.
static void test_computed_columns_are_refused(void **state)
{
    (void)state;
    char path[128];
    snprintf(path, sizeof path, "%s", copy_of("computed"));
    struct recording_report report;
    const int64_t begun_ns = clock_now_ns();
    EXPECT_STATUS(recording_verify(path, &report), ERR_CORRUPT);
    EXPECT_TRUE(strstr(status_message(), "computed"));
    EXPECT_STATUS(recording_repair(path, sample_path("not repaired"), &report), ERR_CORRUPT);
    EXPECT_AT_MOST((double)(clock_now_ns() - begun_ns) * 1e-9, 1); // 19 where they are computed
}

static void test_names_that_a_terminal_would_obey(void **state)
{
    (void)state;
    const char *path = copy_of("first");
    struct recording *r;
    run_sql(path, "UPDATE take SET name = char(27) || '[31mred'");
    EXPECT_STATUS(recording_open(&r, path), OK);
    assert_string_equal(recording_take_name(r, 0), "?[31mred");
    struct take *t;
    EXPECT_STATUS(take_open(&t, r, "\x1b[2J"), ERR_MISSING);
    EXPECT_TRUE(!strchr(status_message(), 27));
    recording_free(&r);
}

int main(void)
{
    printf("seed %d\n", SAMPLE_SEED);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_past_versions_open),
        cmocka_unit_test(test_no_flipped_bit_loses_anything_unsaid),
        cmocka_unit_test(test_damaged_ids_are_found_and_put_right),
        cmocka_unit_test(test_a_time_of_no_clock_costs_its_frame_alone),
        cmocka_unit_test(test_missing_rows_are_found),
        cmocka_unit_test(test_repaired_take_tells_the_truth),
        cmocka_unit_test(test_damage_costs_itself_alone),
        cmocka_unit_test(test_two_takes_of_one_name),
        cmocka_unit_test(test_two_rows_of_one_take),
        cmocka_unit_test(test_impossible_numbers),
        cmocka_unit_test(test_code_that_does_not_decode),
        cmocka_unit_test(test_computed_columns_are_refused),
        cmocka_unit_test(test_names_that_a_terminal_would_obey),
    };
    return cmocka_run_group_tests(tests, sample_folder_make, sample_folder_remove);
}
