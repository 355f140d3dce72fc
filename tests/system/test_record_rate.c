// A 30 Hz sensor recorded with the preview beside: frames dropped, and how old the picture is that the preview shows.
// Prints; a busy machine fails nothing.
//
//     test_record_rate            three seconds
//     test_record_rate SECONDS    so many: on two idle cores none should be dropped, and the preview at most two behind
#include "tests/support/test.h"

#include "app/studio/studio_session.h"
#include "base/clock.h"
#include "tests/openni_driver/keep_player.h"
#include "tests/support/film.h"

#include <stdio.h>

static double wanted_s = 3;
static const double FRAME_S = 1 / 30.0;

static void film_for_the_sensor(struct scratch *scratch, int frames)
{
    struct world *world;
    struct world_options o = world_default_options();
    o.motion = "kata";
    o.plain = true;
    o.threads = 2;
    EXPECT_STATUS(world_open(&world, &o), OK);
    *scratch = scratch_make();
    film_sensor(world, scratch, "sensor", 1, 0.8, frames);
    world_close(&world);
}

static void wait_until(struct studio_session *s, struct studio_snapshot *shown, int64_t number, int takes)
{
    const int64_t until = clock_now_ns() + 120 * (int64_t)1000000000;
    while ((shown->number < number || shown->takes_ready < takes) && clock_now_ns() < until) {
        status_ignore(studio_session_read(s, shown));
        clock_sleep_until_ns(clock_now_ns() + 5000000);
    }
    EXPECT_TRUE(shown->number >= number && shown->takes_ready >= takes);
}

static void test_thirty_frames_a_second(void **state)
{
    (void)state;
    struct scratch scratch;
    struct studio_session *session;
    static struct studio_snapshot shown;
    film_for_the_sensor(&scratch, wanted_s > 10 ? 60 : 15);
    setenv("REENACT_FAKE_SENSOR", scratch_file(&scratch, "sensor"), 1);
    setenv("REENACT_FAKE_SENSOR_FPS", "30", 1);
    setenv("REENACT_FAKE_SENSOR_AT_END", "loop", 1);
    char file[300];
    snprintf(file, sizeof file, "%s", scratch_file(&scratch, "film.reenact"));
    const struct studio_session_options options = {.sensor = "openni", .file = file};
    EXPECT_STATUS(studio_session_open(&session, &options), OK);
    wait_until(session, &shown, 5, 0);
    studio_session_begin(session, "take");
    const int64_t until = clock_now_ns() + (int64_t)((wanted_s + 1) * 1e9);
    double sum_s = 0, max_s = 0, late = 0, skeleton_s = 0;
    int64_t shown_ns = 0, longest_ns = 0;
    int64_t reads = 0;
    while (clock_now_ns() < until) {
        if (studio_session_read(session, &shown) && shown.counters.frames > 15) { // after the sensor's first second
            const double behind_s = shown.counters.behind_s;
            const int64_t now_ns = clock_now_ns();
            longest_ns = shown_ns && now_ns - shown_ns > longest_ns ? now_ns - shown_ns : longest_ns;
            shown_ns = now_ns;
            skeleton_s += shown.counters.skeleton_behind_s;
            sum_s += behind_s;
            max_s = fmax(max_s, behind_s);
            late += behind_s > 2 * FRAME_S;
            reads++;
        }
        clock_sleep_until_ns(clock_now_ns() + 4000000);
    }
    const struct studio_counters counters = shown.counters;
    studio_session_end(session);
    wait_until(session, &shown, 1, 1);
    EXPECT_TRUE(!*shown.failure && shown.judgement.frames > 0 && reads > 0);
    printf("%.0f s: %lld frames, %lld dropped, %.1f MB/s; preview behind by %.1f frames on average, %.1f at most, by "
           "more than two in %.1f %% of %lld, the longest wait for a picture %.0f ms; skeleton by %.1f frames on "
           "average\n",
           wanted_s, (long long)shown.judgement.frames, (long long)counters.dropped, counters.mb_per_s,
           sum_s / (double)reads / FRAME_S, max_s / FRAME_S, 100 * late / (double)reads, (long long)reads,
           (double)longest_ns * 1e-6, skeleton_s / (double)reads / FRAME_S);
    studio_session_close(&session);
    studio_snapshot_free(&shown);
    scratch_remove(&scratch);
}

int main(int argc, char **argv)
{
    keep_player();
    wanted_s = argc > 1 ? atof(argv[1]) : wanted_s;
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_thirty_frames_a_second)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
