// A worker thread is told of changes, tells of its own, and ends when it is closed, whatever it waits for.
#include "tests/support/test.h"

#include "base/threads.h"

#include <semaphore.h>
#include <stdlib.h>

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

// Who stops it may go on using the lock; stopping again is nothing.
static void test_stops_once(void **state)
{
    (void)state;
    struct doubler d = {.ended = false};
    worker_thread_open(&d.worker);
    EXPECT_STATUS(worker_thread_start(&d.worker, run, &d, "to double"), OK);
    EXPECT_TRUE(!worker_thread_must_end(&d.worker));
    worker_thread_stop(&d.worker);
    EXPECT_TRUE(d.ended && worker_thread_must_end(&d.worker));
    worker_thread_stop(&d.worker);
    worker_thread_close(&d.worker);
}

// Its memory is the thread's own from there on.
struct orphan {
    struct worker_thread worker;
    sem_t *gone;
};

static void *end_alone(void *self)
{
    struct orphan *o = self;
    pthread_mutex_lock(&o->worker.lock);
    while (!o->worker.closing)
        pthread_cond_wait(&o->worker.changed, &o->worker.lock);
    pthread_mutex_unlock(&o->worker.lock);
    sem_t *gone = o->gone;
    worker_thread_close(&o->worker);
    free(o);
    sem_post(gone);
    return NULL;
}

static void test_an_abandoned_thread_ends_alone(void **state)
{
    (void)state;
    sem_t gone;
    struct orphan *o = malloc(sizeof *o);
    assert_non_null(o);
    o->gone = &gone;
    EXPECT_INT(sem_init(&gone, 0, 0), 0);
    worker_thread_open(&o->worker);
    pthread_mutex_lock(&o->worker.lock);
    EXPECT_TRUE(!worker_thread_abandon(&o->worker)); // it does not run
    o->worker.closing = false;
    pthread_mutex_unlock(&o->worker.lock);
    EXPECT_STATUS(worker_thread_start(&o->worker, end_alone, o, "to end alone"), OK);
    pthread_mutex_lock(&o->worker.lock);
    EXPECT_TRUE(worker_thread_abandon(&o->worker));
    pthread_mutex_unlock(&o->worker.lock);
    EXPECT_INT(sem_wait(&gone), 0);
    sem_destroy(&gone);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_work_is_done_until_it_closes),
        cmocka_unit_test(test_closes_without_having_started),
        cmocka_unit_test(test_stops_once),
        cmocka_unit_test(test_an_abandoned_thread_ends_alone),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
