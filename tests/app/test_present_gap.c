// A lull is waited for until it begins, however early that was, and not for ever.
#include "tests/support/test.h"

#include "app/camera/present_gap.h"
#include "base/clock.h"

#include <pthread.h>

static const int64_t MAX_WAIT_NS = 50000000;

static int64_t waited_ns(struct present_gap *l, int64_t count)
{
    const int64_t before_ns = clock_now_ns();
    present_gap_wait(l, count);
    return clock_now_ns() - before_ns;
}

static void test_begun_gap_does_not_block(void **state)
{
    (void)state;
    struct present_gap *l;
    EXPECT_STATUS(present_gap_open(&l), OK);
    const int64_t count = present_gap_count(l);
    int64_t least_ns = MAX_WAIT_NS;
    for (int i = 0; i < 20; i++) { // of many, for this thread may have to wait for a processor
        present_gap_begin(l);
        const int64_t ns = waited_ns(l, count);
        least_ns = ns < least_ns ? ns : least_ns;
    }
    EXPECT_AT_MOST(least_ns, MAX_WAIT_NS / 2);
    EXPECT_INT(present_gap_count(l), count + 20);
    present_gap_close(&l);
    present_gap_close(&l); // NULL is fine
}

static void test_no_gap_without_drawing(void **state)
{
    (void)state;
    struct present_gap *l;
    EXPECT_STATUS(present_gap_open(&l), OK);
    present_gap_begin(l); // before: it is over
    EXPECT_AT_LEAST(waited_ns(l, present_gap_count(l)), MAX_WAIT_NS);
    present_gap_close(&l);
}

static void *wait_for_it(void *gap)
{
    struct present_gap *l = gap;
    present_gap_wait(l, 0);
    return NULL;
}

static void test_wakes_waiting_thread(void **state)
{
    (void)state;
    int64_t least_ns = MAX_WAIT_NS;
    for (int i = 0; i < 20; i++) {
        struct present_gap *l;
        pthread_t waiting;
        EXPECT_STATUS(present_gap_open(&l), OK);
        const int64_t before_ns = clock_now_ns();
        assert_int_equal(pthread_create(&waiting, NULL, wait_for_it, l), 0);
        clock_sleep_until_ns(before_ns + 1000000); // it most likely waits by now; else the lull has begun before
        present_gap_begin(l);
        pthread_join(waiting, NULL);
        const int64_t ns = clock_now_ns() - before_ns;
        least_ns = ns < least_ns ? ns : least_ns;
        present_gap_close(&l);
    }
    EXPECT_AT_MOST(least_ns, MAX_WAIT_NS / 2);
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
