#include "app/camera/mailbox.h"

#include <pthread.h>
#include <stdlib.h>

struct latest {
    pthread_mutex_t lock;
    pthread_cond_t put;
    void *item;
    bool stopped;
};

enum status latest_open(struct latest **out)
{
    struct latest *l = *out = calloc(1, sizeof *l);
    if (!l)
        return fail(ERR_MEMORY, "out of memory");
    pthread_mutex_init(&l->lock, NULL);
    pthread_cond_init(&l->put, NULL);
    return OK;
}

void latest_close(struct latest **l)
{
    if (*l) {
        pthread_cond_destroy(&(*l)->put);
        pthread_mutex_destroy(&(*l)->lock);
        free(*l);
    }
    *l = NULL;
}

void *latest_put(struct latest *l, void *item)
{
    pthread_mutex_lock(&l->lock);
    void *untaken = l->item;
    l->item = item;
    pthread_cond_signal(&l->put);
    pthread_mutex_unlock(&l->lock);
    return untaken;
}

void *latest_take(struct latest *l, bool wait)
{
    pthread_mutex_lock(&l->lock);
    while (wait && !l->item && !l->stopped)
        pthread_cond_wait(&l->put, &l->lock);
    void *item = l->stopped ? NULL : l->item;
    if (item)
        l->item = NULL;
    pthread_mutex_unlock(&l->lock);
    return item;
}

bool latest_waits(struct latest *l)
{
    pthread_mutex_lock(&l->lock);
    bool waits = l->item;
    pthread_mutex_unlock(&l->lock);
    return waits;
}

void latest_stop(struct latest *l)
{
    pthread_mutex_lock(&l->lock);
    l->stopped = true;
    pthread_cond_broadcast(&l->put);
    pthread_mutex_unlock(&l->lock);
}
