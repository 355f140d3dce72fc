#include "app/viewer/take_judge.h"

#include "app/viewer/viewer.h"
#include "base/clock.h"
#include "base/threads.h"
#include "capture/take_verdict.h"

#include <stdlib.h>
#include <string.h>

// ---------------------------------------------------------------- viewer takes

static const int64_t CARDS_NS = 50000000; // how long one update may complete cards; chosen by hand

static void adopt_verdict(struct viewer *v)
{
    struct take_verdict verdict;
    int number;
    bool good;
    if (!v->judge || !take_judge_take(v->judge, &number, &verdict, &good))
        return;
    if (good)
        take_list_say(&v->takes.cards[number], &verdict);
    else
        v->takes.cards[number].unjudgeable = true;
    v->state.changed = true;
}

// A thread for which there is no memory is tried again with the next update.
static void ask_for_verdict(struct viewer *v)
{
    const int wanted = take_list_unjudged(&v->takes, v->screens.first_in_sight, v->screens.end_in_sight);
    if (wanted < 0)
        return;
    if (v->judge || take_judge_start(&v->judge, v->options.file, v->options.wake, v->options.wake_self) == OK)
        status_ignore(
            take_judge_ask(v->judge, wanted, v->takes.cards[wanted].name)); // asked again with the next update
}

bool viewer_takes_update(struct viewer *v)
{
    if (v->state.page != PAGE_TAKES || !v->recording)
        return false;
    const int64_t until_ns = clock_now_ns() + CARDS_NS;
    enum status status = OK;
    while (status == OK && clock_now_ns() < until_ns) {
        status = take_list_load(&v->takes, v->gpu, v->recording, v->screens.first_in_sight, v->screens.end_in_sight);
        v->state.changed |= status == OK;
    }
    adopt_verdict(v);
    if (status == NOTHING)
        ask_for_verdict(v);
    return status == OK;
}

// ---------------------------------------------------------------- take judge

struct take_judge {
    char *path;
    void (*notify)(void *self);
    void *notify_self;
    struct worker_thread worker;

    // Under its lock, which is not held during work:
    enum { IDLE, ASKED, ANSWERED } state;
    int number;
    char *name; // the owner's while IDLE, else the thread's
    bool good;
    struct take_verdict verdict;
};

static bool goes_on(void *self)
{
    struct take_judge *j = self;
    pthread_mutex_lock(&j->worker.lock);
    const bool on = !j->worker.closing;
    pthread_mutex_unlock(&j->worker.lock);
    return on;
}

static bool judge(struct take_judge *j, struct take_verdict *out)
{
    struct recording *r;
    const struct take_verdict_patience patience = {goes_on, j};
    if (recording_open(&r, j->path) != OK)
        return false;
    const enum status status = take_verdict_get(r, j->name, &patience, out);
    recording_free(&r);
    return status == OK;
}

static void *run(void *self)
{
    struct take_judge *j = self;
    thread_lower_priority();
    pthread_mutex_lock(&j->worker.lock);
    while (!j->worker.closing) {
        if (j->state != ASKED) {
            pthread_cond_wait(&j->worker.changed, &j->worker.lock);
            continue;
        }
        struct take_verdict verdict;
        pthread_mutex_unlock(&j->worker.lock);
        const bool good = judge(j, &verdict);
        pthread_mutex_lock(&j->worker.lock);
        if (good)
            j->verdict = verdict;
        j->good = good;
        j->state = ANSWERED;
        if (j->notify && !j->worker.closing)
            j->notify(j->notify_self);
    }
    pthread_mutex_unlock(&j->worker.lock);
    return NULL;
}

enum status take_judge_start(struct take_judge **out, const char *path, void (*notify)(void *self), void *notify_self)
{
    struct take_judge *j = *out = calloc(1, sizeof *j);
    if (!j || !(j->path = strdup(path))) {
        free(j);
        *out = NULL;
        return fail(ERR_MEMORY, "no memory for judging takes");
    }
    j->notify = notify;
    j->notify_self = notify_self;
    worker_thread_open(&j->worker);
    const enum status status = worker_thread_start(&j->worker, run, j, "to judge takes");
    if (status != OK)
        take_judge_close(out);
    return status;
}

void take_judge_close(struct take_judge **out)
{
    struct take_judge *j = *out;
    if (!j)
        return;
    worker_thread_close(&j->worker);
    free(j->path);
    free(j->name);
    free(j);
    *out = NULL;
}

bool take_judge_ask(struct take_judge *j, int number, const char *name)
{
    bool asked = false;
    pthread_mutex_lock(&j->worker.lock);
    if (j->state == IDLE) {
        free(j->name);
        j->name = strdup(name);
        j->number = number;
        asked = j->name;
    }
    if (asked) {
        j->state = ASKED;
        pthread_cond_signal(&j->worker.changed);
    }
    pthread_mutex_unlock(&j->worker.lock);
    return asked;
}

bool take_judge_take(struct take_judge *j, int *number, struct take_verdict *out, bool *good)
{
    pthread_mutex_lock(&j->worker.lock);
    const bool answered = j->state == ANSWERED;
    if (answered) {
        *number = j->number;
        *out = j->verdict;
        *good = j->good;
        j->state = IDLE;
    }
    pthread_mutex_unlock(&j->worker.lock);
    return answered;
}
