// Takes are renamed, annotated, deleted, trimmed and copied.
#include "recording/place.h"
#include "recording/prepared.h"
#include "recording/recorded_things.h"
#include "recording/recording_reader.h"
#include "tests/support/random.h"
#include "tests/support/recording_hash.h"
#include "tests/support/recording_sample.h"
#include "tests/support/single_file.h"
#include "tests/support/sql.h"

static struct recording *recording;
static struct take *take;

static void open_take(const char *path, const char *name)
{
    EXPECT_STATUS(recording_open(&recording, path), OK);
    EXPECT_STATUS(take_open(&take, recording, name), OK);
}

static void close_take(void)
{
    take_close(&take);
    recording_free(&recording);
}

static void expect_sound(const char *path, int takes, int64_t frames)
{
    struct recording_report report;
    EXPECT_STATUS(recording_verify(path, &report), OK);
    EXPECT_INT(report.takes, takes);
    EXPECT_INT(report.frames, frames);
}

static const char *fresh(const char *name)
{
    unlink(sample_path(name));
    sample_recording_write(sample_path(name));
    return sample_path(name);
}

// How often the JPEG of sample frame `index` lies in the file.
static int jpegs_in(const char *path, int index)
{
    static struct sample_frame m;
    uint8_t *bytes, *at;
    size_t count;
    int found = 0;
    sample_frame_make(&m, index);
    EXPECT_STATUS(file_read(path, &bytes, &count), OK);
    // 200 bytes: what of it lies in one page, whatever the pages' borders
    for (at = bytes; (at = memmem(at, count - (size_t)(at - bytes), m.jpeg + 700, 200)); at++)
        found++;
    free(bytes);
    free(m.jpeg);
    return found;
}

enum { KEPT_BYTES = 30000, SEED = 20261125 };

// What a program keeps beside a take: numbers that do not compress.
static void make_kept(uint8_t kept[KEPT_BYTES])
{
    struct rng rng = {SEED};
    for (int i = 0; i < KEPT_BYTES; i++)
        kept[i] = (uint8_t)(256 * rng_uniform(&rng));
}

static void keep_beside(const char *path, const char *name)
{
    uint8_t kept[KEPT_BYTES];
    make_kept(kept);
    open_take(path, name);
    EXPECT_STATUS(prepared_write(path, take, PREPARED_AVATAR, 1, kept, sizeof kept), OK);
    close_take();
}

static bool is_kept(const char *path)
{
    uint8_t kept[KEPT_BYTES], *bytes;
    size_t count;
    make_kept(kept);
    EXPECT_STATUS(file_read(path, &bytes, &count), OK);
    const bool found = memmem(bytes, count, kept + 1000, 200);
    free(bytes);
    return found;
}

static void test_rename_and_notes(void **state)
{
    (void)state;
    char path[128];
    snprintf(path, sizeof path, "%s", fresh("rename"));
    EXPECT_STATUS(recording_rename_take(path, "nope", "x"), ERR_MISSING);
    EXPECT_STATUS(recording_rename_take(path, "höher", "second"), ERR_EXISTS);
    EXPECT_STATUS(recording_rename_take(path, "höher", "a\nb"), ERR_INPUT);
    EXPECT_STATUS(recording_rename_take(path, "höher", "high"), OK);
    EXPECT_STATUS(recording_annotate_take(path, "high", "left knee bandaged", "dancer 7"), OK);
    EXPECT_STATUS(recording_annotate_take(path, "high", NULL, "dancer 8"), OK);
    EXPECT_STATUS(recording_annotate_take(path, "high", "\x1b[2J", NULL), ERR_INPUT);
    open_take(path, "high");
    assert_string_equal(take_note(take), "left knee bandaged");
    assert_string_equal(take_alias(take), "dancer 8");
    EXPECT_INT(take_body(take)->representative_frame, 17);
    EXPECT_TRUE(take_is_complete(take));
    close_take();
    expect_sound(path, 2, FRAMES + 3);
}

// A name from outside that a terminal must not be given: it is shown with '?', and found by what is shown.
static void test_a_name_that_is_not_shown(void **state)
{
    (void)state;
    static const char *const names[] = {"a\u202eb", "a\u2028b",
                                        "a\x1b"
                                        "b",
                                        "a\xff"
                                        "b"};
    char path[128], sql[200];
    int64_t freed;
    for (size_t i = 0; i < COUNT_OF(names); i++) {
        snprintf(path, sizeof path, "%s", fresh("hidden"));
        EXPECT_STATUS(recording_rename_take(path, "second", names[i]), ERR_INPUT);
        snprintf(sql, sizeof sql, "UPDATE take SET name = CAST(x'");
        for (const char *at = names[i]; *at; at++)
            snprintf(sql + strlen(sql), sizeof sql - strlen(sql), "%02x", (unsigned)(uint8_t)*at);
        snprintf(sql + strlen(sql), sizeof sql - strlen(sql), "' AS TEXT) WHERE id = 2");
        run_sql(path, sql);
        EXPECT_STATUS(recording_open(&recording, path), OK);
        assert_string_equal(recording_take_name(recording, 1), "a?b");
        recording_free(&recording);
        EXPECT_STATUS(recording_rename_take(path, "a?b", "third"), ERR_CORRUPT); // its checksum is of another name
        EXPECT_STATUS(recording_delete_take(path, "nobody", &freed), ERR_MISSING);
    }
}

static void add_take(const char *path, const char *name, int frames)
{
    const struct calibration calibration = sample_calibration();
    struct recording_writer *w;
    EXPECT_STATUS(recording_append(&w, path), OK);
    EXPECT_STATUS(recording_begin_take(w, name, &calibration), OK);
    sample_frames_add(w, 0, frames);
    EXPECT_STATUS(recording_end_take(w), OK);
    EXPECT_STATUS(recording_close(&w), OK);
}

static void test_delete_overwrites(void **state)
{
    (void)state;
    char path[128];
    int64_t freed;
    snprintf(path, sizeof path, "%s", fresh("delete"));
    EXPECT_AT_LEAST(jpegs_in(path, 11), 1);
    EXPECT_AT_LEAST(jpegs_in(path, 1), 2); // in both takes
    keep_beside(path, "höher");
    EXPECT_TRUE(is_kept(path));
    EXPECT_STATUS(recording_delete_take(path, "höher", &freed), OK);
    EXPECT_AT_LEAST((double)freed, 65536);
    EXPECT_INT(jpegs_in(path, 11), 0);
    EXPECT_INT(jpegs_in(path, 1), 1); // of the other take
    EXPECT_TRUE(!is_kept(path));
    EXPECT_TRUE(!file_exists(sample_path("delete-wal")) && !file_exists(sample_path("delete-journal")));
    expect_sound(path, 1, 3);
    EXPECT_STATUS(recording_delete_take(path, "höher", &freed), ERR_MISSING);
    // Its name and place are free again.
    add_take(path, "höher", 2);
    expect_sound(path, 2, 5);
}

// The bytes are gone all the same; the space is the next take's, and is given back once it is most of the file.
static void test_delete_for_somebody_who_waits(void **state)
{
    (void)state;
    char path[128];
    snprintf(path, sizeof path, "%s", fresh("hurried"));
    add_take(path, "long", 300);
    const int64_t before = recording_bytes(path);
    EXPECT_INT(jpegs_in(path, 11), 2);
    EXPECT_STATUS(recording_delete_take(path, "höher", NULL), OK);
    EXPECT_INT(recording_bytes(path), before);
    EXPECT_INT(jpegs_in(path, 11), 1);
    expect_sound(path, 2, 300 + 3);
    add_take(path, "next", 20);
    EXPECT_INT(recording_bytes(path), before);
    EXPECT_STATUS(recording_trim_take(path, "long", 500000000, INT64_MAX, NULL), OK);
    EXPECT_INT(recording_bytes(path), before);
    EXPECT_STATUS(recording_delete_take(path, "long", NULL), OK);
    EXPECT_AT_MOST((double)recording_bytes(path), (double)before / 2);
    EXPECT_TRUE(database_is_single_file(path));
}

static void test_trim(void **state)
{
    (void)state;
    enum { FROM = 10, TO = 29 };
    char path[128];
    int64_t freed, times[TO - FROM + 1];
    snprintf(path, sizeof path, "%s", fresh("trim"));
    open_take(path, "höher");
    const int64_t first_ns = take_entry(take, 0)->time_ns, last_ns = take_entry(take, FRAMES - 1)->time_ns;
    for (int i = FROM; i <= TO; i++)
        times[i - FROM] = take_entry(take, i)->time_ns;
    close_take();
    char ends[80];
    snprintf(ends, sizeof ends, "take 'höher' ends at %.3f s, before 90.000 s",
             (double)((last_ns - first_ns) / 1000000) / 1e3);
    const struct {
        int64_t from_ns, to_ns;
        const char *says;
    } empty[] = {{INT64_C(90000000000), INT64_MAX, ends},
                 {1, 2, "no frame of take 'höher' lies between 0.000 s and 0.000 s"}};
    for (size_t i = 0; i < COUNT_OF(empty); i++) {
        EXPECT_STATUS(recording_trim_take(path, "höher", empty[i].from_ns, empty[i].to_ns, &freed), ERR_INPUT);
        EXPECT_SAYS(empty[i].says);
    }
    EXPECT_STATUS(recording_trim_take(path, "höher", times[0] - first_ns, times[TO - FROM] - first_ns, &freed), OK);
    print_message("%.0f KB were freed\n", (double)freed / 1e3);
    expect_sound(path, 2, TO - FROM + 1 + 3);
    open_take(path, "höher");
    EXPECT_INT(take_frame_count(take), TO - FROM + 1);
    EXPECT_INT(take_body(take)->representative_frame, 17 - FROM);
    EXPECT_INT(take_lost(take), 0);
    for (int i = 0; i <= TO - FROM; i++) {
        static struct sample_frame m;
        struct take_images images;
        sample_frame_make(&m, FROM + i);
        EXPECT_INT(take_entry(take, i)->time_ns, times[i]);
        EXPECT_STATUS(take_read(take, i, TAKE_DEPTH, &images), OK);
        EXPECT_TRUE(!m.frame.depth || !memcmp(images.depth, m.depth, sizeof m.depth));
        if (m.frame.has_skeleton)
            EXPECT_TRUE(!memcmp(take_entry(take, i)->skeleton.covariance, m.frame.skeleton.covariance,
                                sizeof m.frame.skeleton.covariance));
        free(m.jpeg);
    }
    close_take();
    EXPECT_INT(jpegs_in(path, 35), 0);
    EXPECT_INT(jpegs_in(path, 8), 0);
    EXPECT_INT(jpegs_in(path, 12), 1);
}

// Of the frames there are, the one that shows the body best: the earliest of the equal ones.
static int best_pose(void)
{
    int best = -1;
    for (int i = 0; i < take_frame_count(take); i++) {
        const struct take_entry *e = take_entry(take, i);
        if (e->has_skeleton && e->has_depth &&
            (best < 0 || pose_score(&e->skeleton) > pose_score(&take_entry(take, best)->skeleton)))
            best = i;
    }
    return best;
}

// Where the representative frame is trimmed off, or damaged, another one takes its place: the person is still shown.
// While one program watches a take, another changes the file: other takes, names and notes do not matter; of a take
// that is trimmed or deleted no other frames are shown for those that were there.
static void test_a_take_changed_while_it_is_open(void **state)
{
    (void)state;
    char path[128];
    struct take_images images;
    struct take *other;
    const uint8_t *jpeg;
    size_t count;
    int64_t freed;
    snprintf(path, sizeof path, "%s", fresh("changed"));
    open_take(path, "höher");
    EXPECT_STATUS(take_open(&other, recording, "second"), OK);
    EXPECT_STATUS(take_read(take, 5, TAKE_COLOR, &images), OK);
    EXPECT_STATUS(recording_rename_take(path, "höher", "high"), OK);
    add_take(path, "third", 4);
    EXPECT_STATUS(take_read(take, FRAMES - 1, TAKE_COLOR, &images), OK);
    EXPECT_STATUS(recording_trim_take(path, "high", 0, 500000000, &freed), OK);
    EXPECT_STATUS(take_read(take, 5, TAKE_COLOR, &images), ERR_IO);
    EXPECT_SAYS("changed by another program");
    EXPECT_TRUE(!images.color);
    EXPECT_STATUS(take_read_jpeg(take, 5, &jpeg, &count), ERR_IO);
    EXPECT_STATUS(take_read(other, 0, TAKE_COLOR, &images), OK);
    take_close(&other);
    close_take();
    open_take(path, "high"); // its first frames are gone now
    EXPECT_STATUS(take_read(take, 5, TAKE_COLOR, &images), OK);
    EXPECT_STATUS(recording_trim_take(path, "high", 100000000, INT64_MAX, NULL), OK);
    EXPECT_STATUS(take_read(take, 5, TAKE_COLOR, &images), ERR_IO);
    close_take();
    open_take(path, "high");
    EXPECT_STATUS(recording_delete_take(path, "high", &freed), OK);
    add_take(path, "high", 20);
    EXPECT_STATUS(take_read(take, 0, TAKE_COLOR, &images), ERR_IO);
    close_take();
}

static void test_another_frame_is_representative(void **state)
{
    (void)state;
    char path[128];
    int64_t freed;
    snprintf(path, sizeof path, "%s", fresh("trimmed"));
    open_take(path, "höher");
    const int64_t to_ns = take_entry(take, 12)->time_ns - take_entry(take, 0)->time_ns;
    close_take();
    EXPECT_STATUS(recording_trim_take(path, "höher", 0, to_ns, &freed), OK);
    open_take(path, "höher");
    EXPECT_INT(take_frame_count(take), 13);
    EXPECT_AT_LEAST(take_body(take)->representative_frame, 0);
    EXPECT_INT(take_body(take)->representative_frame, best_pose());
    EXPECT_NEAR(take_body(take)->radius_rate[1], sample_body.radius_rate[1], 0);
    close_take();

    snprintf(path, sizeof path, "%s", fresh("damaged"));
    run_sql(path, "UPDATE frame SET skeleton = zeroblob(3) WHERE id = (1 << 32) + 17");
    open_take(path, "höher");
    EXPECT_INT(take_frame_count(take), FRAMES - 1);
    EXPECT_AT_LEAST(take_body(take)->representative_frame, 0);
    EXPECT_INT(take_body(take)->representative_frame, best_pose());
    close_take();
    open_take(path, "second"); // no person was tracked in it
    EXPECT_INT(take_body(take)->representative_frame, -1);
    close_take();
}

static void test_copy(void **state)
{
    (void)state;
    char path[128], other[128];
    struct take_copy_report report;
    snprintf(path, sizeof path, "%s", fresh("copy"));
    snprintf(other, sizeof other, "%s", sample_path("copy-new"));
    const struct recorded_thing thing = {.name = "mug", .world_from_thing = POSE_IDENTITY};
    const struct recorded_drive drive = {.world_from_body = POSE_IDENTITY, .path_count = 2};
    EXPECT_STATUS(recording_write_things(path, &thing, 1), OK);
    EXPECT_STATUS(recording_write_drive(path, &drive), OK);
    EXPECT_STATUS(recording_copy_take(path, "höher", path, "again", &report), OK);
    EXPECT_TRUE(!report.place_differs);
    expect_sound(path, 3, 2 * FRAMES + 3);
    EXPECT_STATUS(recording_copy_take(path, "höher", path, "again", &report), ERR_EXISTS);
    EXPECT_STATUS(recording_copy_take(path, "nope", other, "x", &report), ERR_MISSING);
    EXPECT_TRUE(!file_exists(other));
    EXPECT_STATUS(recording_copy_take(path, "höher", other, "höher", &report), OK); // made, with the place
    expect_sound(other, 1, FRAMES);
    open_take(other, "höher");
    struct place place;
    EXPECT_STATUS(recording_read_place(recording, &place), OK);
    EXPECT_INT(place.view_count, 3);
    place_free(&place);
    struct recorded_thing *things;
    struct recorded_drive driven;
    int count;
    EXPECT_STATUS(recording_read_things(recording, &things, &count), OK);
    EXPECT_INT(count, 1);
    recorded_things_free(&things, count);
    EXPECT_STATUS(recording_read_drive(recording, &driven), OK);
    EXPECT_INT(driven.path_count, 2);
    EXPECT_TRUE(take_entry(take, 3)->located && take_is_complete(take));
    EXPECT_INT(take_body(take)->representative_frame, 17);
    close_take();

    char elsewhere[128]; // with another place
    snprintf(elsewhere, sizeof elsewhere, "%s", sample_path("elsewhere"));
    struct rng rng = {7};
    struct place another = sample_place(&rng);
    struct recording_writer *w;
    EXPECT_STATUS(recording_create(&w, elsewhere), OK);
    EXPECT_STATUS(recording_put_place(w, &another), OK);
    EXPECT_STATUS(recording_close(&w), OK);
    place_free(&another);
    EXPECT_STATUS(recording_copy_take(path, "höher", elsewhere, "höher", &report), OK);
    EXPECT_TRUE(report.place_differs);
    open_take(elsewhere, "höher");
    EXPECT_TRUE(!take_entry(take, 3)->located);
    close_take();
}

// What is damaged is left out, into a new file as into an old one, and each of it is counted.
static void test_copy_says_what_damage_cost(void **state)
{
    (void)state;
    char path[128], other[128];
    snprintf(path, sizeof path, "%s", fresh("copy-damaged"));
    snprintf(other, sizeof other, "%s", sample_path("copy-of-damaged"));
    const struct recorded_thing things[2] = {{.name = "mug", .world_from_thing = POSE_IDENTITY},
                                             {.name = "book", .world_from_thing = POSE_IDENTITY}};
    EXPECT_STATUS(recording_write_things(path, things, 2), OK);
    run_sql(path, "DELETE FROM frame WHERE id % 4294967296 IN (10, 11);"
                  "UPDATE picture SET color = x'00' WHERE id % 4294967296 = 8;"
                  "UPDATE joint_error SET crc = crc + 1 WHERE id % 4294967296 IN (1, 5, 6);"
                  "UPDATE place_view SET crc = 1 WHERE id = 1;"
                  "UPDATE point_error SET crc = 0; UPDATE thing SET note = 'other' WHERE id = 0");
    for (int i = 0; i < 2; i++) { // `other` is made, then added to
        struct take_copy_report report;
        EXPECT_STATUS(recording_copy_take(path, "höher", other, i ? "again" : "höher", &report), OK);
        EXPECT_INT(report.place_differs, false);
        EXPECT_INT(report.lost_frames, 2);
        EXPECT_INT(report.damaged_frames, 1);
        EXPECT_INT(report.lost_covariances, 3);
        EXPECT_INT(report.lost_views, i ? 0 : 1);
        EXPECT_INT(report.lost_map_covariances, !i);
        EXPECT_INT(report.lost_things, i ? 0 : 1);
        expect_sound(other, i + 1, (i + 1) * (FRAMES - 2));
    }
    open_take(other, "höher");
    EXPECT_TRUE(!take_is_complete(take));
    EXPECT_TRUE(take_entry(take, 3)->located);
    close_take();
}

int main(void)
{
    printf("seed %d\n", SAMPLE_SEED);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_rename_and_notes),
        cmocka_unit_test(test_a_name_that_is_not_shown),
        cmocka_unit_test(test_delete_overwrites),
        cmocka_unit_test(test_delete_for_somebody_who_waits),
        cmocka_unit_test(test_trim),
        cmocka_unit_test(test_a_take_changed_while_it_is_open),
        cmocka_unit_test(test_another_frame_is_representative),
        cmocka_unit_test(test_copy),
        cmocka_unit_test(test_copy_says_what_damage_cost),
    };
    return cmocka_run_group_tests(tests, sample_folder_make, sample_folder_remove);
}
