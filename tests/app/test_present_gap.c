// A lull is waited for until it begins, however early that was, and not for ever.
#include "tests/support/test.h"

#include "app/camera/present_gap.h"
#include "base/clock.h"

#include <pthread.h>

static const int64_t PATIENCE_NS = 50000000;

static int64_t waited_ns(struct lull *l, int64_t count)
{
    const int64_t before_ns = clock_now_ns();
    lull_wait(l, count);
    return clock_now_ns() - before_ns;
}

static void one_that_has_begun_is_not_waited_for(void **state)
{
    (void)state;
    struct lull *l;
    EXPECT_STATUS(lull_open(&l), OK);
    const int64_t count = lull_count(l);
    int64_t least_ns = PATIENCE_NS;
    for (int i = 0; i < 20; i++) { // of many, for this thread may have to wait for a processor
        lull_begins(l);
        const int64_t ns = waited_ns(l, count);
        least_ns = ns < least_ns ? ns : least_ns;
    }
    EXPECT_AT_MOST(least_ns, PATIENCE_NS / 2);
    EXPECT_INT(lull_count(l), count + 20);
    lull_close(&l);
    lull_close(&l); // NULL is fine
}

static void where_nothing_is_drawn_none_begins(void **state)
{
    (void)state;
    struct lull *l;
    EXPECT_STATUS(lull_open(&l), OK);
    lull_begins(l); // before: it is over
    EXPECT_AT_LEAST(waited_ns(l, lull_count(l)), PATIENCE_NS);
    lull_close(&l);
}

static void *wait_for_it(void *lull)
{
    struct lull *l = lull;
    lull_wait(l, 0);
    return NULL;
}

static void it_wakes_who_waits(void **state)
{
    (void)state;
    int64_t least_ns = PATIENCE_NS;
    for (int i = 0; i < 20; i++) {
        struct lull *l;
        pthread_t waiting;
        EXPECT_STATUS(lull_open(&l), OK);
        const int64_t before_ns = clock_now_ns();
        assert_int_equal(pthread_create(&waiting, NULL, wait_for_it, l), 0);
        clock_sleep_until_ns(before_ns + 1000000); // it most likely waits by now; else the lull has begun before
        lull_begins(l);
        pthread_join(waiting, NULL);
        const int64_t ns = clock_now_ns() - before_ns;
        least_ns = ns < least_ns ? ns : least_ns;
        lull_close(&l);
    }
    EXPECT_AT_MOST(least_ns, PATIENCE_NS / 2);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(one_that_has_begun_is_not_waited_for),
        cmocka_unit_test(where_nothing_is_drawn_none_begins),
        cmocka_unit_test(it_wakes_who_waits),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
