// The camera's and the localizer's threads: images come with their poses, the newest wins, and a camera that fails is
// opened again.
#include "tests/support/test.h"

#include "app/camera/camera_feed.h"
#include "app/state/frame_times.h"
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

// The first frame with a number above `after`, within ten seconds.
static const struct camera_frame *wait_for_image(struct camera_feed *f, int64_t after)
{
    for (int i = 0; i < 1000; i++) {
        const struct camera_frame *s = camera_feed_latest(f);
        if (s && s->number > after)
            return s;
        clock_sleep_until_ns(clock_now_ns() + 10000000);
    }
    return NULL;
}

static void test_images_come_with_poses(void **state)
{
    (void)state;
    struct camera_feed *f;
    const struct camera_feed_options options = {uri("viewer"), &place, NULL, NULL, false};
    EXPECT_STATUS(camera_feed_open(&f, &options), OK);
    int64_t last = 0;
    for (int i = 0; i < 6; i++) { // in a loop: the folder has fewer
        const struct camera_frame *s = wait_for_image(f, last);
        assert_non_null(s);
        EXPECT_TRUE(s->placed);
        EXPECT_TRUE(s->received_ns <= s->locating_ns && s->locating_ns <= s->located_ns);
        // The pose is that of one of the folder's images.
        double nearest = 1e9;
        for (int k = 0; k < REHEARSAL_IMAGES; k++)
            nearest = fmin(
                nearest, v3_distance(s->world_from_camera.translation, world_viewer_pose(world, 0.8 * k).translation));
        EXPECT_AT_MOST(nearest, 0.05);
        last = s->number;
    }
    EXPECT_TRUE(camera_feed_query(f).seeing && !*camera_feed_query(f).trouble);
    camera_feed_close(&f);
}

// A focal length guessed 15 % too short is estimated, and the frames come with it.
static void test_guessed_lens_is_estimated(void **state)
{
    (void)state;
    const struct lens right = world_viewer_calibration(1).color;
    struct lens guess = right;
    guess.fx *= 0.85;
    guess.fy *= 0.85;
    guess.focal_sigma = 0.15;
    rehearse_lens(&scratch, "viewer", &guess);
    struct camera_feed *f;
    const struct camera_feed_options options = {uri("viewer"), &place, NULL, NULL, false};
    EXPECT_STATUS(camera_feed_open(&f, &options), OK);
    double off = 1;
    int64_t last = 0;
    for (int i = 0; i < 60 && fabs(off) > 0.01; i++) {
        const struct camera_frame *s = wait_for_image(f, last);
        assert_non_null(s);
        last = s->number;
        off = s->placed ? s->lens.fx / right.fx - 1 : off;
    }
    printf("estimated to %+.2f %% in %d images\n", off * 100, (int)last);
    EXPECT_AT_MOST(fabs(off), 0.01);
    camera_feed_close(&f);
    rehearse_lens(&scratch, "viewer", &right);
}

static void test_images_without_place(void **state)
{
    (void)state;
    struct camera_feed *f;
    const struct camera_feed_options options = {uri("small"), NULL, NULL, NULL, false};
    EXPECT_STATUS(camera_feed_open(&f, &options), OK);
    const struct camera_frame *s = wait_for_image(f, 3);
    assert_non_null(s);
    EXPECT_TRUE(!s->placed && s->rgb);
    EXPECT_INT(s->lens.width, 160);
    camera_feed_close(&f);
}

static void test_missing_camera_is_retried(void **state)
{
    (void)state;
    struct camera_feed *f;
    char missing[300];
    snprintf(missing, sizeof missing, "%s", uri("later"));
    const struct camera_feed_options options = {missing, &place, NULL, NULL, false};
    EXPECT_STATUS(camera_feed_open(&f, &options), OK);
    for (int i = 0; i < 500 && !*camera_feed_query(f).trouble; i++)
        clock_sleep_until_ns(clock_now_ns() + 10000000);
    EXPECT_TRUE(strstr(camera_feed_query(f).trouble, "later"));
    EXPECT_TRUE(!camera_feed_latest(f));
    rehearse_camera(&scratch, "later", NULL, 0.25);
    assert_non_null(wait_for_image(f, 0));
    EXPECT_TRUE(!*camera_feed_query(f).trouble);
    // It is unplugged, and comes back with images of another size.
    EXPECT_INT(rename(scratch_file(&scratch, "later"), scratch_file(&scratch, "pulled")), 0);
    for (int i = 0; i < 500 && !*camera_feed_query(f).trouble; i++)
        clock_sleep_until_ns(clock_now_ns() + 10000000);
    EXPECT_TRUE(*camera_feed_query(f).trouble);
    EXPECT_TRUE(!camera_feed_query(f).seeing);
    int64_t received = camera_feed_query(f).received;
    rehearse_camera(&scratch, "later", NULL, 0.5);
    const struct camera_frame *s = wait_for_image(f, received);
    assert_non_null(s);
    EXPECT_INT(s->lens.width, 320);
    camera_feed_close(&f);
}

static void test_suspended_feed_delivers_nothing(void **state)
{
    (void)state;
    struct camera_feed *f;
    const struct camera_feed_options options = {uri("small"), NULL, NULL, NULL, false};
    EXPECT_STATUS(camera_feed_open(&f, &options), OK);
    assert_non_null(wait_for_image(f, 0));
    camera_feed_suspend(f, true);
    clock_sleep_until_ns(clock_now_ns() + 300000000);
    int64_t received = camera_feed_query(f).received;
    clock_sleep_until_ns(clock_now_ns() + 300000000);
    EXPECT_INT(camera_feed_query(f).received, received);
    camera_feed_suspend(f, false);
    assert_non_null(wait_for_image(f, received));
    camera_feed_close(&f);
    camera_feed_close(&f); // NULL is fine
}

static void test_stale_image_is_dropped(void **state)
{
    (void)state;
    struct frame_skip p = {0};
    EXPECT_TRUE(!frame_skip_update(&p, 80, true, true)); // the first is shown, however long it took
    p = (struct frame_skip){0};
    for (int i = 0; i < 10; i++)
        EXPECT_TRUE(!frame_skip_update(&p, 9 + i % 2, true, true)); // always behind, in the usual time: shown
    EXPECT_NEAR(p.typical_ms, 9.5, 0.5);
    struct frame_skip usual = p;
    EXPECT_TRUE(!frame_skip_update(&p, 70, true, false)); // nothing newer waits
    p = usual;
    EXPECT_TRUE(!frame_skip_update(&p, 70, false, true)); // the next could not be tracked from it
    p = usual;
    EXPECT_TRUE(frame_skip_update(&p, 70, true, true));
    EXPECT_TRUE(!frame_skip_update(&p, 700, true, true)); // never two in a row
    p = usual;
    int shown = 0; // if every image takes long from now on, that soon is the usual time
    for (int i = 0; i < 20; i++)
        shown += !frame_skip_update(&p, 70, true, true);
    EXPECT_AT_LEAST(shown, 18);
}

// ---------------------------------------------------------------- mailbox

enum { ITEMS = 20000 };

static void *take_all(void *self)
{
    struct mailbox *m = self;
    int64_t last = 0;
    for (int *item; (item = mailbox_take(m, true));) {
        if (*item <= last)
            return self; // older than one before
        last = *item;
        if (last == ITEMS)
            return NULL;
    }
    return self;
}

static void test_newest_wins(void **state)
{
    (void)state;
    static int items[ITEMS];
    struct mailbox *m;
    pthread_t thread;
    EXPECT_STATUS(mailbox_open(&m), OK);
    EXPECT_TRUE(!mailbox_full(m) && !mailbox_take(m, false));
    assert_int_equal(pthread_create(&thread, NULL, take_all, m), 0);
    for (int i = 0; i < ITEMS; i++) {
        items[i] = i + 1;
        const int *untaken = mailbox_put(m, &items[i]);
        EXPECT_TRUE(!untaken || untaken == &items[i - 1]);
    }
    void *wrong;
    pthread_join(thread, &wrong);
    EXPECT_TRUE(!wrong);
    mailbox_stop(m);
    EXPECT_TRUE(!mailbox_take(m, true));
    mailbox_close(&m);
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
        cmocka_unit_test(test_images_come_with_poses),
        cmocka_unit_test(test_guessed_lens_is_estimated),
        cmocka_unit_test(test_images_without_place),
        cmocka_unit_test(test_missing_camera_is_retried),
        cmocka_unit_test(test_suspended_feed_delivers_nothing),
        cmocka_unit_test(test_stale_image_is_dropped),
        cmocka_unit_test(test_newest_wins),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
