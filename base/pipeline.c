#include "base/pipeline.h"

#include <pthread.h>
#include <stdlib.h>

enum { MAX_THREADS = 16 }; // besides the caller's

struct item_progress {
    int stage; // the next one
    bool busy; // a thread is running it
};

struct pipeline_state {
    const struct pipeline *p;
    struct item_progress *items;
    int ended;                     // all items before it have passed all stages
    int next[PIPELINE_MAX_STAGES]; // of an ordered stage: the item that is next
    struct failure failure;        // not OK: the run ends
    pthread_mutex_t lock;          // guards all above
    pthread_cond_t changed;
};

// The oldest item whose next stage may run now; -1: none.
static int find_ready_item(const struct pipeline_state *r)
{
    const struct pipeline *p = r->p;
    for (int i = r->ended; i < p->items && i < r->ended + p->in_flight; i++) {
        const struct item_progress *item = &r->items[i];
        if (!item->busy && item->stage < p->stages && (!p->in_order[item->stage] || r->next[item->stage] == i))
            return i;
    }
    return -1;
}

static void stop(struct pipeline_state *r, enum status status)
{
    if (r->failure.status == OK)
        failure_keep(&r->failure, status);
}

static void advance(struct pipeline_state *r, int i)
{
    struct item_progress *item = &r->items[i];
    item->busy = true;
    pthread_mutex_unlock(&r->lock);
    const enum status status = r->p->work(r->p->context, item->stage, i);
    pthread_mutex_lock(&r->lock);
    if (status < 0)
        stop(r, status);
    r->next[item->stage] = i + 1;
    item->stage++;
    item->busy = false;
    while (r->ended < r->p->items && r->items[r->ended].stage == r->p->stages)
        r->ended++;
    pthread_cond_broadcast(&r->changed);
}

static void run_items(struct pipeline_state *r, bool reports_progress)
{
    const struct pipeline *p = r->p;
    pthread_mutex_lock(&r->lock);
    while (r->failure.status == OK && r->ended < p->items) {
        const int i = find_ready_item(r);
        if (i >= 0)
            advance(r, i);
        else
            pthread_cond_wait(&r->changed, &r->lock);
        const double share = (double)r->ended / p->items;
        if (!reports_progress || r->failure.status != OK)
            continue;
        pthread_mutex_unlock(&r->lock);
        const bool wanted = p->on_progress(p->context, share);
        pthread_mutex_lock(&r->lock);
        if (!wanted)
            stop(r, NOTHING);
    }
    pthread_cond_broadcast(&r->changed);
    pthread_mutex_unlock(&r->lock);
}

static void *worker(void *run)
{
    run_items(run, false);
    return NULL;
}

enum status pipeline_run(const struct pipeline *p, int threads)
{
    assert(p->stages <= PIPELINE_MAX_STAGES && p->in_flight > 0);
    struct pipeline_state r = {.p = p, .items = calloc((size_t)p->items + 1, sizeof *r.items)};
    pthread_t thread[MAX_THREADS];
    int helping = 0;
    if (!r.items)
        return fail(ERR_MEMORY, "out of memory");
    pthread_mutex_init(&r.lock, NULL);
    pthread_cond_init(&r.changed, NULL);
    while (helping + 1 < threads && helping < MAX_THREADS && pthread_create(&thread[helping], NULL, worker, &r) == 0)
        helping++;
    run_items(&r, true);
    for (int i = 0; i < helping; i++)
        pthread_join(thread[i], NULL);
    pthread_cond_destroy(&r.changed);
    pthread_mutex_destroy(&r.lock);
    free(r.items);
    return r.failure.status < 0 ? failure_restore(&r.failure) : r.failure.status;
}
