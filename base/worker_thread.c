#include "base/worker_thread.h"

void worker_thread_open(struct worker_thread *w)
{
    *w = (struct worker_thread){.runs = false};
    pthread_mutex_init(&w->lock, NULL);
    condition_open(&w->changed);
}

enum status worker_thread_start(struct worker_thread *w, void *(*run)(void *), void *self, const char *task)
{
    w->runs = pthread_create(&w->thread, NULL, run, self) == 0;
    return w->runs ? OK : fail(ERR_MEMORY, "no thread %s", task);
}

void worker_thread_stop(struct worker_thread *w)
{
    pthread_mutex_lock(&w->lock);
    w->closing = true;
    pthread_cond_broadcast(&w->changed);
    pthread_mutex_unlock(&w->lock);
    if (w->runs)
        pthread_join(w->thread, NULL);
    w->runs = false;
}

bool worker_thread_abandon(struct worker_thread *w)
{
    const bool ran = w->runs;
    w->closing = true;
    w->runs = false;
    if (ran)
        pthread_detach(w->thread);
    pthread_cond_broadcast(&w->changed);
    return ran;
}

bool worker_thread_must_end(struct worker_thread *w)
{
    pthread_mutex_lock(&w->lock);
    const bool closing = w->closing;
    pthread_mutex_unlock(&w->lock);
    return closing;
}

void worker_thread_close(struct worker_thread *w)
{
    worker_thread_stop(w);
    pthread_cond_destroy(&w->changed);
    pthread_mutex_destroy(&w->lock);
}
