// Which frames of a take are compared, and in which axes: takes whose sensor is located never, from the start, or only
// after the person came.
#include "compare/joint_samples.h"
#include "tests/support/recording_sample.h"

enum { COUNT = 10, PERSON_FROM = 2 };

// The sensor 1.5 m above the floor, level, looking along the world's y.
static const struct pose sensor = {{-0.70710678118654752, 0, 0, 0.70710678118654752}, {1, 2, 1.5}};

static struct vec3 joint_at(int i, int j) { return v3(0.1 * j, 0.05 * j - 0.2, 3 + 0.01 * i); } // camera's axes

static void write_take(const char *path, int located_from, bool person)
{
    const struct calibration calibration = sample_calibration();
    struct recording_writer *w;
    EXPECT_STATUS(recording_create(&w, path), OK);
    EXPECT_STATUS(recording_begin_take(w, "a", &calibration), OK);
    for (int i = 0; i < COUNT; i++) {
        struct take_frame frame = {.time_ns = 5 + i * INT64_C(33333333), .world_from_camera = POSE_IDENTITY};
        if ((frame.located = i >= located_from))
            frame.world_from_camera = sensor;
        frame.has_skeleton = person && i >= PERSON_FROM;
        for (int j = 0; j < JOINT_COUNT; j++) {
            frame.skeleton.joint[j] = joint_at(i, j);
            frame.skeleton.confidence[j] = 1;
        }
        EXPECT_STATUS(recording_add_frame(w, &frame), OK);
    }
    EXPECT_STATUS(recording_end_take(w), OK);
    EXPECT_STATUS(recording_close(&w), OK);
}

static int64_t first_sample_of(const char *path)
{
    struct recording *r;
    struct take *take;
    EXPECT_STATUS(recording_open(&r, path), OK);
    EXPECT_STATUS(take_open(&take, r, "a"), OK);
    const int64_t first = take_first_sample(take);
    for (int64_t i = 0; i < COUNT; i++)
        EXPECT_TRUE(take_frame_is_sample(take, i) == (first >= 0 && i >= first));
    take_close(&take);
    recording_free(&r);
    return first;
}

static void test_frames_that_are_compared(void **state)
{
    (void)state;
    static const struct {
        const char *file;
        int located_from, first;
    } cases[] = {{"never.reenact", COUNT, PERSON_FROM},
                 {"start.reenact", 0, PERSON_FROM},
                 {"late.reenact", 6, 6}, // the first four frames with the person are nowhere in the place
                 {"last.reenact", COUNT - 1, COUNT - 1}};
    for (size_t k = 0; k < COUNT_OF(cases); k++) {
        const char *path = sample_path(cases[k].file);
        struct joint_samples samples;
        write_take(path, cases[k].located_from, true);
        EXPECT_INT(first_sample_of(path), cases[k].first);
        EXPECT_STATUS(joint_samples_read_take(path, NULL, &samples), OK);
        EXPECT_INT(samples.count, COUNT - cases[k].first);
        for (int64_t i = 0; i < samples.count; i++)
            for (int j = 0; j < JOINT_COUNT; j++) {
                // Down is the sensor's y where it is held level, else the world's -z, in which the sensor is 1.5 m up.
                const struct vec3 filmed = joint_at((int)i + cases[k].first, j);
                const double raised = cases[k].located_from < COUNT ? 1.5 : 0;
                EXPECT_NEAR(samples.at[i].skeleton.joint[j].y, filmed.y - raised, 1e-6);
            }
        joint_samples_free(&samples);
    }
}

static void test_nobody(void **state)
{
    (void)state;
    struct joint_samples samples;
    const char *path = sample_path("nobody.reenact");
    write_take(path, 0, false);
    EXPECT_INT(first_sample_of(path), -1);
    EXPECT_STATUS(joint_samples_read_take(path, "a", &samples), ERR_INPUT);
    EXPECT_TRUE(!samples.at && !samples.count);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_frames_that_are_compared),
        cmocka_unit_test(test_nobody),
    };
    return cmocka_run_group_tests(tests, sample_folder_make, sample_folder_remove);
}
