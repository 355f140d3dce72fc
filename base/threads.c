#include "base/threads.h"

#include "base/clamp.h"

#include <errno.h>
#include <pthread.h>
#include <sched.h>
#include <stdlib.h>
#include <sys/resource.h>
#include <time.h>

// ---------------------------------------------------------------- condition

void condition_open(pthread_cond_t *condition)
{
    pthread_condattr_t attributes;
    pthread_condattr_init(&attributes);
    pthread_condattr_setclock(&attributes, CLOCK_MONOTONIC);
    pthread_cond_init(condition, &attributes);
    pthread_condattr_destroy(&attributes);
}

bool condition_wait_until_ns(pthread_cond_t *condition, pthread_mutex_t *lock, int64_t when_ns)
{
    const struct timespec until = {(time_t)(when_ns / 1000000000), (long)(when_ns % 1000000000)};
    return pthread_cond_timedwait(condition, lock, &until) != ETIMEDOUT;
}

// ---------------------------------------------------------------- thread priority

enum { NICE_STEP = 5 }; // each step has a fifth less weight: 0.8^5 = 0.33

// On Linux PRIO_PROCESS with 0 is the calling thread alone, where POSIX says the process.
void thread_lower_priority(void)
{
    const struct sched_param none = {0};
    pthread_setschedparam(pthread_self(), SCHED_OTHER, &none); // a real-time thread's nice value has no effect
    setpriority(PRIO_PROCESS, 0, getpriority(PRIO_PROCESS, 0) + NICE_STEP);
}

void thread_wake_without_preempting(void)
{
    const struct sched_param none = {0};
    struct sched_param now;
    int policy;
    if (pthread_getschedparam(pthread_self(), &policy, &now) == 0 && policy == SCHED_OTHER)
        pthread_setschedparam(pthread_self(), SCHED_BATCH, &none);
}

// ---------------------------------------------------------------- worker thread

void worker_thread_open(struct worker_thread *thread)
{
    *thread = (struct worker_thread){.runs = false};
    pthread_mutex_init(&thread->lock, NULL);
    condition_open(&thread->changed);
}

enum status worker_thread_start(struct worker_thread *thread, void *(*run)(void *), void *self, const char *task)
{
    thread->runs = pthread_create(&thread->thread, NULL, run, self) == 0;
    return thread->runs ? OK : fail(ERR_MEMORY, "no thread %s", task);
}

void worker_thread_stop(struct worker_thread *thread)
{
    pthread_mutex_lock(&thread->lock);
    thread->closing = true;
    pthread_cond_broadcast(&thread->changed);
    pthread_mutex_unlock(&thread->lock);
    if (thread->runs)
        pthread_join(thread->thread, NULL);
    thread->runs = false;
}

bool worker_thread_abandon(struct worker_thread *thread)
{
    const bool ran = thread->runs;
    thread->closing = true;
    thread->runs = false;
    if (ran)
        pthread_detach(thread->thread);
    pthread_cond_broadcast(&thread->changed);
    return ran;
}

bool worker_thread_must_end(struct worker_thread *thread)
{
    pthread_mutex_lock(&thread->lock);
    const bool closing = thread->closing;
    pthread_mutex_unlock(&thread->lock);
    return closing;
}

void worker_thread_close(struct worker_thread *thread)
{
    worker_thread_stop(thread);
    pthread_cond_destroy(&thread->changed);
    pthread_mutex_destroy(&thread->lock);
}

// ---------------------------------------------------------------- parallel

enum { MAX_LOOP_THREADS = 16 };

struct parallel_share {
    int first, step, count;
    void (*work)(void *, int);
    void *context;
};

static void *run_share(void *argument)
{
    const struct parallel_share *s = argument;
    for (int i = s->first; i < s->count; i += s->step)
        s->work(s->context, i);
    return NULL;
}

void parallel_for(int threads, int count, void (*work)(void *context, int i), void *context)
{
    const int n = clamp_int(threads < count ? threads : count, 1, MAX_LOOP_THREADS);
    struct parallel_share shares[MAX_LOOP_THREADS];
    pthread_t thread[MAX_LOOP_THREADS];
    bool runs[MAX_LOOP_THREADS] = {false};
    for (int i = 0; i < n; i++)
        shares[i] = (struct parallel_share){i, n, count, work, context};
    for (int i = 1; i < n; i++)
        runs[i] = pthread_create(&thread[i], NULL, run_share, &shares[i]) == 0;
    run_share(&shares[0]);
    for (int i = 1; i < n; i++)
        if (runs[i])
            pthread_join(thread[i], NULL);
        else
            run_share(&shares[i]); // no thread could be created: do it here
}

// ---------------------------------------------------------------- queue

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

void queue_close(struct queue **queue)
{
    if (*queue) {
        pthread_cond_destroy(&(*queue)->changed);
        pthread_mutex_destroy(&(*queue)->lock);
        free(*queue);
    }
    *queue = NULL;
}

static bool put_item(struct queue *queue, void *item, bool wait)
{
    assert(item);
    pthread_mutex_lock(&queue->lock);
    while (wait && !queue->stopped && queue->count == queue->capacity)
        pthread_cond_wait(&queue->changed, &queue->lock);
    bool has_space = !queue->stopped && queue->count < queue->capacity;
    if (has_space) {
        queue->items[(queue->first + queue->count) % queue->capacity] = item;
        queue->count++;
        pthread_cond_broadcast(&queue->changed);
    }
    pthread_mutex_unlock(&queue->lock);
    return has_space;
}

bool queue_put(struct queue *queue, void *item) { return put_item(queue, item, true); }

bool queue_try_put(struct queue *queue, void *item) { return put_item(queue, item, false); }

void *queue_take(struct queue *queue)
{
    void *item = NULL;
    pthread_mutex_lock(&queue->lock);
    while (!queue->stopped && !queue->count)
        pthread_cond_wait(&queue->changed, &queue->lock);
    if (queue->count) {
        item = queue->items[queue->first];
        queue->first = (queue->first + 1) % queue->capacity;
        queue->count--;
        pthread_cond_broadcast(&queue->changed);
    }
    pthread_mutex_unlock(&queue->lock);
    return item;
}

void queue_stop(struct queue *queue)
{
    pthread_mutex_lock(&queue->lock);
    queue->stopped = true;
    pthread_cond_broadcast(&queue->changed);
    pthread_mutex_unlock(&queue->lock);
}

int queue_count(struct queue *queue)
{
    pthread_mutex_lock(&queue->lock);
    const int count = queue->count;
    pthread_mutex_unlock(&queue->lock);
    return count;
}

bool queue_is_stopped(struct queue *queue)
{
    pthread_mutex_lock(&queue->lock);
    const bool stopped = queue->stopped;
    pthread_mutex_unlock(&queue->lock);
    return stopped;
}

// ---------------------------------------------------------------- pipeline

enum { MAX_STAGE_THREADS = 16 }; // besides the caller's

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
static int find_ready_item(const struct pipeline_state *state)
{
    const struct pipeline *p = state->p;
    for (int i = state->ended; i < p->items && i < state->ended + p->in_flight; i++) {
        const struct item_progress *item = &state->items[i];
        if (!item->busy && item->stage < p->stages && (!p->in_order[item->stage] || state->next[item->stage] == i))
            return i;
    }
    return -1;
}

static void keep_first_failure(struct pipeline_state *state, enum status status)
{
    if (state->failure.status == OK)
        failure_keep(&state->failure, status);
}

static void advance_item(struct pipeline_state *state, int i)
{
    struct item_progress *item = &state->items[i];
    item->busy = true;
    pthread_mutex_unlock(&state->lock);
    const enum status status = state->p->work(state->p->context, item->stage, i);
    pthread_mutex_lock(&state->lock);
    if (status < 0)
        keep_first_failure(state, status);
    state->next[item->stage] = i + 1;
    item->stage++;
    item->busy = false;
    while (state->ended < state->p->items && state->items[state->ended].stage == state->p->stages)
        state->ended++;
    pthread_cond_broadcast(&state->changed);
}

static void run_items(struct pipeline_state *state, bool reports_progress)
{
    const struct pipeline *p = state->p;
    pthread_mutex_lock(&state->lock);
    while (state->failure.status == OK && state->ended < p->items) {
        const int i = find_ready_item(state);
        if (i >= 0)
            advance_item(state, i);
        else
            pthread_cond_wait(&state->changed, &state->lock);
        const double share = (double)state->ended / p->items;
        if (!reports_progress || state->failure.status != OK)
            continue;
        pthread_mutex_unlock(&state->lock);
        const bool wanted = p->on_progress(p->context, share);
        pthread_mutex_lock(&state->lock);
        if (!wanted)
            keep_first_failure(state, NOTHING);
    }
    pthread_cond_broadcast(&state->changed);
    pthread_mutex_unlock(&state->lock);
}

static void *run_worker(void *run)
{
    run_items(run, false);
    return NULL;
}

enum status pipeline_run(const struct pipeline *pipeline, int threads)
{
    assert(pipeline->stages <= PIPELINE_MAX_STAGES && pipeline->in_flight > 0);
    struct pipeline_state r = {.p = pipeline, .items = calloc((size_t)pipeline->items + 1, sizeof *r.items)};
    pthread_t thread[MAX_STAGE_THREADS];
    int helping = 0;
    if (!r.items)
        return fail(ERR_MEMORY, "no memory for the stages of a pipeline");
    pthread_mutex_init(&r.lock, NULL);
    pthread_cond_init(&r.changed, NULL);
    while (helping + 1 < threads && helping < MAX_STAGE_THREADS &&
           pthread_create(&thread[helping], NULL, run_worker, &r) == 0)
        helping++;
    run_items(&r, true);
    for (int i = 0; i < helping; i++)
        pthread_join(thread[i], NULL);
    pthread_cond_destroy(&r.changed);
    pthread_mutex_destroy(&r.lock);
    free(r.items);
    return r.failure.status < 0 ? failure_restore(&r.failure) : r.failure.status;
}
