// Asking a thing's own address for what is newer, on a thread.
#include "app/place/place_things.h"

#include <pthread.h>
#include <stdlib.h>
#include <string.h>

struct knowledge_asker {
    struct knowledge_asker_options options;
    pthread_t thread;
    bool runs;

    pthread_mutex_t lock; // guards what follows; never held while the server is asked
    pthread_cond_t changed;
    bool closing, orphan;          // orphan: closed while the server was asked; the thread frees it
    int wanted, running, answered; // indices; -1: none
    char url[512], etag[128];      // of what is wanted
    struct known answer;
};

static void dispose(struct knowledge_asker *a)
{
    pthread_mutex_destroy(&a->lock);
    pthread_cond_destroy(&a->changed);
    known_free(&a->answer);
    free(a);
}

static void *run(void *self)
{
    struct knowledge_asker *a = self;
    pthread_mutex_lock(&a->lock);
    while (!a->closing) {
        if (a->wanted < 0 || a->answered >= 0) { // an answer is taken before the next request
            pthread_cond_wait(&a->changed, &a->lock);
            continue;
        }
        // Without the text that goes with it no ETag is sent: the whole answer is wanted.
        struct known k = {.text = NULL};
        char url[sizeof a->url];
        strcpy(url, a->url);
        a->running = a->wanted;
        a->wanted = -1;
        pthread_mutex_unlock(&a->lock);
        (void)!thing_knowledge_fetch(url, url, &a->options.limits, &k); // k.trouble says what went wrong
        pthread_mutex_lock(&a->lock);
        known_free(&a->answer);
        a->answer = k;
        a->answered = a->running;
        a->running = -1;
        if (a->options.notify && !a->closing)
            a->options.notify(a->options.notify_self);
    }
    const bool orphan = a->orphan;
    pthread_mutex_unlock(&a->lock);
    if (orphan)
        dispose(a);
    return NULL;
}

enum status knowledge_asker_start(struct knowledge_asker **out, const struct knowledge_asker_options *options)
{
    struct knowledge_asker *a = *out = calloc(1, sizeof *a);
    if (!a)
        return fail(ERR_MEMORY, "out of memory");
    a->options = *options;
    a->wanted = a->running = a->answered = -1;
    pthread_mutex_init(&a->lock, NULL);
    pthread_cond_init(&a->changed, NULL);
    a->runs = pthread_create(&a->thread, NULL, run, a) == 0;
    if (a->runs)
        return OK;
    knowledge_asker_close(out);
    return fail(ERR_MEMORY, "no thread to ask what is known of things");
}

void knowledge_asker_close(struct knowledge_asker **out)
{
    struct knowledge_asker *a = *out;
    if (!a)
        return;
    *out = NULL;
    pthread_mutex_lock(&a->lock);
    const pthread_t thread = a->thread;
    const bool runs = a->runs, orphan = runs && a->running >= 0;
    a->closing = true;
    a->orphan = orphan;
    pthread_cond_signal(&a->changed);
    pthread_mutex_unlock(&a->lock);
    if (orphan) {
        pthread_detach(thread);
        return;
    }
    if (runs)
        pthread_join(thread, NULL);
    dispose(a);
}

void knowledge_asker_ask(struct knowledge_asker *a, int index, const struct place_thing *thing)
{
    if (!thing->url[0])
        return;
    pthread_mutex_lock(&a->lock);
    if (a->running != index) {
        a->wanted = index;
        strcpy(a->url, thing->url);
        pthread_cond_signal(&a->changed);
    }
    pthread_mutex_unlock(&a->lock);
}

int knowledge_asker_take(struct knowledge_asker *a, struct place_things *things)
{
    pthread_mutex_lock(&a->lock);
    const int index = a->answered;
    if (index >= 0 && index < things->count) {
        struct place_thing *t = &things->things[index];
        strcpy(t->trouble, a->answer.trouble);
        if (a->answer.text) {
            t->knowledge = a->answer.knowledge;
            t->known = true;
        }
    }
    a->answered = -1;
    if (index >= 0)
        pthread_cond_signal(&a->changed);
    pthread_mutex_unlock(&a->lock);
    return index;
}

bool knowledge_asker_asks(struct knowledge_asker *a, int index)
{
    pthread_mutex_lock(&a->lock);
    const bool is = a->wanted == index || a->running == index;
    pthread_mutex_unlock(&a->lock);
    return is;
}
