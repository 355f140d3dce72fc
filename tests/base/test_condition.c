// Timed waits end at their time by the monotonic clock, with the lock held.
#include "tests/support/test.h"

#include "base/clock.h"
#include "base/threads.h"

static void test_wait_ends_at_its_time(void **state)
{
    (void)state;
    pthread_mutex_t lock = PTHREAD_MUTEX_INITIALIZER;
    pthread_cond_t condition;
    condition_open(&condition);
    pthread_mutex_lock(&lock);
    EXPECT_TRUE(!condition_wait_until_ns(&condition, &lock, clock_now_ns() - 1000000000)); // in the past
    const int64_t until_ns = clock_now_ns() + 20000000;
    while (condition_wait_until_ns(&condition, &lock, until_ns))
        ; // woken without a signal
    EXPECT_AT_LEAST((double)(clock_now_ns() - until_ns), 0);
    EXPECT_INT(pthread_mutex_unlock(&lock), 0);
    pthread_cond_destroy(&condition);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_wait_ends_at_its_time)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
