#include "app/viewer/take_judge.h"

#include "base/threads.h"
#include "capture/take_verdict.h"

#include <stdlib.h>
#include <string.h>

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

static bool judge_take(struct take_judge *judge, struct take_verdict *out)
{
    struct recording *r;
    const struct take_verdict_patience patience = {goes_on, judge};
    if (recording_open(&r, judge->path) != OK)
        return false;
    const enum status status = take_verdict_get(r, judge->name, &patience, out);
    recording_free(&r);
    return status == OK;
}

static void *run_judge(void *self)
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
        const bool good = judge_take(j, &verdict);
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
    const enum status status = worker_thread_start(&j->worker, run_judge, j, "to judge takes");
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

bool take_judge_ask(struct take_judge *judge, int number, const char *name)
{
    bool asked = false;
    pthread_mutex_lock(&judge->worker.lock);
    if (judge->state == IDLE) {
        free(judge->name);
        judge->name = strdup(name);
        judge->number = number;
        asked = judge->name;
    }
    if (asked) {
        judge->state = ASKED;
        pthread_cond_signal(&judge->worker.changed);
    }
    pthread_mutex_unlock(&judge->worker.lock);
    return asked;
}

bool take_judge_take(struct take_judge *judge, int *number, struct take_verdict *out, bool *good)
{
    pthread_mutex_lock(&judge->worker.lock);
    const bool answered = judge->state == ANSWERED;
    if (answered) {
        *number = judge->number;
        *out = judge->verdict;
        *good = judge->good;
        judge->state = IDLE;
    }
    pthread_mutex_unlock(&judge->worker.lock);
    return answered;
}
