#include "base/pipeline.h"

#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>

enum { MOST_THREADS = 16 };

struct item_progress {
    int stage; // that is done next
    bool busy;
};

struct pipeline_state {
    const struct pipeline *p;
    struct item_progress *items;
    int ended;                     // all items before it have gone through all stages
    int next[PIPELINE_MAX_STAGES]; // of stages in order: the item that is next
    enum status status;            // not OK: all ends
    char sentence[512];            // of an error, which is known on the thread that met it
    pthread_mutex_t lock;          // of all above
    pthread_cond_t changed;
};

// The oldest item that can be gone on with; -1: none now.
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
    if (r->status != OK)
        return;
    r->status = status;
    if (status < 0)
        snprintf(r->sentence, sizeof r->sentence, "%s", status_message());
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
    while (r->status == OK && r->ended < p->items) {
        const int i = find_ready_item(r);
        if (i >= 0)
            advance(r, i);
        else
            pthread_cond_wait(&r->changed, &r->lock);
        const double share = (double)r->ended / p->items;
        if (!reports_progress || r->status != OK)
            continue;
        pthread_mutex_unlock(&r->lock);
        const bool wanted = p->went_on(p->context, share);
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
    pthread_t thread[MOST_THREADS];
    int helping = 0;
    if (!r.items)
        return fail(ERR_MEMORY, "out of memory");
    pthread_mutex_init(&r.lock, NULL);
    pthread_cond_init(&r.changed, NULL);
    while (helping + 1 < threads && helping < MOST_THREADS && pthread_create(&thread[helping], NULL, worker, &r) == 0)
        helping++;
    run_items(&r, true);
    for (int i = 0; i < helping; i++)
        pthread_join(thread[i], NULL);
    pthread_cond_destroy(&r.changed);
    pthread_mutex_destroy(&r.lock);
    free(r.items);
    return r.status < 0 ? fail(r.status, "%s", r.sentence) : r.status;
}
