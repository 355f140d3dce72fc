// A recording returns what was stored, bit for bit, and answers wrong files and wrong names with a status and a
// sentence. Handles on one take share its index.
#include "base/clock.h"
#include "platform/files/database.h"
#include "recording/recording_schema.h"
#include "tests/support/recording_sample.h"
#include "tests/support/single_file.h"

#include <pthread.h>
#include <sys/wait.h>

// ------------------------------------------------------------- round trip

static void same_bytes(const void *a, const void *b, size_t count)
{
    EXPECT_INT(a != NULL, b != NULL);
    if (a)
        assert_memory_equal(a, b, count);
}

static void same_place(const struct place *a, const struct place *b)
{
    same_bytes(&a->calibration.color, &b->calibration.color, sizeof a->calibration.color);
    same_bytes(&a->calibration.color_from_depth, &b->calibration.color_from_depth, sizeof(struct pose));
    EXPECT_INT(a->calibration.registered, b->calibration.registered);
    EXPECT_INT(a->tag_count, b->tag_count);
    EXPECT_INT(a->point_count, b->point_count);
    EXPECT_INT(a->view_count, b->view_count);
    for (int i = 0; i < a->point_count; i++) {
        same_bytes(a->points[i].covariance, b->points[i].covariance, sizeof a->points[i].covariance);
        same_bytes(a->points[i].seen_from, b->points[i].seen_from, sizeof a->points[i].seen_from);
    }
    for (int i = 0; i < a->tag_count; i++) {
        EXPECT_INT(a->tags[i].id, b->tags[i].id);
        EXPECT_INT(a->tags[i].observations, b->tags[i].observations);
        same_bytes(&a->tags[i].world_from_tag, &b->tags[i].world_from_tag, sizeof(struct pose));
        EXPECT_NEAR(a->tags[i].side_m, b->tags[i].side_m, 0);
        EXPECT_NEAR(a->tags[i].rms_px, b->tags[i].rms_px, 0);
        same_bytes(a->tags[i].covariance, b->tags[i].covariance, sizeof a->tags[i].covariance);
    }
    same_bytes(a->points, b->points, (size_t)a->point_count * sizeof *a->points);
    for (int i = 0; i < a->view_count; i++) {
        same_bytes(&a->views[i].world_from_camera, &b->views[i].world_from_camera, sizeof(struct pose));
        EXPECT_INT(a->views[i].jpeg_bytes, b->views[i].jpeg_bytes);
        same_bytes(a->views[i].jpeg, b->views[i].jpeg, a->views[i].jpeg_bytes);
        same_bytes(a->views[i].depth, b->views[i].depth, WIDTH * HEIGHT * 2);
    }
    EXPECT_NEAR(b->rms_px, 0.25, 0);
    EXPECT_NEAR(a->rms_m, b->rms_m, 0);
}

static void same_frame(struct take *t, int index)
{
    static struct sample_frame m;
    static uint8_t rgb[COLOR_WIDTH * COLOR_HEIGHT * 3];
    sample_frame_make(&m, index);
    const struct take_entry *e = take_entry(t, index);
    EXPECT_INT(e->time_ns, m.frame.time_ns);
    EXPECT_INT(e->located, m.frame.located);
    EXPECT_INT(e->has_skeleton, m.frame.has_skeleton);
    same_bytes(&e->world_from_camera, &m.frame.world_from_camera, sizeof(struct pose));
    if (e->has_skeleton) {
        same_bytes(e->skeleton.joint, m.frame.skeleton.joint, sizeof e->skeleton.joint);
        same_bytes(e->skeleton.confidence, m.frame.skeleton.confidence, sizeof e->skeleton.confidence);
        same_bytes(e->skeleton.covariance, m.frame.skeleton.covariance, sizeof e->skeleton.covariance);
    }
    struct take_images p;
    EXPECT_STATUS(take_read(t, index, TAKE_COLOR | TAKE_DEPTH | TAKE_MASK, &p), OK);
    same_bytes(m.frame.depth, p.depth, sizeof m.depth);
    same_bytes(m.frame.mask, p.mask, sizeof m.mask);
    if (m.frame.jpeg)
        EXPECT_STATUS(jpeg_decode(m.jpeg, m.frame.jpeg_bytes, rgb, COLOR_WIDTH, COLOR_HEIGHT), OK);
    same_bytes(m.frame.jpeg ? rgb : NULL, p.color, sizeof rgb);
    free(m.jpeg);
}

static void test_round_trip(void **state)
{
    (void)state;
    const char *path = sample_path("round");
    sample_recording_write(path);
    EXPECT_TRUE(!file_exists(sample_path("round-wal")));
    EXPECT_TRUE(!file_exists(sample_path("round-shm")));
    path = sample_path("round");

    struct recording *r;
    EXPECT_STATUS(recording_open(&r, path), OK);
    struct rng rng = {SAMPLE_SEED};
    struct place wanted = sample_place(&rng), got;
    EXPECT_STATUS(recording_read_place(r, &got), OK);
    same_place(&wanted, &got);
    place_free(&wanted);
    place_free(&got);

    EXPECT_INT(recording_take_count(r), 2);
    assert_string_equal(recording_take_name(r, 0), "höher");
    assert_string_equal(recording_take_name(r, 1), "second");
    struct take *t;
    EXPECT_STATUS(take_open(&t, r, "höher"), OK);
    EXPECT_INT(take_frame_count(t), FRAMES);
    EXPECT_TRUE(take_is_complete(t));
    EXPECT_INT(take_dropped(t), 12);
    EXPECT_INT(take_body(t)->representative_frame, 17);
    same_bytes(take_body(t)->radius_rate, sample_body.radius_rate, sizeof sample_body.radius_rate);
    EXPECT_NEAR(take_calibration(t)->color.k3, 0.003, 0);
    for (int i = FRAMES - 1; i >= 0; i--)
        same_frame(t, i);
    struct take_images p;
    EXPECT_STATUS(take_read(t, 0, TAKE_DEPTH, &p), OK);
    EXPECT_TRUE(p.depth && !p.color && !p.mask);
    take_close(&t);
    EXPECT_STATUS(take_open(&t, r, "second"), OK);
    EXPECT_TRUE(!take_is_complete(t));
    EXPECT_INT(take_frame_count(t), 3);
    EXPECT_INT(take_body(t)->representative_frame, -1);
    take_close(&t);
    take_close(&t);
    recording_free(&r);
    recording_free(&r);
}

// ------------------------------------------------------------- order and names

static void test_frames_out_of_order_are_refused(void **state)
{
    (void)state;
    struct calibration calibration = sample_calibration();
    struct recording_writer *w;
    const char *path = sample_path("order");
    EXPECT_STATUS(recording_create(&w, path), OK);
    EXPECT_STATUS(recording_begin_take(w, "a", &calibration), OK);
    struct take_frame frame = {.time_ns = 100, .world_from_camera = POSE_IDENTITY};
    EXPECT_STATUS(recording_add_frame(w, &frame), OK);
    EXPECT_STATUS(recording_add_frame(w, &frame), ERR_ORDER);
    frame.time_ns = 99;
    EXPECT_STATUS(recording_add_frame(w, &frame), ERR_ORDER);
    frame.time_ns = 101;
    EXPECT_STATUS(recording_add_frame(w, &frame), OK);
    frame.time_ns = 102;
    frame.world_from_camera.translation.x = NAN;
    EXPECT_STATUS(recording_add_frame(w, &frame), ERR_INPUT);
    EXPECT_STATUS(recording_end_take(w), OK);
    EXPECT_STATUS(recording_close(&w), OK);
    struct recording_report report;
    EXPECT_STATUS(recording_verify(path, &report), OK);
    EXPECT_INT(report.frames, 2);
    EXPECT_INT(report.interrupted_takes, 0);
}

static void test_unknown_joints_do_not_spoil_the_file(void **state)
{
    (void)state;
    struct calibration calibration = sample_calibration();
    struct recording_writer *w;
    const char *path = sample_path("joints");
    EXPECT_STATUS(recording_create(&w, path), OK);
    EXPECT_STATUS(recording_begin_take(w, "a", &calibration), OK);
    struct take_frame frame = {.world_from_camera = POSE_IDENTITY, .has_skeleton = true};
    frame.skeleton.joint[JOINT_HEAD] = v3(NAN, 1, 2);
    EXPECT_STATUS(recording_add_frame(w, &frame), OK); // confidence 0: its position is meaningless
    frame.time_ns = 1;
    frame.skeleton.confidence[JOINT_HEAD] = 1;
    EXPECT_STATUS(recording_add_frame(w, &frame), ERR_INPUT);
    EXPECT_STATUS(recording_close(&w), OK);
    struct recording_report report;
    EXPECT_STATUS(recording_verify(path, &report), OK);
}

static void test_take_names(void **state)
{
    (void)state;
    struct calibration calibration = sample_calibration();
    struct recording_writer *w;
    struct recording *r;
    struct take *t;
    struct place place;
    const char *path = sample_path("names");
    EXPECT_STATUS(recording_create(&w, path), OK);
    char longest[202];
    memset(longest, 'x', 201);
    longest[201] = 0;
    EXPECT_STATUS(recording_begin_take(w, longest, &calibration), ERR_INPUT);
    EXPECT_STATUS(recording_begin_take(w, "", &calibration), ERR_INPUT);
    EXPECT_STATUS(recording_begin_take(w, "a\nb", &calibration), ERR_INPUT);
    longest[200] = 0;
    EXPECT_STATUS(recording_begin_take(w, "caf\xe9", &calibration), ERR_INPUT); // Latin 1
    EXPECT_SAYS("UTF-8");
    EXPECT_STATUS(recording_begin_take(w,
                                       "\xc2\x9b"
                                       "31m",
                                       &calibration),
                  ERR_INPUT); // a terminal obeys U+009B
    EXPECT_STATUS(recording_begin_take(w, longest, &calibration), OK);
    sample_frames_add(w, 0, 1);
    EXPECT_STATUS(recording_end_take(w), OK);
    EXPECT_STATUS(recording_begin_take(w, "b'c", &calibration), OK);
    sample_frames_add(w, 0, 1);
    EXPECT_STATUS(recording_end_take(w), OK);
    EXPECT_STATUS(recording_begin_take(w, "b'c", &calibration), ERR_EXISTS);
    EXPECT_STATUS(recording_begin_take(w, "empty", &calibration), OK); // the writer can go on
    EXPECT_STATUS(recording_end_take(w), OK);
    EXPECT_STATUS(recording_begin_take(w, "empty", &calibration), OK); // an empty take is not kept
    EXPECT_STATUS(recording_end_take(w), OK);
    EXPECT_STATUS(recording_begin_take(w, "d", &calibration), OK);
    sample_frames_add(w, 0, 1);
    EXPECT_STATUS(recording_close(&w), OK);

    EXPECT_STATUS(recording_open(&r, path), OK);
    EXPECT_INT(recording_take_count(r), 3);
    assert_string_equal(recording_take_name(r, 0), longest);
    EXPECT_STATUS(take_open(&t, r, "e"), ERR_MISSING);
    EXPECT_TRUE(t == NULL);
    EXPECT_SAYS("'b'c'");
    EXPECT_STATUS(recording_read_place(r, &place), NOTHING);
    recording_free(&r);

    EXPECT_STATUS(recording_append(&w, path), OK);
    EXPECT_STATUS(recording_begin_take(w, "d", &calibration), ERR_EXISTS);
    EXPECT_STATUS(recording_begin_take(w, "e", &calibration), OK);
    sample_frames_add(w, 0, 2);
    EXPECT_STATUS(recording_end_take(w), OK);
    EXPECT_STATUS(recording_close(&w), OK);
    EXPECT_STATUS(recording_open(&r, path), OK);
    EXPECT_STATUS(take_open(&t, r, "e"), OK);
    same_frame(t, 1);
    take_close(&t);
    recording_free(&r);
}

// ------------------------------------------------------------- replaced skeletons

static void test_skeletons_can_be_replaced(void **state)
{
    (void)state;
    char path[300];
    snprintf(path, sizeof path, "%s", sample_path("replaced"));
    struct recording_writer *w;
    struct recording *r;
    struct take *t;
    struct recording_report report;
    struct calibration calibration = sample_calibration();
    EXPECT_STATUS(recording_create(&w, path), OK);
    assert_string_equal(recording_writer_path(w), path);
    EXPECT_STATUS(recording_begin_take(w, "t", &calibration), OK);
    sample_frames_add(w, 0, FRAMES);
    EXPECT_STATUS(recording_end_take(w), OK);

    struct skeleton wanted = {0}, wrong = {0}, unknown_joints = {0};
    const struct skeleton *replacement[FRAMES] = {0};
    for (int j = 0; j < JOINT_COUNT; j++) {
        wanted.joint[j] = v3(0.1 * j, 1, 2.5);
        wanted.confidence[j] = 0.5f;
        joint_set_covariance(&wanted, (enum joint)j, &(struct covariance3){.xx = 0.01, .yy = 0.02, .zz = 0.03 * j});
    }
    wrong.joint[3].y = NAN;
    wrong.confidence[3] = 1;
    for (int i = 0; i < FRAMES; i += 2)
        replacement[i] = &wanted;
    replacement[FRAMES / 2] = &unknown_joints;
    replacement[FRAMES - 1] = &wrong;
    EXPECT_STATUS(recording_put_skeletons(w, replacement, FRAMES), ERR_INPUT); // and nothing is written
    replacement[FRAMES - 1] = NULL;
    EXPECT_STATUS(recording_put_skeletons(w, replacement, FRAMES), OK);
    EXPECT_STATUS(recording_close(&w), OK);

    EXPECT_STATUS(recording_verify(path, &report), OK);
    EXPECT_STATUS(recording_open(&r, path), OK);
    EXPECT_STATUS(take_open(&t, r, "t"), OK);
    int replaced = 0;
    for (int i = 0; i < FRAMES; i++) {
        const struct take_entry *e = take_entry(t, i);
        if (replacement[i] == &unknown_joints) {
            EXPECT_TRUE(!e->has_skeleton);
            continue;
        }
        if (!replacement[i] || !e->has_skeleton) {
            same_frame(t, i);
            continue;
        }
        same_bytes(&e->skeleton.joint, &wanted.joint, sizeof wanted.joint);
        same_bytes(&e->skeleton.covariance, &wanted.covariance, sizeof wanted.covariance);
        replaced++;
    }
    EXPECT_AT_LEAST(replaced, 1);
    take_close(&t);
    recording_free(&r);
}

// ------------------------------------------------------------- wrong files

static enum status opened(const char *path)
{
    struct recording *r;
    enum status status = recording_open(&r, path);
    EXPECT_INT(r != NULL, status == OK);
    recording_free(&r);
    if (status != OK && !strstr(status_message(), path)) {
        print_error("'%s' does not name %s\n", status_message(), path);
        fail_test();
    }
    struct recording_report report;
    EXPECT_INT(recording_verify(path, &report), status);
    return status;
}

static void test_wrong_files(void **state)
{
    (void)state;
    static const uint8_t zeros[200000];
    EXPECT_STATUS(opened(sample_path("nothing there")), ERR_MISSING);
    EXPECT_STATUS(opened(folder), ERR_FORMAT);
    EXPECT_STATUS(file_write(sample_path("zeros"), zeros, sizeof zeros), OK);
    EXPECT_STATUS(opened(sample_path("zeros")), ERR_FORMAT);
    EXPECT_STATUS(file_write(sample_path("empty"), zeros, 0), OK);
    EXPECT_STATUS(opened(sample_path("empty")), ERR_FORMAT);
    EXPECT_STATUS(file_write(sample_path("text"), "PK hello", 8), OK);
    EXPECT_STATUS(opened(sample_path("text")), ERR_FORMAT);

    struct database *db; // a database, but not a recording
    EXPECT_STATUS(database_open(&db, sample_path("other"), DATABASE_CREATE), OK);
    EXPECT_STATUS(database_run(db, "CREATE TABLE take(id); INSERT INTO take VALUES(1)"), OK);
    database_close(&db);
    EXPECT_STATUS(opened(sample_path("other")), ERR_FORMAT);

    sample_recording_write(sample_path("newer"));
    EXPECT_STATUS(opened(sample_path("newer")), OK);
    EXPECT_STATUS(database_open(&db, sample_path("newer"), DATABASE_WRITE), OK);
    EXPECT_STATUS(database_run(db, "PRAGMA user_version = 4"), OK);
    database_close(&db);
    EXPECT_STATUS(opened(sample_path("newer")), ERR_FORMAT);
    EXPECT_SAYS("schema 4");
    struct recording_writer *w;
    EXPECT_STATUS(recording_append(&w, sample_path("newer")), ERR_FORMAT);
    EXPECT_TRUE(w == NULL);
    EXPECT_STATUS(recording_append(&w, sample_path("nothing there")), ERR_MISSING);
}

static void test_never_overwrites(void **state)
{
    (void)state;
    struct recording_writer *w;
    EXPECT_STATUS(file_write(sample_path("mine"), "mine", 4), OK);
    EXPECT_STATUS(recording_create(&w, sample_path("mine")), ERR_EXISTS);
    EXPECT_TRUE(w == NULL);
    uint8_t *bytes;
    size_t count;
    EXPECT_STATUS(file_read(sample_path("mine"), &bytes, &count), OK);
    EXPECT_INT(count, 4);
    free(bytes);
    EXPECT_STATUS(recording_create(&w, sample_path("no/such/folder")), ERR_IO);
}

// Runs `check` as a user to whom folder permissions apply, unlike root; returns its result.
static int as_ordinary_user(int (*check)(void))
{
    pid_t child = fork();
    if (!child) {
        if (geteuid() == 0 && (setgid(65534) || setuid(65534)))
            _exit(99);
        _exit(check());
    }
    int how;
    waitpid(child, &how, 0);
    return WIFEXITED(how) ? WEXITSTATUS(how) : 98;
}

static int read_checkpointed(void)
{
    struct recording_report report;
    struct recording_writer *w;
    if (recording_verify(sample_path("locked/checkpointed"), &report) != OK || report.frames != FRAMES + 3) {
        print_error("checkpointed: %s\n", status_message());
        return 1;
    }
    if (recording_append(&w, sample_path("locked/checkpointed")) != ERR_IO)
        return 2;
    if (recording_create(&w, sample_path("locked/new")) != ERR_IO)
        return 3;
    return recording_verify(sample_path("locked/secret"), &report) == ERR_IO ? 0 : 4;
}

static int read_with_log(void)
{
    struct recording_report report;
    enum status status = recording_verify(sample_path("locked/logged"), &report);
    // Both are correct: read in full, or a sentence that says why not.
    if (status == OK && report.frames == 3)
        return 0;
    print_error("logged: %s\n", status_message());
    return status == ERR_IO && strstr(status_message(), "-wal") ? 0 : 1;
}

static void test_read_only_folder(void **state)
{
    (void)state;
    chmod(folder, 0755);
    EXPECT_STATUS(folder_make(sample_path("locked")), OK);
    sample_recording_write(sample_path("locked/checkpointed"));
    sample_recording_write(sample_path("locked/secret"));
    chmod(sample_path("locked/checkpointed"), 0444);
    chmod(sample_path("locked/secret"), 0);
    // A writer that is killed leaves its log.
    pid_t child = fork();
    if (!child) {
        struct recording_writer *w;
        struct calibration calibration = sample_calibration();
        if (recording_create(&w, sample_path("locked/logged")) == OK &&
            recording_begin_take(w, "a", &calibration) == OK) {
            sample_frames_add(w, 0, 3);
            _exit(recording_end_take(w) == OK ? 0 : 1);
        }
        _exit(1);
    }
    int how;
    waitpid(child, &how, 0);
    EXPECT_INT(how, 0);
    EXPECT_TRUE(file_exists(sample_path("locked/logged-wal")));
    chmod(sample_path("locked"), 0555);
    EXPECT_INT(as_ordinary_user(read_checkpointed), 0);
    EXPECT_INT(as_ordinary_user(read_with_log), 0);
    unlink(sample_path("locked/logged-shm")); // succeeds only for root; then it is the harder case
    EXPECT_INT(as_ordinary_user(read_with_log), 0);
    chmod(sample_path("locked"), 0755);
}

// ------------------------------------------------------------- concurrent reading

static int64_t frames_seen(const char *path)
{
    struct recording *r;
    struct take *t;
    EXPECT_STATUS(recording_open(&r, path), OK);
    EXPECT_STATUS(take_open(&t, r, "a"), OK);
    int64_t count = take_frame_count(t);
    if (count)
        same_frame(t, (int)count - 1);
    take_close(&t);
    recording_free(&r);
    return count;
}

static void test_read_while_writing(void **state)
{
    (void)state;
    struct calibration calibration = sample_calibration();
    struct recording_writer *w, *second;
    const char *path = sample_path("live");
    EXPECT_STATUS(recording_create(&w, path), OK);
    EXPECT_STATUS(recording_begin_take(w, "a", &calibration), OK);
    EXPECT_INT(frames_seen(path), 0);
    EXPECT_STATUS(recording_append(&second, path), ERR_IO);
    EXPECT_TRUE(second == NULL);

    // Without another frame or call, the batch is committed by the wall clock.
    sample_frames_add(w, 0, 5);
    int64_t deadline = clock_now_ns() + INT64_C(5000000000);
    while (frames_seen(path) < 5 && clock_now_ns() < deadline)
        clock_sleep_until_ns(clock_now_ns() + 20000000);
    EXPECT_INT(frames_seen(path), 5);

    struct recording *r;
    struct take *t;
    EXPECT_STATUS(recording_open(&r, path), OK);
    EXPECT_STATUS(take_open(&t, r, "a"), OK);
    sample_frames_add(w, 5, FRAMES);
    EXPECT_STATUS(recording_end_take(w), OK);
    EXPECT_INT(frames_seen(path), FRAMES);
    EXPECT_INT(take_frame_count(t), 5); // as when it was opened
    same_frame(t, 4);
    EXPECT_STATUS(recording_close(&w), OK); // while a reader is open
    same_frame(t, 3);
    take_close(&t);
    recording_free(&r);
    EXPECT_INT(frames_seen(path), FRAMES);
    EXPECT_STATUS(recording_append(&w, path), OK);
    EXPECT_STATUS(recording_close(&w), OK);
    EXPECT_TRUE(database_is_single_file(path));
    EXPECT_INT(frames_seen(path), FRAMES);
}

// Older files lack the optional tables of points and tags: they are read, and get the tables with their next place.
static void test_landmarks_without_covariance(void **state)
{
    (void)state;
    struct rng rng = {SAMPLE_SEED};
    struct place place = sample_place(&rng), got;
    struct database *db;
    struct recording *r;
    struct recording_writer *w;
    place.rms_px = 0.25; // as it was written
    sample_recording_write(sample_path("older"));
    EXPECT_STATUS(database_open(&db, sample_path("older"), DATABASE_WRITE), OK);
    EXPECT_STATUS(database_run(db, "DROP TABLE point_error; DROP TABLE tag_error; DROP TABLE point_side"), OK);
    database_close(&db);
    EXPECT_STATUS(recording_open(&r, sample_path("older")), OK);
    EXPECT_STATUS(recording_read_place(r, &got), OK);
    recording_free(&r);
    EXPECT_INT(got.point_count, place.point_count);
    for (int i = 0; i < got.point_count; i++) {
        for (int k = 0; k < 6; k++)
            EXPECT_NEAR(got.points[i].covariance[k], 0, 0);
        for (int k = 0; k < 3; k++)
            EXPECT_NEAR(got.points[i].seen_from[k], 0, 0);
    }
    EXPECT_INT(got.tag_count, place.tag_count);
    for (int i = 0; i < got.tag_count; i++)
        for (int k = 0; k < 21; k++)
            EXPECT_NEAR(got.tags[i].covariance[k], 0, 0);
    place_free(&got);
    EXPECT_STATUS(recording_append(&w, sample_path("older")), OK);
    EXPECT_STATUS(recording_put_place(w, &place), OK);
    EXPECT_STATUS(recording_close(&w), OK);
    EXPECT_STATUS(recording_open(&r, sample_path("older")), OK);
    EXPECT_STATUS(recording_read_place(r, &got), OK);
    recording_free(&r);
    same_place(&place, &got);
    place_free(&got);
    place_free(&place);
}

// ------------------------------------------------------------- shared handles

enum { HOUR_FRAMES = 108000 };

static void *close_on_thread(void *take)
{
    struct take *closing = take;
    take_close(&closing);
    return NULL;
}

// Four handles, as the app has them: one index, whichever is closed first and on whatever thread.
static void test_handles_share_one_index(void **state)
{
    (void)state;
    enum { HANDLES = 4 };
    sample_recording_write(sample_path("shared"));
    const char *path = sample_path("shared");
    struct recording *r[HANDLES];
    struct take *t[HANDLES];
    pthread_t threads[HANDLES];
    for (int i = 0; i < HANDLES; i++) {
        EXPECT_STATUS(recording_open(&r[i], path), OK);
        EXPECT_STATUS(i ? take_open_shared(&t[i], r[i], t[0]) : take_open(&t[i], r[i], "höher"), OK);
        EXPECT_TRUE(take_entry(t[i], 0) == take_entry(t[0], 0));
        EXPECT_TRUE(take_body(t[i]) == take_body(t[0]) && take_calibration(t[i]) == take_calibration(t[0]));
    }
    const double per_frame = (double)sizeof(struct take_entry);
    print_message("%.0f bytes a frame for all handles, %.1f MB an hour\n", per_frame, per_frame * HOUR_FRAMES / 1e6);
    EXPECT_AT_MOST(per_frame, 712);
    struct take_images first, second; // of two handles: neither disturbs the other
    EXPECT_STATUS(take_read(t[0], 0, TAKE_DEPTH, &first), OK);
    EXPECT_STATUS(take_read(t[1], FRAMES - 1, TAKE_DEPTH, &second), OK);
    EXPECT_TRUE(first.depth != second.depth);
    for (int i = 0; i < HANDLES - 1; i++)
        EXPECT_INT(pthread_create(&threads[i], NULL, close_on_thread, t[i]), 0);
    for (int i = 0; i < FRAMES; i++)
        same_frame(t[HANDLES - 1], i);
    for (int i = 0; i < HANDLES - 1; i++)
        pthread_join(threads[i], NULL);
    same_frame(t[HANDLES - 1], 0);
    take_close(&t[HANDLES - 1]);
    for (int i = 0; i < HANDLES; i++)
        recording_free(&r[i]);
}

int main(void)
{
    printf("seed %d\n", SAMPLE_SEED);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_round_trip),
        cmocka_unit_test(test_frames_out_of_order_are_refused),
        cmocka_unit_test(test_unknown_joints_do_not_spoil_the_file),
        cmocka_unit_test(test_take_names),
        cmocka_unit_test(test_skeletons_can_be_replaced),
        cmocka_unit_test(test_wrong_files),
        cmocka_unit_test(test_landmarks_without_covariance),
        cmocka_unit_test(test_never_overwrites),
        cmocka_unit_test(test_read_only_folder),
        cmocka_unit_test(test_read_while_writing),
        cmocka_unit_test(test_handles_share_one_index),
    };
    return cmocka_run_group_tests(tests, sample_folder_make, sample_folder_remove);
}
