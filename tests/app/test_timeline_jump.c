// A jump along the timeline, while nothing plays: the actor is drawn at once, in his posture there, with whatever
// frame's colours and folds there are; and his own follow as soon as they are loaded.
#include "tests/support/test.h"

#include "base/clock.h"
#include "tests/support/glass.h"
#include "tests/support/rehearsal.h"

static struct rehearsal rehearsal;
static struct glass glass;

static int64_t frames(void) { return stage_frames(glass.tablet.stage); }

static int64_t made(void) { return gpu_count(glass.gpu).made; }

// Goes there and draws one picture; how much had to be made for it.
static int64_t jump(int64_t frame)
{
    const int64_t before = made();
    glass_seek(&glass, (double)frame / (double)(frames() - 1));
    glass_draw(&glass);
    EXPECT_INT(glass.tablet.picture.frame, frame);
    EXPECT_AT_LEAST(glass.tablet.picture.parts, 8);
    EXPECT_TRUE(glass.tablet.picture.prepared);
    return made() - before;
}

// Until nothing is to come any more. Only what changes is drawn.
static void rest(void)
{
    const int64_t until = clock_now_ns() + 20000000000;
    struct tablet *t = &glass.tablet;
    while (stage_awaits(t->stage) && clock_now_ns() < until) {
        const int64_t now = clock_now_ns(), next = tablet_update(t, now);
        EXPECT_AT_MOST(next - now, 100000000); // whoever waits for what is due looks again soon
        if (!stage_settled(t->stage))
            glass_draw(&glass);
        else
            clock_sleep_until_ns(next);
    }
    EXPECT_TRUE(!stage_awaits(t->stage) && stage_settled(t->stage));
}

static void another_frame_is_drawn_until_its_own_is_there(void **state)
{
    (void)state;
    const int64_t last = frames() - 1, before = made();
    EXPECT_INT(jump(last), 0);
    EXPECT_TRUE(stage_awaits(glass.tablet.stage));
    rest();
    EXPECT_INT(made() - before, 2); // the frame's colours and depth
    EXPECT_INT(jump(0), 0);
    EXPECT_TRUE(!stage_awaits(glass.tablet.stage)); // it is kept
    EXPECT_INT(jump(last), 0);
    EXPECT_TRUE(!stage_awaits(glass.tablet.stage));
}

// Whoever moves a finger along it sees every picture at once; where it comes to rest, the right one.
static void a_finger_along_the_timeline_waits_for_nothing(void **state)
{
    (void)state;
    for (int64_t i = 1; i < frames() - 1; i++)
        jump(i);
    rest();
    EXPECT_INT(jump(frames() - 2), 0);
    EXPECT_TRUE(!stage_awaits(glass.tablet.stage));
}

// Who asks where his colours are from gets those of that very frame.
static void sources_are_of_the_frame_itself(void **state)
{
    (void)state;
    struct glass *g = &glass;
    struct stage_picture *p = &g->tablet.picture;
    g->tablet.show.sources = true;
    glass_draw(g);
    EXPECT_TRUE(p->sources);
    for (int64_t i = 0; i < frames(); i++) {
        jump(i);
        EXPECT_TRUE(!stage_awaits(g->tablet.stage));
    }
    g->tablet.show.sources = false;
}

// Prepared, and at rest on the first frame.
static int make(void **state)
{
    (void)state;
    rehearsal = rehearsal_make();
    const struct tablet_options how = {.file = rehearsal.file, .refresh_hz = 60, .fixed_fineness = true};
    glass_open(&glass, GLASS_LONG / 2, GLASS_SHORT / 2, &how);
    show_choose(&glass.tablet.show, 0);
    glass_draw(&glass);
    glass_seek(&glass, 0);
    glass_prepare(&glass);
    glass_rest(&glass);
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
        cmocka_unit_test(another_frame_is_drawn_until_its_own_is_there),
        cmocka_unit_test(a_finger_along_the_timeline_waits_for_nothing),
        cmocka_unit_test(sources_are_of_the_frame_itself),
    };
    return cmocka_run_group_tests(tests, make, end);
}
