// Waiting for a gap ends when it begins, also if it has begun before, and after a limit.
#include "tests/support/test.h"

#include "app/camera/camera_feed.h"
#include "base/clock.h"

#include <pthread.h>

static const int64_t MAX_WAIT_NS = 50000000;

static int64_t waited_ns(struct present_gap *g, int64_t count)
{
    const int64_t before_ns = clock_now_ns();
    present_gap_wait(g, count);
    return clock_now_ns() - before_ns;
}

static void test_begun_gap_does_not_block(void **state)
{
    (void)state;
    struct present_gap *g;
    EXPECT_STATUS(present_gap_open(&g), OK);
    const int64_t count = present_gap_count(g);
    int64_t min_ns = MAX_WAIT_NS;
    for (int i = 0; i < 20; i++) { // the least of many, for this thread may have to wait for a CPU
        present_gap_begin(g);
        const int64_t ns = waited_ns(g, count);
        min_ns = ns < min_ns ? ns : min_ns;
    }
    EXPECT_AT_MOST(min_ns, MAX_WAIT_NS / 2);
    EXPECT_INT(present_gap_count(g), count + 20);
    present_gap_close(&g);
    present_gap_close(&g); // NULL is fine
}

static void test_no_gap_without_drawing(void **state)
{
    (void)state;
    struct present_gap *g;
    EXPECT_STATUS(present_gap_open(&g), OK);
    present_gap_begin(g); // before the count is read: does not matter
    EXPECT_AT_LEAST(waited_ns(g, present_gap_count(g)), MAX_WAIT_NS);
    present_gap_close(&g);
}

static void *wait_for_it(void *gap)
{
    struct present_gap *g = gap;
    present_gap_wait(g, 0);
    return NULL;
}

static void test_wakes_waiting_thread(void **state)
{
    (void)state;
    int64_t min_ns = MAX_WAIT_NS;
    for (int i = 0; i < 20; i++) {
        struct present_gap *g;
        pthread_t waiting;
        EXPECT_STATUS(present_gap_open(&g), OK);
        const int64_t before_ns = clock_now_ns();
        assert_int_equal(pthread_create(&waiting, NULL, wait_for_it, g), 0);
        clock_sleep_until_ns(before_ns + 1000000); // the thread most likely waits by now; else the gap has begun before
        present_gap_begin(g);
        pthread_join(waiting, NULL);
        const int64_t ns = clock_now_ns() - before_ns;
        min_ns = ns < min_ns ? ns : min_ns;
        present_gap_close(&g);
    }
    EXPECT_AT_MOST(min_ns, MAX_WAIT_NS / 2);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_begun_gap_does_not_block),
        cmocka_unit_test(test_no_gap_without_drawing),
        cmocka_unit_test(test_wakes_waiting_thread),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
