// What the live screens and the studio's preview show of a person is what a take has of them: the same film through the
// recorder, the live sensor and the studio's session, each as the programs set it up.
//
// The film's first frames are one picture, over which the recorder averages the sensor's pose before it tracks; the
// others begin at once, and then have the same pose. Body points that are found on a thread of their own depend on
// time; the joints are therefore compared without them.
#include "tests/support/test.h"

#include "app/live/live_sensor.h"
#include "app/studio/studio_session.h"
#include "base/clock.h"
#include "capture/follow.h"
#include "capture/recorder.h"
#include "tests/support/film.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { MOVING = 8, FRAMES = SENSOR_POSE_WARM_UP + MOVING };
static const double SCALE = 0.75; // the smallest at which the sensor is located by the world's tags
static const int64_t PATIENCE_NS = INT64_C(120000000000);
static const double FRAME_S = 1 / 30.0;

static struct scratch scratch;
static struct place place;
static char sensor[300], file[300]; // the film; a recording that holds the place

// The joints of each frame, colour camera's axes.
struct joints {
    bool known[FRAMES];
    struct skeleton skeleton[FRAMES];
    int next; // frames that came so far
};

static void keep(struct joints *joints, int64_t number, const struct skeleton *skeleton)
{
    if (number < 1 || number > FRAMES || !skeleton)
        return;
    joints->known[number - 1] = true;
    joints->skeleton[number - 1] = *skeleton;
}

// ---------------------------------------------------------------- the three

static void see(void *context, const struct recorder_seen *seen)
{
    struct joints *joints = context;
    keep(joints, ++joints->next, seen->skeleton);
}

static struct recorder_result record(const struct place *in, bool body_points, struct joints *out)
{
    struct source *source;
    struct recording_writer *writer;
    struct recorder_result result;
    const struct recorder_options options = {.on_seen = see, .context = out, .body_points = body_points};
    *out = (struct joints){0};
    EXPECT_STATUS(source_open(&source, sensor, SOURCE_SENSOR), OK);
    EXPECT_STATUS(recording_create(&writer, scratch_file(&scratch, "take.reenact")), OK);
    EXPECT_STATUS(recorder_run(source, writer, "take", in, &options, &result), OK);
    EXPECT_STATUS(recording_close(&writer), OK);
    EXPECT_INT(remove(scratch_file(&scratch, "take.reenact")), 0);
    source_close(&source);
    return result;
}

static void pause_briefly(void) { clock_sleep_until_ns(clock_now_ns() + 1000000); }

static struct live_sensor *open_live(const struct place *in, bool body_points)
{
    struct live_sensor *s;
    const struct live_sensor_options options = {
        .sensor = sensor, .place = in, .every_frame = true, .no_body_points = !body_points};
    EXPECT_STATUS(live_sensor_open(&s, &options), OK);
    live_sensor_wish(s, &(struct live_wish){.attempt = 1, .run = true});
    return s;
}

static void show_live(const struct place *in, struct joints *out)
{
    struct live_sensor *s = open_live(in, false);
    *out = (struct joints){0};
    const int64_t until_ns = clock_now_ns() + PATIENCE_NS;
    for (bool ended = false; !ended && clock_now_ns() < until_ns;) {
        ended = live_sensor_query(s).ended; // then the last frame is there
        const struct live_frame *frame = live_sensor_latest(s);
        if (frame)
            keep(out, frame->number, frame->look.person ? &frame->look.skeleton : NULL);
        pause_briefly();
    }
    live_sensor_close(&s);
}

static struct studio_session *open_studio(const char *recording, bool body_points)
{
    struct studio_session *s;
    const struct studio_session_options options = {.sensor = sensor, .file = recording, .body_points = body_points};
    EXPECT_STATUS(studio_session_open(&s, &options), OK);
    return s;
}

static void show_preview(const char *recording, struct joints *out)
{
    struct studio_session *s = open_studio(recording, false);
    struct studio_snapshot shown = {0};
    *out = (struct joints){0};
    const int64_t until_ns = clock_now_ns() + PATIENCE_NS;
    while (shown.number < FRAMES && shown.doing != STUDIO_DOING_FAILED && clock_now_ns() < until_ns) {
        if (studio_session_read(s, &shown))
            keep(out, shown.number, shown.has_skeleton ? &shown.skeleton : NULL);
        pause_briefly();
    }
    EXPECT_TRUE(shown.doing == STUDIO_DOING_PREVIEW);
    studio_session_close(&s);
    studio_snapshot_free(&shown);
}

// ---------------------------------------------------------------- the same joints

// The largest distance between the joints that both know, m. Of a busy machine's frames some may not have been shown.
static double compare(const char *name, const struct joints *joints, const struct joints *take)
{
    double max_m = 0;
    int compared = 0;
    for (int i = 0; i < FRAMES; i++) {
        if (!joints->known[i] || !take->known[i])
            continue;
        compared++;
        for (int j = 0; j < JOINT_COUNT; j++)
            max_m = fmax(max_m, v3_distance(joints->skeleton[i].joint[j], take->skeleton[i].joint[j]));
    }
    print_message("%s: %d of %d frames, joints up to %.3g mm from the take's\n", name, compared, FRAMES, 1000 * max_m);
    EXPECT_AT_LEAST(compared, FRAMES / 2);
    return max_m;
}

static void test_all_three_follow_alike(void **state)
{
    (void)state;
    static const double SAME_M = 1e-9, // measured: 0
        OTHER_M = 0.005;               // measured: 32 mm
    struct joints take, joints;
    const struct recorder_result result = record(&place, false, &take);
    EXPECT_TRUE(result.located);
    EXPECT_INT(result.tracked, FRAMES);
    show_live(&place, &joints);
    EXPECT_AT_MOST(compare("live", &joints, &take), SAME_M);
    show_preview(file, &joints);
    EXPECT_AT_MOST(compare("studio's preview", &joints, &take), SAME_M);

    // Without the place the joints are others: had one of them not got it, it would have been seen above.
    record(NULL, false, &joints);
    EXPECT_AT_LEAST(compare("a take without place", &joints, &take), OTHER_M);
    show_preview(scratch_file(&scratch, "none.reenact"), &joints);
    EXPECT_AT_LEAST(compare("studio's preview without place", &joints, &take), OTHER_M);
}

// The folder's first picture stands still for the first frames; one comes every frame_s.
static void hold_first_picture(double frame_s)
{
    static const char *const kinds[2][2] = {{"rgb", "jpg"}, {"depth", "png"}};
    for (int k = 0; k < 2; k++) {
        char list[64 * FRAMES] = "", path[40];
        for (int i = 0; i < FRAMES; i++)
            sprintf(list + strlen(list), "%.6f %s/%04d.%s\n", 50 + i * frame_s, kinds[k][0],
                    i < SENSOR_POSE_WARM_UP ? 0 : i - SENSOR_POSE_WARM_UP + 1, kinds[k][1]);
        snprintf(path, sizeof path, "sensor/%s.txt", kinds[k][0]);
        scratch_text(&scratch, path, list);
    }
}

// Each looks for body points in colour images where that is wanted and the networks are there, else says the same.
static void test_all_three_look_for_body_points(void **state)
{
    (void)state;
    struct joints joints;
    const struct recorder_result result = record(&place, true, &joints);
    const bool there = !*result.no_body_points;
    EXPECT_TRUE((result.looked > 0) == there);

    struct live_sensor *live = open_live(&place, true);
    struct live_sensor_state seen = live_sensor_query(live);
    int64_t until_ns = clock_now_ns() + PATIENCE_NS;
    for (int attempt = 2; !seen.looked && !*seen.no_body_points && clock_now_ns() < until_ns; pause_briefly()) {
        seen = live_sensor_query(live);
        if (seen.ended)
            live_sensor_wish(live, &(struct live_wish){.attempt = attempt++, .run = true});
    }
    live_sensor_close(&live);
    EXPECT_TRUE((seen.looked > 0) == there);
    assert_string_equal(seen.no_body_points, result.no_body_points);

    // A film begins anew at its end, and so does the looking: it must last longer than a busy machine takes for one.
    hold_first_picture(1);
    struct studio_session *studio = open_studio(file, true);
    struct studio_snapshot shown = {0};
    until_ns = clock_now_ns() + PATIENCE_NS;
    for (; !shown.points.looked && !*shown.points.why_not && clock_now_ns() < until_ns; pause_briefly())
        (void)studio_session_read(studio, &shown);
    studio_session_close(&studio);
    hold_first_picture(FRAME_S);
    EXPECT_TRUE((shown.points.looked > 0) == there);
    assert_string_equal(shown.points.why_not, result.no_body_points);
    studio_snapshot_free(&shown);
}

// Points of a frame whose depth was lost are not used for the next one.
static void test_points_without_depth_are_dropped(void **state)
{
    (void)state;
    struct source *source;
    struct frame frame;
    struct skeleton skeleton[2];
    const struct body_points points = {.person = true, .at[BODY_POINT_NOSE] = {10, 10, 1}}; // far from the person
    for (int with = 0; with < 2; with++) {
        struct follower *follower;
        struct followed_frame followed;
        EXPECT_STATUS(source_open(&source, sensor, SOURCE_SENSOR), OK);
        EXPECT_STATUS(follower_open(&follower, source_calibration(source), NULL), OK);
        for (int i = 0; i < 4; i++) {
            EXPECT_STATUS(source_next(source, &frame), OK);
            const struct follower_frame next = {.time_ns = frame.time_ns, .depth = i == 2 ? NULL : frame.depth};
            if (i == 2 && with)
                follower_set_points(follower, frame.time_ns, &points);
            EXPECT_STATUS(follower_next(follower, &next, &followed), OK);
            EXPECT_TRUE(followed.person == (i != 2));
        }
        skeleton[with] = followed.skeleton;
        follower_close(&follower);
        source_close(&source);
    }
    assert_memory_equal(&skeleton[0], &skeleton[1], sizeof skeleton[0]);
}

// ---------------------------------------------------------------- the film

// The true tags, and the empty room as the sensor sees it.
static struct place make_place(const struct world *world)
{
    struct place made = film_true_place(world, SCALE);
    const struct world_shot shot = {made.calibration.color, world_sensor_pose(world), 0, false};
    made.views = calloc(1, sizeof *made.views);
    made.view_count = 1;
    made.views[0].world_from_camera = shot.world_from_camera;
    made.views[0].depth = malloc(sizeof *made.views[0].depth * lens_pixels(&made.calibration.depth));
    EXPECT_STATUS(world_render(world, &shot, &(struct world_image){.depth = made.views[0].depth}), OK);
    return made;
}

static int make(void **state)
{
    (void)state;
    struct world *world;
    struct recording_writer *writer;
    struct recording *recording;
    struct world_options options = world_default_options();
    options.motion = "exercise";
    options.threads = 2;
    scratch = scratch_make();
    snprintf(sensor, sizeof sensor, "folder:%s", scratch_file(&scratch, "sensor"));
    snprintf(file, sizeof file, "%s", scratch_file(&scratch, "place.reenact"));
    EXPECT_STATUS(world_open(&world, &options), OK);
    film_sensor(world, &scratch, "sensor", SCALE, 0.5, 1 + MOVING);
    hold_first_picture(FRAME_S);
    struct place made = make_place(world);
    EXPECT_STATUS(recording_create(&writer, file), OK);
    EXPECT_STATUS(recording_put_place(writer, &made), OK);
    EXPECT_STATUS(recording_close(&writer), OK);
    EXPECT_STATUS(recording_open(&recording, file), OK);
    EXPECT_STATUS(recording_read_place(recording, &place), OK);
    recording_free(&recording);
    place_free(&made);
    world_close(&world);
    return 0;
}

static int tidy(void **state)
{
    (void)state;
    place_free(&place);
    scratch_remove(&scratch);
    return 0;
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_all_three_follow_alike),
                                       cmocka_unit_test(test_all_three_look_for_body_points),
                                       cmocka_unit_test(test_points_without_depth_are_dropped)};
    return cmocka_run_group_tests(tests, make, tidy);
}
