#include "app/camera/present_gap.h"

#include "base/clock.h"

#include <errno.h>
#include <pthread.h>
#include <stdlib.h>
#include <time.h>

static const int64_t MAX_WAIT_NS = 50000000;

struct present_gap {
    pthread_mutex_t lock; // protects the fields below
    pthread_cond_t changed;
    int64_t count;
};

enum status present_gap_open(struct present_gap **out)
{
    struct present_gap *g = *out = calloc(1, sizeof *g);
    if (!g)
        return fail(ERR_MEMORY, "out of memory");
    pthread_mutex_init(&g->lock, NULL);
    pthread_condattr_t clock;
    pthread_condattr_init(&clock);
    pthread_condattr_setclock(&clock, CLOCK_MONOTONIC); // clock_now_ns's
    pthread_cond_init(&g->changed, &clock);
    pthread_condattr_destroy(&clock);
    return OK;
}

void present_gap_close(struct present_gap **g)
{
    if (*g) {
        pthread_cond_destroy(&(*g)->changed);
        pthread_mutex_destroy(&(*g)->lock);
        free(*g);
    }
    *g = NULL;
}

void present_gap_begin(struct present_gap *g)
{
    pthread_mutex_lock(&g->lock);
    g->count++;
    pthread_cond_broadcast(&g->changed);
    pthread_mutex_unlock(&g->lock);
}

int64_t present_gap_count(struct present_gap *g)
{
    pthread_mutex_lock(&g->lock);
    const int64_t count = g->count;
    pthread_mutex_unlock(&g->lock);
    return count;
}

void present_gap_wait(struct present_gap *g, int64_t count)
{
    const int64_t until_ns = clock_now_ns() + MAX_WAIT_NS;
    const struct timespec until = {(time_t)(until_ns / 1000000000), (long)(until_ns % 1000000000)};
    pthread_mutex_lock(&g->lock);
    while (g->count <= count && pthread_cond_timedwait(&g->changed, &g->lock, &until) != ETIMEDOUT)
        continue;
    pthread_mutex_unlock(&g->lock);
}
