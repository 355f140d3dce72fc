#include "app/camera/present_gap.h"

#include "base/clock.h"
#include "base/condition.h"

#include <pthread.h>
#include <stdlib.h>

static const int64_t MAX_WAIT_NS = 50000000;

struct present_gap {
    pthread_mutex_t lock; // of what follows
    pthread_cond_t changed;
    int64_t count;
};

enum status present_gap_open(struct present_gap **out)
{
    struct present_gap *l = *out = calloc(1, sizeof *l);
    if (!l)
        return fail(ERR_MEMORY, "out of memory");
    pthread_mutex_init(&l->lock, NULL);
    condition_open(&l->changed);
    return OK;
}

void present_gap_close(struct present_gap **l)
{
    if (*l) {
        pthread_cond_destroy(&(*l)->changed);
        pthread_mutex_destroy(&(*l)->lock);
        free(*l);
    }
    *l = NULL;
}

void present_gap_begin(struct present_gap *l)
{
    pthread_mutex_lock(&l->lock);
    l->count++;
    pthread_cond_broadcast(&l->changed);
    pthread_mutex_unlock(&l->lock);
}

int64_t present_gap_count(struct present_gap *l)
{
    pthread_mutex_lock(&l->lock);
    const int64_t count = l->count;
    pthread_mutex_unlock(&l->lock);
    return count;
}

void present_gap_wait(struct present_gap *l, int64_t count)
{
    const int64_t until_ns = clock_now_ns() + MAX_WAIT_NS;
    pthread_mutex_lock(&l->lock);
    while (l->count <= count && condition_wait_until_ns(&l->changed, &l->lock, until_ns))
        continue;
    pthread_mutex_unlock(&l->lock);
}
