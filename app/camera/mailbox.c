#include "app/camera/mailbox.h"

#include <pthread.h>
#include <stdlib.h>

struct mailbox {
    pthread_mutex_t lock;
    pthread_cond_t put;
    void *item;
    bool stopped;
};

enum status mailbox_open(struct mailbox **out)
{
    struct mailbox *l = *out = calloc(1, sizeof *l);
    if (!l)
        return fail(ERR_MEMORY, "out of memory");
    pthread_mutex_init(&l->lock, NULL);
    pthread_cond_init(&l->put, NULL);
    return OK;
}

void mailbox_close(struct mailbox **l)
{
    if (*l) {
        pthread_cond_destroy(&(*l)->put);
        pthread_mutex_destroy(&(*l)->lock);
        free(*l);
    }
    *l = NULL;
}

void *mailbox_put(struct mailbox *l, void *item)
{
    pthread_mutex_lock(&l->lock);
    void *untaken = l->item;
    l->item = item;
    pthread_cond_signal(&l->put);
    pthread_mutex_unlock(&l->lock);
    return untaken;
}

void *mailbox_take(struct mailbox *l, bool wait)
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

bool mailbox_full(struct mailbox *l)
{
    pthread_mutex_lock(&l->lock);
    bool waits = l->item;
    pthread_mutex_unlock(&l->lock);
    return waits;
}

void mailbox_stop(struct mailbox *l)
{
    pthread_mutex_lock(&l->lock);
    l->stopped = true;
    pthread_cond_broadcast(&l->put);
    pthread_mutex_unlock(&l->lock);
}
