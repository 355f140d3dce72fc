// The camera's and the finder's threads: pictures come with their places, the newest
// wins, and a camera that fails is tried again.
#include "tests/support/test.h"

#include "app/camera/camera_feed.h"
#include "app/camera/mailbox.h"
#include "app/state/frame_skip.h"
#include "base/clock.h"
#include "tests/support/rehearsal.h"

#include <pthread.h>
#include <stdio.h>
#include <string.h>

static struct scratch scratch;
static struct world *world;
static struct place place;

static const char *uri(const char *name)
{
    static char text[300];
    snprintf(text, sizeof text, "folder:%s", scratch_file(&scratch, name));
    return text;
}

// The first sight with a number above `after`, within ten seconds.
static const struct sight *wait_for_sight(struct eyes *e, int64_t after)
{
    for (int i = 0; i < 1000; i++) {
        const struct sight *s = eyes_look(e);
        if (s && s->number > after)
            return s;
        clock_sleep_until_ns(clock_now_ns() + 10000000);
    }
    return NULL;
}

static void test_pictures_come_with_their_places(void **state)
{
    (void)state;
    struct eyes *e;
    const struct eyes_options options = {uri("viewer"), &place, NULL, NULL, false};
    EXPECT_STATUS(eyes_open(&e, &options), OK);
    int64_t last = 0;
    for (int i = 0; i < 6; i++) { // round and round: the folder has fewer
        const struct sight *s = wait_for_sight(e, last);
        assert_non_null(s);
        EXPECT_TRUE(s->placed);
        EXPECT_TRUE(s->came_ns <= s->locating_ns && s->locating_ns <= s->located_ns);
        // Which of the folder's pictures it is tells where it was taken from.
        double nearest = 1e9;
        for (int k = 0; k < REHEARSAL_PICTURES; k++)
            nearest = fmin(
                nearest, v3_distance(s->world_from_camera.translation, world_viewer_pose(world, 0.8 * k).translation));
        EXPECT_AT_MOST(nearest, 0.05);
        last = s->number;
    }
    EXPECT_TRUE(eyes_state(e).seeing && !*eyes_state(e).trouble);
    eyes_close(&e);
}

// Guessed a sixth too short, the focal length is learnt, and the pictures come with it.
static void test_a_guessed_lens_is_learnt(void **state)
{
    (void)state;
    const struct lens right = world_viewer_calibration(1).color;
    struct lens guess = right;
    guess.fx *= 0.85;
    guess.fy *= 0.85;
    guess.focal_sigma = 0.15;
    rehearse_lens(&scratch, "viewer", &guess);
    struct eyes *e;
    const struct eyes_options options = {uri("viewer"), &place, NULL, NULL, false};
    EXPECT_STATUS(eyes_open(&e, &options), OK);
    double off = 1;
    int64_t last = 0;
    for (int i = 0; i < 60 && fabs(off) > 0.01; i++) {
        const struct sight *s = wait_for_sight(e, last);
        assert_non_null(s);
        last = s->number;
        off = s->placed ? s->lens.fx / right.fx - 1 : off;
    }
    printf("learnt to %+.2f %% in %d pictures\n", off * 100, (int)last);
    EXPECT_AT_MOST(fabs(off), 0.01);
    eyes_close(&e);
    rehearse_lens(&scratch, "viewer", &right);
}

static void test_without_a_place_pictures_come_all_the_same(void **state)
{
    (void)state;
    struct eyes *e;
    const struct eyes_options options = {uri("small"), NULL, NULL, NULL, false};
    EXPECT_STATUS(eyes_open(&e, &options), OK);
    const struct sight *s = wait_for_sight(e, 3);
    assert_non_null(s);
    EXPECT_TRUE(!s->placed && s->rgb);
    EXPECT_INT(s->lens.width, 160);
    eyes_close(&e);
}

static void test_a_camera_is_tried_again_until_it_is_there(void **state)
{
    (void)state;
    struct eyes *e;
    char missing[300];
    snprintf(missing, sizeof missing, "%s", uri("later"));
    const struct eyes_options options = {missing, &place, NULL, NULL, false};
    EXPECT_STATUS(eyes_open(&e, &options), OK);
    for (int i = 0; i < 500 && !*eyes_state(e).trouble; i++)
        clock_sleep_until_ns(clock_now_ns() + 10000000);
    EXPECT_TRUE(strstr(eyes_state(e).trouble, "later"));
    EXPECT_TRUE(!eyes_look(e));
    rehearse_camera(&scratch, "later", NULL, 0.25);
    assert_non_null(wait_for_sight(e, 0));
    EXPECT_TRUE(!*eyes_state(e).trouble);
    // It is pulled, and comes back with pictures of another size.
    EXPECT_INT(rename(scratch_file(&scratch, "later"), scratch_file(&scratch, "pulled")), 0);
    for (int i = 0; i < 500 && !*eyes_state(e).trouble; i++)
        clock_sleep_until_ns(clock_now_ns() + 10000000);
    EXPECT_TRUE(*eyes_state(e).trouble);
    EXPECT_TRUE(!eyes_state(e).seeing);
    int64_t came = eyes_state(e).came;
    rehearse_camera(&scratch, "later", NULL, 0.5);
    const struct sight *s = wait_for_sight(e, came);
    assert_non_null(s);
    EXPECT_INT(s->lens.width, 320);
    eyes_close(&e);
}

static void test_closed_eyes_see_nothing(void **state)
{
    (void)state;
    struct eyes *e;
    const struct eyes_options options = {uri("small"), NULL, NULL, NULL, false};
    EXPECT_STATUS(eyes_open(&e, &options), OK);
    assert_non_null(wait_for_sight(e, 0));
    eyes_rest(e, true);
    clock_sleep_until_ns(clock_now_ns() + 300000000);
    int64_t came = eyes_state(e).came;
    clock_sleep_until_ns(clock_now_ns() + 300000000);
    EXPECT_INT(eyes_state(e).came, came);
    eyes_rest(e, false);
    assert_non_null(wait_for_sight(e, came));
    eyes_close(&e);
    eyes_close(&e); // NULL is fine
}

static void test_a_picture_that_was_overtaken_is_passed_over(void **state)
{
    (void)state;
    struct pace p = {0};
    EXPECT_TRUE(!pace_passes_over(&p, 80, true, true)); // the first is shown, however long it took
    p = (struct pace){0};
    for (int i = 0; i < 10; i++)
        EXPECT_TRUE(!pace_passes_over(&p, 9 + i % 2, true, true)); // behind as ever: what is there is shown
    EXPECT_NEAR(p.typical_ms, 9.5, 0.5);
    struct pace as_ever = p;
    EXPECT_TRUE(!pace_passes_over(&p, 70, true, false)); // nothing newer is there
    p = as_ever;
    EXPECT_TRUE(!pace_passes_over(&p, 70, false, true)); // the next would not be found quickly
    p = as_ever;
    EXPECT_TRUE(pace_passes_over(&p, 70, true, true));
    EXPECT_TRUE(!pace_passes_over(&p, 700, true, true)); // never two in a row
    p = as_ever;
    int shown = 0; // and where everything takes long from now on, that is soon as usual
    for (int i = 0; i < 20; i++)
        shown += !pace_passes_over(&p, 70, true, true);
    EXPECT_AT_LEAST(shown, 18);
}

// ---------------------------------------------------------------- the place for one thing

enum { ITEMS = 20000 };

static void *take_all(void *self)
{
    struct latest *l = self;
    int64_t last = 0;
    for (int *item; (item = latest_take(l, true));) {
        if (*item <= last)
            return self; // older than one before
        last = *item;
        if (last == ITEMS)
            return NULL;
    }
    return self;
}

static void test_the_newest_wins_and_nothing_is_lost_unseen(void **state)
{
    (void)state;
    static int items[ITEMS];
    struct latest *l;
    pthread_t thread;
    EXPECT_STATUS(latest_open(&l), OK);
    EXPECT_TRUE(!latest_waits(l) && !latest_take(l, false));
    assert_int_equal(pthread_create(&thread, NULL, take_all, l), 0);
    for (int i = 0; i < ITEMS; i++) {
        items[i] = i + 1;
        const int *untaken = latest_put(l, &items[i]);
        EXPECT_TRUE(!untaken || untaken == &items[i - 1]);
    }
    void *wrong;
    pthread_join(thread, &wrong);
    EXPECT_TRUE(!wrong);
    latest_stop(l);
    EXPECT_TRUE(!latest_take(l, true));
    latest_close(&l);
}

static int set_up(void **state)
{
    (void)state;
    struct world_options options = world_default_options();
    options.plain = true;
    scratch = scratch_make();
    if (world_open(&world, &options) != OK)
        return -1;
    place = film_true_place(world, 1);
    rehearse_camera(&scratch, "viewer", world, 1);
    rehearse_camera(&scratch, "small", NULL, 0.25);
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
        cmocka_unit_test(test_pictures_come_with_their_places),
        cmocka_unit_test(test_a_guessed_lens_is_learnt),
        cmocka_unit_test(test_without_a_place_pictures_come_all_the_same),
        cmocka_unit_test(test_a_camera_is_tried_again_until_it_is_there),
        cmocka_unit_test(test_closed_eyes_see_nothing),
        cmocka_unit_test(test_a_picture_that_was_overtaken_is_passed_over),
        cmocka_unit_test(test_the_newest_wins_and_nothing_is_lost_unseen),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
