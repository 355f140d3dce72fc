// The joints' covariances in a recording: older files lack them, and damaged ones are found and given up without their
// frames.
#include "tests/support/recording_sample.h"
#include "tests/support/sql.h"

// As they were written, bit for bit.
static void expect_covariances(struct take *t, int index)
{
    static struct sample_frame m;
    sample_frame_make(&m, index);
    const struct take_entry *e = take_entry(t, index);
    if (e->has_skeleton)
        assert_memory_equal(e->skeleton.covariance, m.frame.skeleton.covariance, sizeof e->skeleton.covariance);
    free(m.jpeg);
}

// Older files lack the joints' covariances: they are read, and takes that are added get them.
static void test_older_file_without_joint_covariances(void **state)
{
    (void)state;
    struct recording *r;
    struct recording_writer *w;
    struct take *t;
    struct recording_report report;
    struct calibration calibration = sample_calibration();
    const char *path = sample_path("older joints");
    sample_recording_write(path);
    run_sql(path, "DROP TABLE joint_error");
    for (int added = 0; added < 2; added++) {
        EXPECT_STATUS(recording_verify(path, &report), OK);
        EXPECT_STATUS(recording_open(&r, path), OK);
        EXPECT_STATUS(take_open(&t, r, "höher"), OK);
        EXPECT_INT(take_frame_count(t), FRAMES);
        for (int i = 0; i < FRAMES; i++)
            for (int j = 0; j < JOINT_COUNT; j++)
                EXPECT_TRUE(isnan(joint_sigma_m(&take_entry(t, i)->skeleton, (enum joint)j)));
        take_close(&t);
        if (added) {
            EXPECT_STATUS(take_open(&t, r, "added"), OK);
            for (int i = 0; i < FRAMES; i++)
                expect_covariances(t, i);
            take_close(&t);
        }
        recording_free(&r);
        if (added)
            break;
        EXPECT_STATUS(recording_append(&w, path), OK);
        EXPECT_STATUS(recording_begin_take(w, "added", &calibration), OK);
        sample_frames_add(w, 0, FRAMES);
        EXPECT_STATUS(recording_end_take(w), OK);
        EXPECT_STATUS(recording_close(&w), OK);
    }
}

// Covariances that are not as written are found, and repair keeps the frames without them.
static void test_damaged_joint_covariances(void **state)
{
    (void)state;
    static const char *const damage[] = {
        "UPDATE joint_error SET crc = crc + 1 WHERE id % 4294967296 = 1",
        "UPDATE joint_error SET covariances = x'00' WHERE id % 4294967296 = 1",
    };
    for (size_t i = 0; i < COUNT_OF(damage); i++) {
        struct recording_report report;
        char name[32];
        snprintf(name, sizeof name, "damaged joints %zu", i);
        sample_recording_write(sample_path(name));
        run_sql(sample_path(name), damage[i]);
        EXPECT_STATUS(recording_verify(sample_path(name), &report), ERR_CORRUPT);
        EXPECT_SAYS("covariances of 1 frames");
        EXPECT_INT(report.lost_covariances, 2); // one in each take
        char repaired[128];
        snprintf(repaired, sizeof repaired, "%s", sample_path("repaired joints"));
        unlink(repaired);
        EXPECT_STATUS(recording_repair(sample_path(name), repaired, &report), OK);
        EXPECT_INT(report.frames, FRAMES + 3);
        EXPECT_INT(report.lost_covariances, 2);
        EXPECT_STATUS(recording_verify(repaired, &report), OK);
        struct recording *r;
        struct take *t;
        EXPECT_STATUS(recording_open(&r, repaired), OK);
        EXPECT_STATUS(take_open(&t, r, "höher"), OK);
        EXPECT_TRUE(isnan(joint_sigma_m(&take_entry(t, 1)->skeleton, JOINT_HEAD)));
        expect_covariances(t, 3);
        take_close(&t);
        recording_free(&r);
    }
}

static void test_infinite_covariance_is_refused(void **state)
{
    (void)state;
    struct calibration calibration = sample_calibration();
    struct recording_writer *w;
    struct take_frame frame = {.world_from_camera = POSE_IDENTITY, .has_skeleton = true};
    frame.skeleton.covariance[JOINT_HEAD].half[2] = 0x7c00;
    EXPECT_STATUS(recording_create(&w, sample_path("infinite")), OK);
    EXPECT_STATUS(recording_begin_take(w, "a", &calibration), OK);
    EXPECT_STATUS(recording_add_frame(w, &frame), ERR_INPUT);
    EXPECT_STATUS(recording_close(&w), OK);
}

int main(void)
{
    printf("seed %d\n", SAMPLE_SEED);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_older_file_without_joint_covariances),
        cmocka_unit_test(test_damaged_joint_covariances),
        cmocka_unit_test(test_infinite_covariance_is_refused),
    };
    return cmocka_run_group_tests(tests, sample_folder_make, sample_folder_remove);
}
