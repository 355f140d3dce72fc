// Frames are loaded beside the drawing, on a thread of their own: the same, byte for byte, as if whoever shows
// them had loaded them, only those that are wanted, and it can be given up at any moment.
#include "tests/support/test.h"

#include "app/view/frame_prefetch.h"
#include "base/clock.h"
#include "platform/database.h"
#include "tests/support/rehearsed.h"

#include <string.h>
#include <time.h>

enum { FRAMES_FOR_LIKENESS = 1 };

// How much later it is given up each time: seldomer where computing is emulated.
#ifdef EMULATED
enum { LATER = 20 };
#else
enum { LATER = 2 };
#endif

static struct rehearsed rehearsed;

static struct ahead *start(const char *take_name)
{
    struct ahead *a;
    const struct ahead_options how = {rehearsed.rehearsal.file, take_name, &rehearsed.likeness};
    EXPECT_STATUS(ahead_start(&a, &how), OK);
    return a;
}

// Waits for it as somebody who shows a frame now and then does.
static bool take_in_time(struct ahead *a, int64_t frame, struct loaded_frame *out)
{
    const int64_t until = clock_now_ns() + 60000000000;
    while (clock_now_ns() < until) {
        if (ahead_take(a, frame, out))
            return true;
        clock_sleep_until_ns(clock_now_ns() + 1000000);
    }
    return false;
}

static void expect_same_picture(const struct loaded_picture *a, const struct loaded_picture *b, size_t bytes_a_pixel)
{
    EXPECT_INT(a->width, b->width);
    EXPECT_INT(a->height, b->height);
    EXPECT_TRUE(!memcmp(a->pixels, b->pixels, bytes_a_pixel * (size_t)a->width * (size_t)a->height));
}

static void expect_same(const struct loaded_frame *a, const struct loaded_frame *b)
{
    EXPECT_INT(a->frame, b->frame);
    EXPECT_INT(a->seen, b->seen);
    expect_same_picture(&a->color, &b->color, 3);
    expect_same_picture(&a->depth, &b->depth, 4);
    EXPECT_TRUE(!memcmp(a->windows, b->windows, sizeof a->windows));
    EXPECT_TRUE(!memcmp(&a->adjustment, &b->adjustment, sizeof a->adjustment));
    EXPECT_INT(a->point_count, rehearsed.likeness.atlas.mesh.point_count);
    EXPECT_INT(b->point_count, a->point_count);
    EXPECT_INT(a->triangle_count, rehearsed.likeness.atlas.mesh.corner_count / 3);
    EXPECT_INT(b->triangle_count, a->triangle_count);
    EXPECT_TRUE(!memcmp(a->shift, b->shift, sizeof *a->shift * (size_t)a->point_count));
    EXPECT_TRUE(!memcmp(a->points, b->points, sizeof *a->points * (size_t)a->point_count));
    EXPECT_TRUE(!memcmp(a->own, b->own, sizeof *a->own * (size_t)a->triangle_count));
}

// In whatever order frames are shown: what was loaded before leaves no trace.
static void the_same_as_loaded_by_oneself(void **state)
{
    (void)state;
    static const int64_t shown[] = {0, 1, 6, 0};
    struct ahead *a = start("turn");
    struct frame_loader *own;
    struct loaded_frame before = {0};
    EXPECT_STATUS(frame_loader_open(&own, rehearsed.take, rehearsed.rays, &rehearsed.likeness), OK);
    for (size_t i = 0; i < COUNT_OF(shown); i++) {
        struct loaded_frame theirs, ours;
        ahead_want(a, &shown[i], i + 1 < COUNT_OF(shown) ? 2 : 1);
        EXPECT_TRUE(take_in_time(a, shown[i], &theirs));
        EXPECT_STATUS(frame_loader_load(own, shown[i], &ours), OK);
        EXPECT_TRUE(ours.seen);
        EXPECT_AT_LEAST(ours.color.width, 10);
        expect_same(&theirs, &ours);
        EXPECT_TRUE(i == 0 || memcmp(before.shift, ours.shift,
                                     sizeof *ours.shift * (size_t)rehearsed.likeness.atlas.mesh.point_count));
        loaded_frame_free(&before);
        loaded_frame_free(&theirs);
        before = ours;
    }
    loaded_frame_free(&before);
    frame_loader_close(&own);
    ahead_close(&a);
}

static void only_what_is_wanted(void **state)
{
    (void)state;
    struct ahead *a = start("turn");
    struct loaded_frame frame;
    const int64_t first[] = {1, 2}, then[] = {5};
    ahead_want(a, first, 2);
    EXPECT_TRUE(take_in_time(a, 1, &frame));
    loaded_frame_free(&frame);
    ahead_want(a, then, 1); // he was moved along the timeline
    EXPECT_TRUE(take_in_time(a, 5, &frame));
    EXPECT_INT(frame.frame, 5);
    EXPECT_AT_LEAST((double)ahead_takes_ns(a), 1e5);
    loaded_frame_free(&frame);
    for (int64_t i = 0; i < 8; i++)
        EXPECT_TRUE(!ahead_take(a, i, &frame)); // 1 and 5 are gone, 2 is not wanted any more
    ahead_close(&a);
    EXPECT_TRUE(!a);
}

static void given_up_at_any_moment(void **state)
{
    (void)state;
    for (int ms = 0; ms < 50; ms = LATER * ms + 1) {
        const int64_t wanted[] = {0, 1, 2, 3, 4, 5};
        struct ahead *a = start("turn");
        ahead_want(a, wanted, AHEAD_MOST);
        clock_sleep_until_ns(clock_now_ns() + ms * 1000000ll);
        ahead_close(&a);
    }
}

// Whoever shows a frame is then left to load it, and to say why it cannot be.
static void what_cannot_be_loaded_is_not_waited_for(void **state)
{
    (void)state;
    struct ahead *a = start("nobody");
    struct loaded_frame frame;
    const int64_t wanted[] = {0};
    ahead_want(a, wanted, 1);
    for (int i = 0; i < 20; i++) {
        EXPECT_TRUE(!ahead_take(a, 0, &frame));
        clock_sleep_until_ns(clock_now_ns() + 1000000);
    }
    ahead_close(&a);
}

// Several in a row, as a damaged file has them: each is tried, none again and again.
static void what_is_damaged_costs_nothing(void **state)
{
    (void)state;
    struct database *db;
    EXPECT_STATUS(database_open(&db, rehearsed.rehearsal.file, DATABASE_WRITE), OK);
    EXPECT_STATUS(database_run(db, "UPDATE picture SET depth = x'00'"), OK);
    database_close(&db);
    struct ahead *a = start("turn");
    struct loaded_frame frame;
    const int64_t wanted[] = {3, 4, 5};
    ahead_want(a, wanted, 3);
    clock_sleep_until_ns(clock_now_ns() + 300000000);
    const clock_t before = clock(); // processor time of all threads
    clock_sleep_until_ns(clock_now_ns() + 300000000);
    EXPECT_AT_MOST((double)(clock() - before) / CLOCKS_PER_SEC, 0.1);
    for (int i = 0; i < 3; i++)
        EXPECT_TRUE(!ahead_take(a, wanted[i], &frame));
    ahead_close(&a);
}

static int make(void **state)
{
    (void)state;
    EXPECT_STATUS(rehearsed_open(&rehearsed, FRAMES_FOR_LIKENESS), OK);
    return 0;
}

static int end(void **state)
{
    (void)state;
    rehearsed_close(&rehearsed);
    return 0;
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_same_as_loaded_by_oneself), cmocka_unit_test(only_what_is_wanted),
        cmocka_unit_test(given_up_at_any_moment),        cmocka_unit_test(what_cannot_be_loaded_is_not_waited_for),
        cmocka_unit_test(what_is_damaged_costs_nothing), // last: it damages the recording
    };
    return cmocka_run_group_tests(tests, make, end);
}
