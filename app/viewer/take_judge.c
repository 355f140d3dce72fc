#include "app/viewer/take_judge.h"

#include "base/thread_priority.h"
#include "base/worker_thread.h"
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
        return fail(ERR_MEMORY, "out of memory");
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
