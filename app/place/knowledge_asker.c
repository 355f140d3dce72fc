// Asking a thing's own address for what is newer, on a thread, and keeping it in the recording.
#include "app/place/place_things.h"

#include "base/worker_thread.h"
#include "objects/thing_update.h"

#include <stdlib.h>
#include <string.h>

struct knowledge_asker {
    struct knowledge_asker_options options;
    char *file; // a copy of options.file
    struct worker_thread worker;

    // Under its lock, which is never held while the server is asked:
    bool orphan;                   // closed while the server was asked; the thread frees it
    int wanted, running, answered; // indices; -1: none
    char name[64], url[512];       // of what is wanted
    struct answer {
        struct thing_update update;
        bool kept; // the recording has it
    } answer;
};

static void dispose(struct knowledge_asker *a)
{
    worker_thread_close(&a->worker);
    free(a->file);
    free(a);
}

static struct recorded_thing *find(struct recorded_thing *things, int count, const char *name)
{
    for (int i = 0; i < count; i++)
        if (!strcmp(things[i].name, name))
            return &things[i];
    return NULL;
}

static enum status read_things(const char *file, struct recorded_thing **things, int *count)
{
    struct recording *r;
    enum status status = recording_open(&r, file);
    if (status != OK)
        return status;
    status = recording_read_things(r, things, count);
    recording_free(&r);
    return status;
}

// The thing as the recording has it: what it knows already need not be sent again. False: it has none of that name.
static bool read_kept(const char *file, const char *name, struct recorded_thing *out)
{
    struct recorded_thing *things = NULL;
    int count = 0;
    bool good = file && read_things(file, &things, &count) == OK;
    const struct recorded_thing *kept = good ? find(things, count, name) : NULL;
    *out = (struct recorded_thing){0};
    good = kept && recorded_thing_copy(out, kept) == OK;
    recorded_things_free(&things, count);
    return good;
}

// As objects --knowledge does: all things again, in one transaction, those of the file as they are now.
static bool keep(const char *file, const struct recorded_thing *thing)
{
    struct recorded_thing *things = NULL;
    int count = 0;
    bool good = read_things(file, &things, &count) == OK;
    struct recorded_thing *to = good ? find(things, count, thing->name) : NULL;
    if (to) {
        struct recorded_thing now;
        good = recorded_thing_copy(&now, thing) == OK;
        const struct recorded_thing before = *to;
        *to = now; // what is known; the rest is as the file has it
        to->world_from_thing = before.world_from_thing;
        to->covariance = before.covariance;
        to->width_m = before.width_m, to->height_m = before.height_m;
        to->sightings = before.sightings;
        to->gone = before.gone;
        memcpy(to->note, before.note, sizeof to->note);
        free(before.knowledge);
        free(before.image.bytes);
        free(before.model.bytes);
        good = good && recording_write_things(file, things, count) == OK;
    }
    recorded_things_free(&things, count);
    return to && good;
}

static void ask(const struct knowledge_asker *a, const char *name, const char *url, struct answer *out)
{
    struct recorded_thing thing;
    const bool recorded = read_kept(a->file, name, &thing);
    thing_update_ask(&thing, url, url, &a->options.limits, &out->update);
    out->kept = recorded && (!out->update.changed || keep(a->file, &thing));
    free(thing.knowledge);
    free(thing.image.bytes);
    free(thing.model.bytes);
}

static void *run(void *self)
{
    struct knowledge_asker *a = self;
    pthread_mutex_lock(&a->worker.lock);
    while (!a->worker.closing) {
        if (a->wanted < 0 || a->answered >= 0) { // an answer is taken before the next request
            pthread_cond_wait(&a->worker.changed, &a->worker.lock);
            continue;
        }
        char name[sizeof a->name], url[sizeof a->url];
        struct answer answer;
        strcpy(name, a->name);
        strcpy(url, a->url);
        a->running = a->wanted;
        a->wanted = -1;
        pthread_mutex_unlock(&a->worker.lock);
        ask(a, name, url, &answer);
        pthread_mutex_lock(&a->worker.lock);
        a->answer = answer;
        a->answered = a->running;
        a->running = -1;
        if (a->options.notify && !a->worker.closing)
            a->options.notify(a->options.notify_self);
    }
    const bool orphan = a->orphan;
    pthread_mutex_unlock(&a->worker.lock);
    if (orphan)
        dispose(a);
    return NULL;
}

enum status knowledge_asker_start(struct knowledge_asker **out, const struct knowledge_asker_options *options)
{
    struct knowledge_asker *a = *out = calloc(1, sizeof *a);
    if (!a)
        return fail(ERR_MEMORY, "no memory to ask what is known of things");
    a->options = *options;
    a->wanted = a->running = a->answered = -1;
    worker_thread_open(&a->worker);
    enum status status = OK;
    if (options->file && !(a->file = strdup(options->file)))
        status = fail(ERR_MEMORY, "no memory to ask what is known of things");
    if (status == OK)
        status = worker_thread_start(&a->worker, run, a, "to ask what is known of things");
    if (status != OK)
        knowledge_asker_close(out);
    return status;
}

void knowledge_asker_close(struct knowledge_asker **out)
{
    struct knowledge_asker *a = *out;
    if (!a)
        return;
    *out = NULL;
    pthread_mutex_lock(&a->worker.lock);
    const bool orphan = a->orphan = a->running >= 0 && worker_thread_abandon(&a->worker);
    pthread_mutex_unlock(&a->worker.lock);
    if (!orphan)
        dispose(a);
}

void knowledge_asker_ask(struct knowledge_asker *a, int index, const struct place_thing *thing)
{
    if (!thing->url[0])
        return;
    pthread_mutex_lock(&a->worker.lock);
    if (a->running != index) {
        a->wanted = index;
        strcpy(a->name, thing->name);
        strcpy(a->url, thing->url);
        pthread_cond_signal(&a->worker.changed);
    }
    pthread_mutex_unlock(&a->worker.lock);
}

int knowledge_asker_take(struct knowledge_asker *a, struct place_things *things)
{
    pthread_mutex_lock(&a->worker.lock);
    const int index = a->answered;
    if (index >= 0 && index < things->count) {
        struct place_thing *t = &things->things[index];
        const struct thing_update *u = &a->answer.update;
        strcpy(t->trouble, u->trouble);
        if (u->known && !u->trouble[0]) {
            t->knowledge = u->knowledge;
            t->known = true;
            t->unkept = !a->answer.kept;
        }
    }
    a->answered = -1;
    if (index >= 0)
        pthread_cond_signal(&a->worker.changed);
    pthread_mutex_unlock(&a->worker.lock);
    return index;
}

bool knowledge_asker_asks(struct knowledge_asker *a, int index)
{
    pthread_mutex_lock(&a->worker.lock);
    const bool is = a->wanted == index || a->running == index;
    pthread_mutex_unlock(&a->worker.lock);
    return is;
}
