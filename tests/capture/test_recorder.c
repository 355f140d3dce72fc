// A take from the source to the file: against the synthetic world's truth, twice the
// same, and what a stop or a failure leaves behind.
#include "tests/support/test.h"

#include "capture/recorder.h"
#include "tests/support/film.h"

#include <stdio.h>
#include <string.h>

// Under an emulator each frame takes half a minute.
#ifdef EMULATED
enum { FRAMES = 4 };
#else
enum { FRAMES = SANITIZED ? 8 : 11 };
#endif
static const double SCALE = 1; // a tag on the far wall is 15 pixels wide

static struct scratch scratch;
static struct world *world;
static struct place place;

// What another program sees of the take while its joints are smoothed.
struct reader {
    const char *path;
    int64_t announced, steps;
    bool complete, has_skeleton;
    struct skeleton last_skeleton; // of the last frame
};

static void on_progress(void *context, int64_t frames)
{
    struct reader *r = context;
    struct recording *recording;
    struct take *take;
    r->announced = frames;
    EXPECT_STATUS(recording_open(&recording, r->path), OK);
    EXPECT_STATUS(take_open(&take, recording, "turn"), OK);
    r->complete = take_is_complete(take) && take_frame_count(take) == FRAMES;
    r->has_skeleton = take_entry(take, FRAMES - 1)->has_skeleton;
    r->last_skeleton = take_entry(take, FRAMES - 1)->skeleton;
    take_close(&take);
    recording_free(&recording);
}

static void count(void *context) { ((struct reader *)context)->steps++; }

static bool with_body_points; // of the next recordings

static struct recorder_result record(const char *file, const struct place *in, enum status wanted)
{
    struct source *source;
    struct recording_writer *writer;
    char path[300];
    snprintf(path, sizeof path, "%s", scratch_file(&scratch, file));
    struct reader reader = {.path = path};
    struct recorder_options options = {.on_smoothing_begin = on_progress, .on_smoothed = count, .context = &reader};
    options.body_points = with_body_points;
    struct recorder_result result;
    char uri[300];
    snprintf(uri, sizeof uri, "folder:%s", scratch_file(&scratch, "sensor"));
    EXPECT_STATUS(source_open(&source, uri, SOURCE_SENSOR), OK);
    EXPECT_STATUS(recording_create(&writer, path), OK);
    EXPECT_STATUS(recorder_run(source, writer, "turn", in, &options, &result), wanted);
    EXPECT_STATUS(recording_close(&writer), OK);
    source_close(&source);
    EXPECT_TRUE(reader.complete && reader.has_skeleton); // so a kill there loses nothing
    EXPECT_INT(reader.announced, FRAMES);
    EXPECT_INT(reader.steps, FRAMES);
    struct recording_report report;
    EXPECT_STATUS(recording_verify(path, &report), OK);
    return result;
}

static void test_take_matches_truth(void **state)
{
    (void)state;
    struct recorder_result result = record("a.reenact", &place, OK);
    EXPECT_INT(result.frames, FRAMES);
    EXPECT_INT(result.tracked, FRAMES);
    EXPECT_TRUE(!result.smoothing_out_of_memory && result.smoothing_ms > 0);
    EXPECT_INT(result.dropped, 0);
    EXPECT_TRUE(result.located);
    EXPECT_INT(result.sensor_moves, 0);

    struct recording *recording;
    struct take *take;
    EXPECT_STATUS(recording_open(&recording, scratch_file(&scratch, "a.reenact")), OK);
    EXPECT_STATUS(take_open(&take, recording, "turn"), OK);
    EXPECT_TRUE(take_is_complete(take));
    struct pose truth = world_sensor_pose(world);
    double sum = 0;
    for (int i = 0; i < FRAMES; i++) {
        const struct take_entry *entry = take_entry(take, i);
        EXPECT_TRUE(entry->located && entry->has_skeleton && entry->has_mask && entry->has_depth && entry->has_color);
        // the place has only two tags of 15 pixels and the floor
        EXPECT_AT_MOST(v3_distance(entry->world_from_camera.translation, truth.translation), 0.05);
        EXPECT_AT_MOST(pose_angle(entry->world_from_camera, truth), 0.01);
        struct skeleton wanted = world_joints_in_camera(world, (double)(entry->time_ns - 50000000000) / 1e9, truth);
        for (int j = 0; j < JOINT_COUNT; j++)
            sum += v3_distance(entry->skeleton.joint[j], wanted.joint[j]) / (JOINT_COUNT * FRAMES);
    }
    print_message("mean joint error %.3f m\n", sum);
    EXPECT_AT_MOST(sum, 0.05);
    const struct body *body = take_body(take);
    EXPECT_AT_LEAST(body->representative_frame, 0);
    for (int p = 0; p < PART_COUNT; p++)
        EXPECT_TRUE(body->radius_rate[p] > 0.05 && body->radius_rate[p] < 1.2);
    take_close(&take);
    recording_free(&recording);
}

// Both takes, frame by frame; false: their joints differ somewhere.
static bool have_same_joints(const char *const files[2])
{
    struct recording *recording[2];
    struct take *take[2];
    bool same = true;
    for (int k = 0; k < 2; k++) {
        EXPECT_STATUS(recording_open(&recording[k], scratch_file(&scratch, files[k])), OK);
        EXPECT_STATUS(take_open(&take[k], recording[k], "turn"), OK);
    }
    EXPECT_INT(take_frame_count(take[0]), take_frame_count(take[1]));
    for (int i = 0; i < FRAMES; i++) {
        const struct take_entry *a = take_entry(take[0], i), *b = take_entry(take[1], i);
        same &= !memcmp(&a->skeleton, &b->skeleton, sizeof a->skeleton);
        assert_memory_equal(&a->world_from_camera, &b->world_from_camera, sizeof a->world_from_camera);
    }
    if (same)
        assert_memory_equal(take_body(take[0])->radius_rate, take_body(take[1])->radius_rate,
                            sizeof take_body(take[0])->radius_rate);
    for (int k = 0; k < 2; k++) {
        take_close(&take[k]);
        recording_free(&recording[k]);
    }
    return same;
}

static void test_two_runs_give_the_same_joints(void **state)
{
    (void)state;
    record("b.reenact", &place, OK);
    EXPECT_TRUE(have_same_joints((const char *const[2]){"a.reenact", "b.reenact"})); // the first is there already
}

// With the networks: every third image is looked at, twice the same, and the joints stay near the truth. Without them:
// as without body points, and it is said.
static void test_body_points_from_colour(void **state)
{
    (void)state;
    with_body_points = true;
    struct recorder_result result = record("p.reenact", &place, OK);
    EXPECT_INT(result.frames, FRAMES);
    EXPECT_INT(result.tracked, FRAMES);
    if (*result.no_body_points) {
        print_message("%s\n", result.no_body_points);
        EXPECT_INT(result.looked, 0);
        EXPECT_TRUE(have_same_joints((const char *const[2]){"a.reenact", "p.reenact"}));
    } else {
        EXPECT_INT(result.looked, (FRAMES + 2) / 3);
        record("q.reenact", &place, OK);
        EXPECT_TRUE(have_same_joints((const char *const[2]){"p.reenact", "q.reenact"}));
        EXPECT_TRUE(!have_same_joints((const char *const[2]){"a.reenact", "p.reenact"}));
    }
    with_body_points = false;
}

static void test_nothing_is_located_without_place(void **state)
{
    (void)state;
    struct recorder_result result = record("d.reenact", NULL, OK);
    EXPECT_INT(result.frames, FRAMES);
    EXPECT_INT(result.tracked, FRAMES);
    EXPECT_TRUE(!result.located);
}

static bool stop_immediately(void) { return true; }

static void test_stopped_take_is_complete(void **state)
{
    (void)state;
    struct source *source;
    struct recording_writer *writer;
    struct recorder_options options = {.should_stop = stop_immediately};
    struct recorder_result result;
    struct recording_report report;
    char uri[300];
    snprintf(uri, sizeof uri, "folder:%s", scratch_file(&scratch, "sensor"));
    EXPECT_STATUS(source_open(&source, uri, SOURCE_SENSOR), OK);
    EXPECT_STATUS(recording_create(&writer, scratch_file(&scratch, "e.reenact")), OK);
    EXPECT_STATUS(recorder_run(source, writer, "none", &place, &options, &result), OK);
    EXPECT_INT(result.frames, 0);
    EXPECT_STATUS(recording_close(&writer), OK);
    source_close(&source);
    EXPECT_STATUS(recording_verify(scratch_file(&scratch, "e.reenact"), &report), OK);
    EXPECT_INT(report.interrupted_takes, 0);
}

static struct reader stopping; // whose steps should_stop sees

static bool stop_while_smoothing(void) { return stopping.steps >= FRAMES / 2; }

static void test_smoothing_can_be_stopped(void **state)
{
    (void)state;
    struct source *source;
    struct recording_writer *writer;
    struct recording *recording;
    struct take *take;
    struct recorder_result result;
    char uri[300], path[300];
    snprintf(uri, sizeof uri, "folder:%s", scratch_file(&scratch, "sensor"));
    snprintf(path, sizeof path, "%s", scratch_file(&scratch, "f.reenact"));
    stopping = (struct reader){.path = path};
    struct recorder_options options = {.should_stop = stop_while_smoothing,
                                       .on_smoothing_begin = on_progress,
                                       .on_smoothed = count,
                                       .context = &stopping};
    EXPECT_STATUS(source_open(&source, uri, SOURCE_SENSOR), OK);
    EXPECT_STATUS(recording_create(&writer, path), OK);
    EXPECT_STATUS(recorder_run(source, writer, "turn", &place, &options, &result), OK);
    EXPECT_STATUS(recording_close(&writer), OK);
    source_close(&source);
    EXPECT_INT(result.frames, FRAMES);
    EXPECT_INT(stopping.steps, FRAMES / 2);
    EXPECT_NEAR(result.smoothing_ms, 0, 0);
    EXPECT_STATUS(recording_open(&recording, path), OK);
    EXPECT_STATUS(take_open(&take, recording, "turn"), OK);
    EXPECT_TRUE(take_is_complete(take));
    EXPECT_TRUE(
        !memcmp(&take_entry(take, FRAMES - 1)->skeleton, &stopping.last_skeleton, sizeof stopping.last_skeleton));
    take_close(&take);
    recording_free(&recording);
}

// Smoothing that runs out of memory must not end the recording: the take has all frames and the online joints.
static void test_smoothing_without_memory_keeps_recording(void **state)
{
    (void)state;
    struct source *source;
    struct recording_writer *writer;
    struct recording *recording;
    struct take *take;
    struct recorder_result result;
    char uri[300], path[300];
    snprintf(uri, sizeof uri, "folder:%s", scratch_file(&scratch, "sensor"));
    snprintf(path, sizeof path, "%s", scratch_file(&scratch, "g.reenact"));
    struct reader reader = {.path = path};
    const struct recorder_options options = {
        .on_smoothing_begin = on_progress, .on_smoothed = count, .context = &reader, .smoother_bytes_max = 1};
    EXPECT_STATUS(source_open(&source, uri, SOURCE_SENSOR), OK);
    EXPECT_STATUS(recording_create(&writer, path), OK);
    EXPECT_STATUS(recorder_run(source, writer, "turn", &place, &options, &result), OK);
    EXPECT_STATUS(recording_close(&writer), OK);
    source_close(&source);
    EXPECT_INT(result.frames, FRAMES);
    EXPECT_INT(result.tracked, FRAMES);
    EXPECT_TRUE(result.smoothing_out_of_memory);
    EXPECT_NEAR(result.smoothing_ms, 0, 0);
    EXPECT_INT(reader.announced, 0);
    EXPECT_STATUS(recording_open(&recording, path), OK);
    EXPECT_STATUS(take_open(&take, recording, "turn"), OK);
    EXPECT_TRUE(take_is_complete(take));
    EXPECT_TRUE(
        !memcmp(&take_entry(take, FRAMES - 1)->skeleton, &stopping.last_skeleton, sizeof stopping.last_skeleton));
    take_close(&take);
    recording_free(&recording);
}

static int set_up(void **state)
{
    (void)state;
    struct world_options options = world_default_options();
    options.plain = true;
    options.threads = 2;
    scratch = scratch_make();
    if (world_open(&world, &options) != OK)
        return -1;
    place = film_true_place(world, SCALE);
    film_sensor(world, &scratch, "sensor", SCALE, 0.5, FRAMES);
    return 0;
}

static int tear_down(void **state)
{
    (void)state;
    place_free(&place);
    world_close(&world);
    scratch_remove(&scratch);
    return 0;
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_take_matches_truth),
        cmocka_unit_test(test_two_runs_give_the_same_joints),
        cmocka_unit_test(test_body_points_from_colour),
        cmocka_unit_test(test_nothing_is_located_without_place),
        cmocka_unit_test(test_stopped_take_is_complete),
        cmocka_unit_test(test_smoothing_can_be_stopped),
        cmocka_unit_test(test_smoothing_without_memory_keeps_recording),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
