// A jump along the timeline while paused: the actor is drawn immediately in the pose of that instant, with the texture
// and deformation of any resident frame; the frame's own follow as soon as they are loaded.
#include "tests/support/test.h"

#include "base/clock.h"
#include "tests/support/glass.h"
#include "tests/support/rehearsal.h"

static struct rehearsal rehearsal;
static struct glass glass;

static int64_t frames(void) { return take_view_frames(viewer_take_view(glass.viewer)); }

static int64_t uploads(void) { return gpu_get_counts(glass.gpu).made; }

// Seeks to that recorded frame and draws; returns how many GPU objects were made for it.
static int64_t jump(int64_t frame)
{
    const int64_t before = uploads();
    glass_seek(&glass, (double)frame / (double)(frames() - 1));
    glass_draw(&glass);
    EXPECT_INT(glass.image->frame, frame);
    EXPECT_AT_LEAST(glass.image->parts, 8);
    EXPECT_TRUE(glass.image->prepared);
    return uploads() - before;
}

// Until nothing is being loaded any more. Draws only what changes.
static void wait_idle(void)
{
    const int64_t until = clock_now_ns() + 20000000000;
    while (take_view_waiting(viewer_take_view(glass.viewer)) && clock_now_ns() < until) {
        const int64_t now = clock_now_ns(), next = viewer_update(glass.viewer, now);
        EXPECT_AT_MOST(next - now, 100000000); // loading is polled soon
        if (!take_view_final(viewer_take_view(glass.viewer)))
            glass_draw(&glass);
        else
            clock_sleep_until_ns(next);
    }
    EXPECT_TRUE(!take_view_waiting(viewer_take_view(glass.viewer)) && take_view_final(viewer_take_view(glass.viewer)));
}

static void test_substitute_frame_until_loaded(void **state)
{
    (void)state;
    const int64_t last = frames() - 1, before = uploads();
    EXPECT_INT(jump(last), 0);
    EXPECT_TRUE(take_view_waiting(viewer_take_view(glass.viewer)));
    wait_idle();
    EXPECT_INT(uploads() - before, 2); // the frame's colour and depth
    EXPECT_INT(jump(0), 0);
    EXPECT_TRUE(!take_view_waiting(viewer_take_view(glass.viewer))); // it is still resident
    EXPECT_INT(jump(last), 0);
    EXPECT_TRUE(!take_view_waiting(viewer_take_view(glass.viewer)));
}

// While a finger moves along it, every frame is drawn immediately; where it stops, with its own texture.
static void test_timeline_scrub_does_not_block(void **state)
{
    (void)state;
    for (int64_t i = 1; i < frames() - 1; i++)
        jump(i);
    wait_idle();
    EXPECT_INT(jump(frames() - 2), 0);
    EXPECT_TRUE(!take_view_waiting(viewer_take_view(glass.viewer)));
}

// The display of sources is never drawn with another frame's texture.
static void test_source_textures_match_frame(void **state)
{
    (void)state;
    struct glass *g = &glass;
    const struct take_view_image *p = g->image;
    g->state->sources = true;
    glass_draw(g);
    EXPECT_TRUE(p->sources);
    for (int64_t i = 0; i < frames(); i++) {
        jump(i);
        EXPECT_TRUE(!take_view_waiting(viewer_take_view(g->viewer)));
    }
    g->state->sources = false;
}

// With the avatar built, paused on the first frame.
static int make(void **state)
{
    (void)state;
    rehearsal = rehearsal_make();
    const struct viewer_options options = {.file = rehearsal.file, .refresh_hz = 60, .fixed_resolution = true};
    glass_open(&glass, GLASS_LONG / 2, GLASS_SHORT / 2, &options);
    view_state_choose_take(glass.state, 0);
    glass_draw(&glass);
    glass_seek(&glass, 0);
    glass.state->detail = DETAIL_FULL; // whatever is good enough at this size
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
