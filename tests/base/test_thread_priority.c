// Thread priorities affect the calling thread and those that it starts, and no other.
#include "tests/support/test.h"

#include "base/threads.h"

#include <pthread.h>
#include <sched.h>
#include <sys/resource.h>

static int nice_of_this_thread(void) { return getpriority(PRIO_PROCESS, 0); }

static void *record_nice(void *nice)
{
    *(int *)nice = nice_of_this_thread();
    return NULL;
}

static void *lower_and_record(void *nices)
{
    int *nice = nices;
    pthread_t child;
    thread_lower_priority();
    nice[0] = nice_of_this_thread();
    assert_int_equal(pthread_create(&child, NULL, record_nice, &nice[1]), 0);
    pthread_join(child, NULL);
    return NULL;
}

static void test_lowers_only_calling_thread_and_children(void **state)
{
    (void)state;
    const int before = nice_of_this_thread(), max_nice = 19;
    int nice[2];
    pthread_t thread;
    assert_int_equal(pthread_create(&thread, NULL, lower_and_record, nice), 0);
    pthread_join(thread, NULL);
    EXPECT_INT(nice[0], before + 5 < max_nice ? before + 5 : max_nice);
    EXPECT_INT(nice[1], nice[0]);
    EXPECT_INT(nice_of_this_thread(), before);
}

static int policy_of_this_thread(void)
{
    int policy;
    struct sched_param param;
    pthread_getschedparam(pthread_self(), &policy, &param);
    return policy;
}

static void *leave_real_time(void *policy)
{
    thread_lower_priority();
    *(int *)policy = policy_of_this_thread();
    return NULL;
}

static void test_real_time_policy_is_dropped(void **state)
{
    (void)state;
    const struct sched_param first = {1}, none = {0};
    pthread_t thread;
    int policy;
    if (pthread_setschedparam(pthread_self(), SCHED_RR, &first))
        skip_without("the right to a real-time policy");
    assert_int_equal(pthread_create(&thread, NULL, leave_real_time, &policy), 0);
    pthread_join(thread, NULL);
    EXPECT_INT(policy, SCHED_OTHER);
    EXPECT_INT(policy_of_this_thread(), SCHED_RR);
    pthread_setschedparam(pthread_self(), SCHED_OTHER, &none);
}

static void *wake_quietly(void *policy)
{
    thread_wake_without_preempting();
    *(int *)policy = policy_of_this_thread();
    return NULL;
}

static void test_wakes_without_preempting(void **state)
{
    (void)state;
    pthread_t thread;
    int policy;
    assert_int_equal(pthread_create(&thread, NULL, wake_quietly, &policy), 0);
    pthread_join(thread, NULL);
    EXPECT_INT(policy, SCHED_BATCH);
    EXPECT_INT(policy_of_this_thread(), SCHED_OTHER);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_wakes_without_preempting),
                                       cmocka_unit_test(test_lowers_only_calling_thread_and_children),
                                       cmocka_unit_test(test_real_time_policy_is_dropped)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
