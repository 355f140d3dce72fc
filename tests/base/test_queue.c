// The bounded queue between the recorder's threads.
#include "tests/support/test.h"

#include "base/threads.h"

#include <pthread.h>

enum { ITEMS = 20000 };

static void *put_all(void *context)
{
    static int numbers[ITEMS];
    struct queue *q = context;
    for (int i = 0; i < ITEMS; i++) {
        numbers[i] = i;
        if (!queue_put(q, &numbers[i]))
            break;
    }
    queue_stop(q);
    return NULL;
}

static void test_everything_arrives_in_order(void **state)
{
    (void)state;
    struct queue *q;
    pthread_t thread;
    EXPECT_STATUS(queue_open(&q, 3), OK);
    assert_int_equal(pthread_create(&thread, NULL, put_all, q), 0);
    int wanted = 0;
    for (int *item; (item = queue_take(q)); wanted++)
        EXPECT_INT(*item, wanted);
    EXPECT_INT(wanted, ITEMS);
    pthread_join(thread, NULL);
    queue_close(&q);
    assert_null(q);
}

static void test_full_and_stopped_queues_refuse(void **state)
{
    (void)state;
    struct queue *q;
    int item = 7;
    EXPECT_STATUS(queue_open(&q, 2), OK);
    EXPECT_TRUE(queue_try_put(q, &item));
    EXPECT_TRUE(queue_try_put(q, &item));
    EXPECT_TRUE(!queue_try_put(q, &item));
    queue_stop(q);
    EXPECT_TRUE(!queue_put(q, &item)); // must not wait for ever
    assert_ptr_equal(queue_take(q), &item);
    assert_ptr_equal(queue_take(q), &item);
    assert_null(queue_take(q));
    queue_close(&q);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_everything_arrives_in_order),
        cmocka_unit_test(test_full_and_stopped_queues_refuse),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
