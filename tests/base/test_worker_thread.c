// A worker thread is told of changes, tells of its own, and ends when it is closed, whatever it waits for.
#include "tests/support/test.h"

#include "base/worker_thread.h"

struct doubler {
    struct worker_thread worker;
    int asked, answer; // 0: none
    bool ended;
};

static void *run(void *self)
{
    struct doubler *d = self;
    pthread_mutex_lock(&d->worker.lock);
    while (!d->worker.closing) {
        if (d->asked) {
            d->answer = 2 * d->asked;
            d->asked = 0;
            pthread_cond_broadcast(&d->worker.changed);
        } else {
            pthread_cond_wait(&d->worker.changed, &d->worker.lock);
        }
    }
    d->ended = true;
    pthread_mutex_unlock(&d->worker.lock);
    return NULL;
}

static void test_work_is_done_until_it_closes(void **state)
{
    (void)state;
    struct doubler d = {.ended = false};
    worker_thread_open(&d.worker);
    EXPECT_STATUS(worker_thread_start(&d.worker, run, &d, "to double"), OK);
    for (int i = 1; i < 100; i++) {
        pthread_mutex_lock(&d.worker.lock);
        d.asked = i;
        d.answer = 0;
        pthread_cond_broadcast(&d.worker.changed);
        while (!d.answer)
            pthread_cond_wait(&d.worker.changed, &d.worker.lock);
        EXPECT_INT(d.answer, 2 * i);
        pthread_mutex_unlock(&d.worker.lock);
    }
    worker_thread_close(&d.worker); // while it waits
    EXPECT_TRUE(d.ended);
}

static void test_closes_without_having_started(void **state)
{
    (void)state;
    struct doubler d = {.ended = false};
    worker_thread_open(&d.worker);
    worker_thread_close(&d.worker);
    EXPECT_TRUE(!d.ended);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_work_is_done_until_it_closes),
        cmocka_unit_test(test_closes_without_having_started),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
