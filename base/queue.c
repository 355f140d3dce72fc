#include "base/queue.h"

#include <pthread.h>
#include <stdlib.h>

struct queue {
    pthread_mutex_t lock;
    pthread_cond_t changed;
    int capacity, first, count;
    bool stopped;
    void *items[];
};

enum status queue_open(struct queue **out, int capacity)
{
    assert(capacity > 0);
    struct queue *q = calloc(1, sizeof *q + (size_t)capacity * sizeof q->items[0]);
    *out = q;
    if (!q)
        return fail(ERR_MEMORY, "no memory for a queue of %d items", capacity);
    pthread_mutex_init(&q->lock, NULL);
    pthread_cond_init(&q->changed, NULL);
    q->capacity = capacity;
    return OK;
}

void queue_close(struct queue **q)
{
    if (*q) {
        pthread_cond_destroy(&(*q)->changed);
        pthread_mutex_destroy(&(*q)->lock);
        free(*q);
    }
    *q = NULL;
}

static bool put(struct queue *q, void *item, bool wait)
{
    assert(item);
    pthread_mutex_lock(&q->lock);
    while (wait && !q->stopped && q->count == q->capacity)
        pthread_cond_wait(&q->changed, &q->lock);
    bool has_space = !q->stopped && q->count < q->capacity;
    if (has_space) {
        q->items[(q->first + q->count) % q->capacity] = item;
        q->count++;
        pthread_cond_broadcast(&q->changed);
    }
    pthread_mutex_unlock(&q->lock);
    return has_space;
}

bool queue_put(struct queue *q, void *item) { return put(q, item, true); }

bool queue_try_put(struct queue *q, void *item) { return put(q, item, false); }

void *queue_take(struct queue *q)
{
    void *item = NULL;
    pthread_mutex_lock(&q->lock);
    while (!q->stopped && !q->count)
        pthread_cond_wait(&q->changed, &q->lock);
    if (q->count) {
        item = q->items[q->first];
        q->first = (q->first + 1) % q->capacity;
        q->count--;
        pthread_cond_broadcast(&q->changed);
    }
    pthread_mutex_unlock(&q->lock);
    return item;
}

void queue_stop(struct queue *q)
{
    pthread_mutex_lock(&q->lock);
    q->stopped = true;
    pthread_cond_broadcast(&q->changed);
    pthread_mutex_unlock(&q->lock);
}

int queue_count(struct queue *q)
{
    pthread_mutex_lock(&q->lock);
    const int count = q->count;
    pthread_mutex_unlock(&q->lock);
    return count;
}

bool queue_is_stopped(struct queue *q)
{
    pthread_mutex_lock(&q->lock);
    const bool stopped = q->stopped;
    pthread_mutex_unlock(&q->lock);
    return stopped;
}
