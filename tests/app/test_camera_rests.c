// The camera is read only while its images change the screen: not while the take is paused and the actor stands in the
// last image, nor while the user walks round by hand. Then the app needs next to no processor time.
#include "tests/support/test.h"

#include "base/clock.h"
#include "tests/support/glass.h"
#include "tests/support/rehearsal.h"

#include <time.h>

static struct rehearsal rehearsal;
static struct glass glass;

static int64_t received(void) { return viewer_feed_state(glass.viewer).received; }

// As the program's loop: draws what changes, else sleeps. Returns the processor's share.
static double run(double seconds)
{
    const int64_t began = clock_now_ns(), until = began + (int64_t)(seconds * 1e9);
    const clock_t used = clock();
    for (int64_t now; (now = clock_now_ns()) < until;) {
        const int64_t next = viewer_update(glass.viewer, now), frame = now + 33000000;
        if (glass.state->changed)
            glass_draw(&glass);
        else
            clock_sleep_until_ns(next < frame ? frame : next < until ? next : until);
    }
    return (double)(clock() - used) / CLOCKS_PER_SEC / ((double)(clock_now_ns() - began) * 1e-9);
}

// Images stop coming, and come again. share: of a processor, at most, meanwhile.
static void expect_rest(const char *what)
{
    run(1.5);
    EXPECT_TRUE(viewer_camera_rests(glass.viewer));
    const int64_t before = received();
    const double share = run(1);
    print_message("%s: %.1f %% of a processor, %lld images\n", what, 100 * share, (long long)(received() - before));
    EXPECT_INT(received() - before, 0);
    EXPECT_AT_MOST(share, 0.03);
    EXPECT_TRUE(!view_state_hint(glass.state)); // nothing says that the camera is lost
}

static void test_paused(void **state)
{
    (void)state;
    view_state_do(glass.state, DO_PLAY_PAUSE, clock_now_ns());
    EXPECT_TRUE(!glass.state->playback.playing);
    expect_rest("paused");
    EXPECT_TRUE(!glass.state->orbiting);
    EXPECT_AT_LEAST(glass.image->parts, 8); // in the last image
    const int64_t before = received();
    view_state_do(glass.state, DO_PLAY_PAUSE, clock_now_ns());
    run(2);
    EXPECT_TRUE(!viewer_camera_rests(glass.viewer));
    EXPECT_AT_LEAST(received() - before, 1);
}

static void test_walking_round_paused(void **state)
{
    (void)state;
    view_state_do(glass.state, DO_PLAY_PAUSE, clock_now_ns());
    view_state_do(glass.state, DO_ORBIT, clock_now_ns());
    EXPECT_TRUE(glass.state->orbit_requested);
    expect_rest("walking round");
    view_state_do(glass.state, DO_ORBIT, clock_now_ns());
    view_state_do(glass.state, DO_PLAY_PAUSE, clock_now_ns());
}

static int set_up(void **state)
{
    (void)state;
    rehearsal = rehearsal_make();
    const struct viewer_options options = {
        .file = rehearsal.file, .take = "turn", .camera = rehearsal.camera, .refresh_hz = 60};
    glass_open(&glass, GLASS_LONG / 2, GLASS_SHORT / 2, &options);
    glass_prepare(&glass);
    glass_wait_located(&glass, true);
    if (!glass.state->playback.playing)
        view_state_do(glass.state, DO_PLAY_PAUSE, clock_now_ns());
    return 0;
}

static int tear_down(void **state)
{
    (void)state;
    glass_close(&glass);
    rehearsal_end(&rehearsal);
    return 0;
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_paused),
        cmocka_unit_test(test_walking_round_paused),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
