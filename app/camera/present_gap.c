#include "app/camera/present_gap.h"

#include "base/clock.h"
#include "base/condition.h"

#include <pthread.h>
#include <stdlib.h>

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
    condition_open(&g->changed);
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
    pthread_mutex_lock(&g->lock);
    while (g->count <= count && condition_wait_until_ns(&g->changed, &g->lock, until_ns))
        continue;
    pthread_mutex_unlock(&g->lock);
}
