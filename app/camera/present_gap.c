#include "app/camera/present_gap.h"

#include "base/clock.h"
#include "base/threads.h"

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
        return fail(ERR_MEMORY, "no memory for the gap between pictures");
    pthread_mutex_init(&g->lock, NULL);
    condition_open(&g->changed);
    return OK;
}

void present_gap_close(struct present_gap **gap)
{
    if (*gap) {
        pthread_cond_destroy(&(*gap)->changed);
        pthread_mutex_destroy(&(*gap)->lock);
        free(*gap);
    }
    *gap = NULL;
}

void present_gap_begin(struct present_gap *gap)
{
    pthread_mutex_lock(&gap->lock);
    gap->count++;
    pthread_cond_broadcast(&gap->changed);
    pthread_mutex_unlock(&gap->lock);
}

int64_t present_gap_count(struct present_gap *gap)
{
    pthread_mutex_lock(&gap->lock);
    const int64_t count = gap->count;
    pthread_mutex_unlock(&gap->lock);
    return count;
}

void present_gap_wait(struct present_gap *gap, int64_t count)
{
    const int64_t until_ns = clock_now_ns() + MAX_WAIT_NS;
    pthread_mutex_lock(&gap->lock);
    while (gap->count <= count && condition_wait_until_ns(&gap->changed, &gap->lock, until_ns))
        continue;
    pthread_mutex_unlock(&gap->lock);
}
