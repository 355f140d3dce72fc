// A thread of the background leaves the processors to others, and so do those that it starts; nobody else does.
#include "tests/test.h"

#include "platform/background.h"

#include <pthread.h>
#include <sys/resource.h>

static int nice_of_this_thread(void) { return getpriority(PRIO_PROCESS, 0); }

static void *look(void *nice)
{
    *(int *)nice = nice_of_this_thread();
    return NULL;
}

static void *go_behind(void *nices)
{
    int *nice = nices;
    pthread_t child;
    background_begin();
    nice[0] = nice_of_this_thread();
    assert_int_equal(pthread_create(&child, NULL, look, &nice[1]), 0);
    pthread_join(child, NULL);
    return NULL;
}

static void only_that_thread_and_its_own(void **state)
{
    (void)state;
    const int before = nice_of_this_thread(), nicest = 19;
    int nice[2];
    pthread_t behind;
    assert_int_equal(pthread_create(&behind, NULL, go_behind, nice), 0);
    pthread_join(behind, NULL);
    EXPECT_INT(nice[0], before + 10 < nicest ? before + 10 : nicest);
    EXPECT_INT(nice[1], nice[0]);
    EXPECT_INT(nice_of_this_thread(), before);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(only_that_thread_and_its_own)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
