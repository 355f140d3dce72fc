// A jump along the timeline, while nothing plays: the actor is drawn at once, in his posture there, with whatever
// frame's colours and folds there are; and his own follow as soon as they are loaded.
#include "tests/support/test.h"

#include "base/clock.h"
#include "tests/support/glass.h"
#include "tests/support/rehearsal.h"

static struct rehearsal rehearsal;
static struct glass glass;

static int64_t frames(void) { return take_view_frames(glass.viewer.take_view); }

static int64_t made(void) { return gpu_get_counts(glass.gpu).made; }

// Goes there and draws one picture; how much had to be made for it.
static int64_t jump(int64_t frame)
{
    const int64_t before = made();
    glass_seek(&glass, (double)frame / (double)(frames() - 1));
    glass_draw(&glass);
    EXPECT_INT(glass.viewer.image.frame, frame);
    EXPECT_AT_LEAST(glass.viewer.image.parts, 8);
    EXPECT_TRUE(glass.viewer.image.prepared);
    return made() - before;
}

// Until nothing is to come any more. Only what changes is drawn.
static void wait_idle(void)
{
    const int64_t until = clock_now_ns() + 20000000000;
    struct viewer *t = &glass.viewer;
    while (take_view_waiting(t->take_view) && clock_now_ns() < until) {
        const int64_t now = clock_now_ns(), next = viewer_update(t, now);
        EXPECT_AT_MOST(next - now, 100000000); // whoever waits for what is due looks again soon
        if (!take_view_final(t->take_view))
            glass_draw(&glass);
        else
            clock_sleep_until_ns(next);
    }
    EXPECT_TRUE(!take_view_waiting(t->take_view) && take_view_final(t->take_view));
}

static void test_substitute_frame_until_loaded(void **state)
{
    (void)state;
    const int64_t last = frames() - 1, before = made();
    EXPECT_INT(jump(last), 0);
    EXPECT_TRUE(take_view_waiting(glass.viewer.take_view));
    wait_idle();
    EXPECT_INT(made() - before, 2); // the frame's colours and depth
    EXPECT_INT(jump(0), 0);
    EXPECT_TRUE(!take_view_waiting(glass.viewer.take_view)); // it is kept
    EXPECT_INT(jump(last), 0);
    EXPECT_TRUE(!take_view_waiting(glass.viewer.take_view));
}

// Whoever moves a finger along it sees every picture at once; where it comes to rest, the right one.
static void test_timeline_scrub_does_not_block(void **state)
{
    (void)state;
    for (int64_t i = 1; i < frames() - 1; i++)
        jump(i);
    wait_idle();
    EXPECT_INT(jump(frames() - 2), 0);
    EXPECT_TRUE(!take_view_waiting(glass.viewer.take_view));
}

// Who asks where his colours are from gets those of that very frame.
static void test_source_textures_match_frame(void **state)
{
    (void)state;
    struct glass *g = &glass;
    struct take_view_image *p = &g->viewer.image;
    g->viewer.state.sources = true;
    glass_draw(g);
    EXPECT_TRUE(p->sources);
    for (int64_t i = 0; i < frames(); i++) {
        jump(i);
        EXPECT_TRUE(!take_view_waiting(g->viewer.take_view));
    }
    g->viewer.state.sources = false;
}

// Prepared, and at rest on the first frame.
static int make(void **state)
{
    (void)state;
    rehearsal = rehearsal_make();
    const struct viewer_options how = {.file = rehearsal.file, .refresh_hz = 60, .fixed_resolution = true};
    glass_open(&glass, GLASS_LONG / 2, GLASS_SHORT / 2, &how);
    view_state_choose_take(&glass.viewer.state, 0);
    glass_draw(&glass);
    glass_seek(&glass, 0);
    glass_prepare(&glass);
    glass_wait_idle(&glass);
    return 0;
}

static int end(void **state)
{
    (void)state;
    glass_close(&glass);
    rehearsal_end(&rehearsal);
    return 0;
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_substitute_frame_until_loaded),
        cmocka_unit_test(test_timeline_scrub_does_not_block),
        cmocka_unit_test(test_source_textures_match_frame),
    };
    return cmocka_run_group_tests(tests, make, end);
}
