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
    struct mailbox *m = *out = calloc(1, sizeof *m);
    if (!m)
        return fail(ERR_MEMORY, "out of memory");
    pthread_mutex_init(&m->lock, NULL);
    pthread_cond_init(&m->put, NULL);
    return OK;
}

void mailbox_close(struct mailbox **m)
{
    if (*m) {
        pthread_cond_destroy(&(*m)->put);
        pthread_mutex_destroy(&(*m)->lock);
        free(*m);
    }
    *m = NULL;
}

void *mailbox_put(struct mailbox *m, void *item)
{
    pthread_mutex_lock(&m->lock);
    void *untaken = m->item;
    m->item = item;
    pthread_cond_signal(&m->put);
    pthread_mutex_unlock(&m->lock);
    return untaken;
}

void *mailbox_take(struct mailbox *m, bool wait)
{
    pthread_mutex_lock(&m->lock);
    while (wait && !m->item && !m->stopped)
        pthread_cond_wait(&m->put, &m->lock);
    void *item = m->stopped ? NULL : m->item;
    if (item)
        m->item = NULL;
    pthread_mutex_unlock(&m->lock);
    return item;
}

bool mailbox_full(struct mailbox *m)
{
    pthread_mutex_lock(&m->lock);
    bool waits = m->item;
    pthread_mutex_unlock(&m->lock);
    return waits;
}

void mailbox_stop(struct mailbox *m)
{
    pthread_mutex_lock(&m->lock);
    m->stopped = true;
    pthread_cond_broadcast(&m->put);
    pthread_mutex_unlock(&m->lock);
}
