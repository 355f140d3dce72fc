// What a foreign program wrote with right checksums, and is not as docs/format.md says: verify finds it, and no reader
// hands it on.
#include "recording/recording_reader.h"
#include "tests/support/recording_sample.h"
#include "tests/support/sql.h"

enum { FRAME = 7 };

static void fresh(char path[128])
{
    snprintf(path, 128, "%s", sample_path("ranges"));
    unlink(path);
    sample_recording_write(path);
}

// ------------------------------------------------------------- frames

static void put_frame(const char *path, const struct pose *pose, const struct skeleton *skeleton)
{
    struct database *db;
    struct statement *s;
    struct take_entry entry;
    uint8_t pose_bytes[POSE_BYTES], skeleton_bytes[SKELETON_BYTES];
    const int64_t key = frame_key(1, FRAME);
    EXPECT_STATUS(database_open(&db, path, DATABASE_WRITE), OK);
    EXPECT_STATUS(select_open(&s, db, TABLE_FRAME, "WHERE rowid = ?"), OK);
    statement_bind_number(s, 1, key);
    EXPECT_STATUS(statement_step(s), OK);
    EXPECT_STATUS(frame_from_row(s, &entry), OK);
    const unsigned pictures = (unsigned)statement_number(s, 5);
    statement_close(&s);
    put_pose(pose_bytes, pose ? pose : &entry.world_from_camera);
    const struct skeleton *joints = skeleton ? skeleton : &entry.skeleton;
    uint8_t *at = skeleton_bytes;
    for (int j = 0; j < JOINT_COUNT;
         j++, at += sizeof(float)) { // put_skeleton would mend it; numbers are little-endian
        memcpy(at, &joints->joint[j], 3 * sizeof(double));
        at += 3 * sizeof(double);
        memcpy(at, &joints->confidence[j], sizeof(float));
    }
    const size_t count = skeleton || entry.has_skeleton ? SKELETON_BYTES : 0;
    const uint32_t crc = frame_crc(entry.time_ns, entry.located, pose_bytes, skeleton_bytes, count, pictures);
    EXPECT_STATUS(
        statement_open(&s, db, "UPDATE frame SET world_from_camera = ?, skeleton = ?, crc = ?, seal = ? WHERE id = ?"),
        OK);
    statement_bind_blob(s, 1, pose_bytes, POSE_BYTES);
    statement_bind_blob(s, 2, count ? skeleton_bytes : NULL, count);
    statement_bind_number(s, 3, crc);
    statement_bind_number(s, 4, row_seal(key, crc));
    statement_bind_number(s, 5, key);
    EXPECT_STATUS(statement_run(s), OK);
    statement_close(&s);
    database_close(&db);
}

// The file's frames, after it was looked whether verify finds `lost` of them.
static void expect_frames(const char *path, int lost, const char *says)
{
    struct recording_report report;
    struct recording *r;
    struct take *t;
    EXPECT_STATUS(recording_verify(path, &report), lost ? ERR_CORRUPT : OK);
    EXPECT_INT(report.lost_frames, lost);
    if (lost)
        EXPECT_SAYS(says);
    EXPECT_STATUS(recording_open(&r, path), OK);
    EXPECT_STATUS(take_open(&t, r, "höher"), OK);
    EXPECT_INT(take_frame_count(t), FRAMES - lost);
    for (int64_t i = 0; i < take_frame_count(t); i++) {
        const struct take_entry *e = take_entry(t, i);
        EXPECT_TRUE(pose_is_valid(e->world_from_camera));
        for (int j = 0; j < JOINT_COUNT; j++)
            EXPECT_AT_MOST(v3_length(e->skeleton.joint[j]), 1.8e6);
    }
    take_close(&t);
    recording_free(&r);
}

static void test_poses(void **state)
{
    (void)state;
    static const struct {
        struct pose pose;
        bool good;
    } poses[] = {
        {{{0, 0, 0, 1}, {1, 2, 3}}, true},
        {{{0, 0, 0, 1.00000012}, {-9e5, 9e5, 0}}, true}, // as single precision gives it; a place far from its origin
        {{{0, 0, 0, 0}, {1, 2, 3}}, false},
        {{{0, 0, 0, 2}, {1, 2, 3}}, false},
        {{{0.8, 0, 0, 0.8}, {1, 2, 3}}, false},
        {{{1e200, 0, 0, 1}, {1, 2, 3}}, false},
        {{{0, 0, 0, NAN}, {1, 2, 3}}, false},
        {{{0, 0, 0, 1}, {1e308, 0, 0}}, false},
        {{{0, 0, 0, 1}, {0, -1e6, 0}}, false},
        {{{0, 0, 0, 1}, {0, 0, INFINITY}}, false},
    };
    char path[128];
    for (size_t i = 0; i < COUNT_OF(poses); i++) {
        print_message("pose %zu\n", i);
        fresh(path);
        put_frame(path, &poses[i].pose, NULL);
        expect_frames(path, !poses[i].good, "damaged or missing");
    }
}

static void test_joints(void **state)
{
    (void)state;
    static const struct {
        double x;
        float confidence;
        bool good;
    } joints[] = {
        {0.5, 1, true},       {9e5, 1, true},     {1e308, 1, false}, {-1e308, 0.5F, false}, {1e6, 1, false},
        {INFINITY, 1, false}, {NAN, 0.5F, false}, {0.5, NAN, false}, {1e308, 0, true}, // unknown: it means nothing
        {INFINITY, 0, true},
    };
    char path[128];
    struct skeleton s = {0};
    for (size_t i = 0; i < COUNT_OF(joints); i++) {
        print_message("joint %zu\n", i);
        for (int j = 0; j < JOINT_COUNT; j++) {
            s.joint[j] = v3(0.1 * j, 0.2, 2);
            s.confidence[j] = 1;
        }
        s.joint[3].x = joints[i].x;
        s.confidence[3] = joints[i].confidence;
        fresh(path);
        put_frame(path, NULL, &s);
        expect_frames(path, !joints[i].good, "damaged or missing");
    }
}

// ------------------------------------------------------------- takes

// Changes the row of the take "höher" by `change`, and makes its checksums right again.
static void change_take(const char *path, void (*change)(struct take_row *take, uint8_t *calibration, int which),
                        int which)
{
    struct database *db;
    struct statement *s;
    struct take_row take;
    bool usable;
    uint8_t calibration[CALIBRATION_BYTES], body[BODY_BYTES];
    EXPECT_STATUS(database_open(&db, path, DATABASE_WRITE), OK);
    EXPECT_STATUS(select_open(&s, db, TABLE_TAKE, "WHERE rowid = 1"), OK);
    EXPECT_STATUS(statement_step(s), OK);
    EXPECT_STATUS(take_from_row(s, &take, &usable), OK);
    statement_close(&s);
    put_calibration(calibration, &take.calibration);
    change(&take, calibration, which);
    put_body(body, &take.body);
    const uint32_t crc = take_crc(take.name, calibration, take.complete, take.dropped, body);
    uint8_t ignored[CALIBRATION_BYTES];
    EXPECT_STATUS(insert_open(&s, db, TABLE_TAKE, true), OK);
    take_bind(s, &take, ignored, body);
    statement_bind_blob(s, 3, calibration, CALIBRATION_BYTES);
    statement_bind_number(s, 7, crc);
    statement_bind_number(s, TAKE_SEAL + 1, take_seal(&take, crc));
    EXPECT_STATUS(statement_run(s), OK);
    statement_close(&s);
    database_close(&db);
}

static const struct {
    const char *what, *says; // NULL: it is sound
} changes[] = {
    {"nothing", NULL},
    {"a radius that is no number", "the body, the calibration or a note of take 'höher'"},
    {"a negative radius", "the body, the calibration or a note of take 'höher'"},
    {"a radius of 1e308 lengths", "the body, the calibration or a note of take 'höher'"},
    {"registered is 7", "the body, the calibration or a note of take 'höher'"},
    {"a note that a terminal obeys", "the body, the calibration or a note of take 'höher'"},
    {"an alias that turns the text", "the body, the calibration or a note of take 'höher'"},
    {"no frames", "holds 40 frames more than it is said to have"},
    {"five frames", "holds 35 frames more than it is said to have"},
    {"a frame more", "1 frames of take 'höher' are damaged or missing"},
    {"a name that a terminal obeys", "the name of take 'h?her'"},
    {"a name of two lines", "the name of take 'h?her'"},
    {"a name that is no UTF-8", "the name of take 'h?her'"},
    {"a name that turns the text", "the name of take 'h?her'"},
};

static void change_one(struct take_row *take, uint8_t *calibration, int which)
{
    switch (which) {
    case 1: take->body.radius_rate[2] = NAN; break;
    case 2: take->body.radius_rate[2] = -0.1; break;
    case 3: take->body.radius_rate[2] = 1e308; break;
    case 4: calibration[CALIBRATION_REGISTERED] = 7; break;
    case 5: strcpy(take->note, "a\x1b[2J"); break;
    case 6: strcpy(take->alias, "a\u202eb"); break;
    case 7: take->frames = 0; break;
    case 8: take->frames = 5; break;
    case 9: take->frames++; break;
    case 10: strcpy(take->name, "h\x1bher"); break;
    case 11: strcpy(take->name, "h\nher"); break;
    case 12: strcpy(take->name, "h\xffher"); break;
    case 13: strcpy(take->name, "h\u202eher"); break;
    default: break;
    }
}

static void test_takes(void **state)
{
    (void)state;
    char path[128];
    for (int i = 0; i < (int)COUNT_OF(changes); i++) {
        struct recording_report report;
        struct recording *r;
        struct take *t;
        print_message("%s\n", changes[i].what);
        fresh(path);
        change_take(path, change_one, i);
        EXPECT_STATUS(recording_verify(path, &report), changes[i].says ? ERR_CORRUPT : OK);
        if (changes[i].says)
            EXPECT_SAYS(changes[i].says);
        EXPECT_INT(report.lost_takes, 0);
        EXPECT_STATUS(recording_open(&r, path), OK); // its frames are read all the same
        EXPECT_STATUS(take_open(&t, r, i < 10 ? "höher" : "h?her"), OK);
        EXPECT_INT(take_frame_count(t), FRAMES);
        for (int p = 0; p < PART_COUNT; p++)
            EXPECT_TRUE(take_body(t)->radius_rate[p] >= 0 && take_body(t)->radius_rate[p] <= 100);
        take_close(&t);
        recording_free(&r);
    }
}

// What a reader would not take is not written either.
static void test_writer_refuses(void **state)
{
    (void)state;
    const struct calibration calibration = sample_calibration();
    struct recording_writer *w;
    struct take_frame frame = {.time_ns = 1, .world_from_camera = POSE_IDENTITY};
    EXPECT_STATUS(recording_create(&w, sample_path("refused")), OK);
    EXPECT_STATUS(recording_begin_take(w, "a", &calibration), OK);
    frame.world_from_camera.rotation.w = 2;
    EXPECT_STATUS(recording_add_frame(w, &frame), ERR_INPUT);
    frame.world_from_camera = POSE_IDENTITY;
    frame.world_from_camera.translation.x = 1e6;
    EXPECT_STATUS(recording_add_frame(w, &frame), ERR_INPUT);
    frame.world_from_camera = POSE_IDENTITY;
    frame.has_skeleton = true;
    frame.skeleton.confidence[0] = 1;
    frame.skeleton.joint[0].y = -1e7;
    EXPECT_STATUS(recording_add_frame(w, &frame), ERR_INPUT);
    frame.skeleton.joint[0].y = -1;
    EXPECT_STATUS(recording_add_frame(w, &frame), OK);
    EXPECT_STATUS(recording_put_body(w, &(struct body){.radius_rate = {-1}}), ERR_INPUT);
    EXPECT_STATUS(recording_end_take(w), OK);
    EXPECT_STATUS(recording_close(&w), OK);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_poses),
        cmocka_unit_test(test_joints),
        cmocka_unit_test(test_takes),
        cmocka_unit_test(test_writer_refuses),
    };
    return cmocka_run_group_tests(tests, sample_folder_make, sample_folder_remove);
}
