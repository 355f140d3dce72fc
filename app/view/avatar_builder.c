#include "app/view/avatar_builder.h"

#include "base/memory.h"
#include "base/parallel.h"

#include <pthread.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>

enum { SHARES = 100 }; // steps in which the share of the work is told

struct preparation {
    char *path, *take;
    void (*news)(void *self);
    void *news_self;
    pthread_t thread;
    bool runs;
    atomic_int done; // of SHARES
    atomic_bool unwanted, ended;
    // The threads' until they have ended.
    enum status status;
    char sentence[512];
    struct likeness likeness;
    struct room room;
};

static void tell(const struct preparation *p)
{
    if (p->news)
        p->news(p->news_self);
}

static bool wanted(void *self, double share)
{
    struct preparation *p = self;
    (void)share;
    return !atomic_load(&p->unwanted);
}

static bool went_on(void *self, double share)
{
    struct preparation *p = self;
    int done = (int)(share * SHARES);
    if (atomic_exchange(&p->done, done) != done)
        tell(p);
    return !atomic_load(&p->unwanted);
}

static enum status open_take(const struct preparation *p, struct recording **recording, struct take **take)
{
    enum status status = recording_open(recording, p->path);
    return status == OK ? take_open(take, *recording, p->take) : status;
}

// The room is quickly made, and not worth a sentence where it fails.
static void make_room(struct preparation *p)
{
    const struct progress_watch watch = {.went_on = wanted, .self = p};
    struct recording *recording = NULL;
    struct take *take = NULL;
    struct place place = {0};
    if (open_take(p, &recording, &take) != OK || recording_read_place(recording, &place) != OK ||
        room_make(&p->room, &place, take, &watch) != OK)
        p->room = (struct room){0};
    place_free(&place);
    take_close(&take);
    recording_free(&recording);
}

static enum status make_likeness(struct preparation *p)
{
    const struct progress_watch watch = {.went_on = went_on, .self = p};
    struct recording *recording = NULL;
    struct take *take = NULL;
    struct source_rays *rays = NULL;
    enum status status = open_take(p, &recording, &take);
    if (status == OK && !(take_calibration(take)->depth.width > 0))
        status = NOTHING;
    if (status == OK)
        status = source_rays_open(&rays, take_calibration(take));
    if (status == OK)
        status = likeness_make(&p->likeness, take, rays, LIKENESS_FRAMES, &watch);
    source_rays_close(&rays);
    take_close(&take);
    recording_free(&recording);
    return status;
}

enum { LIKENESS, ROOM, TASKS };

// Side by side, each with a handle on the recording of its own.
static void do_task(void *self, int task)
{
    struct preparation *p = self;
    if (task == ROOM) {
        make_room(p);
        return;
    }
    p->status = make_likeness(p);
    if (p->status < 0)
        strncpy(p->sentence, status_sentence(), sizeof p->sentence - 1);
}

static void *run(void *self)
{
    struct preparation *p = self;
    parallel(TASKS, TASKS, do_task, p);
    memory_give_back();
    atomic_store(&p->ended, true);
    tell(p);
    return NULL;
}

enum status preparation_start(struct preparation **out, const struct preparation_options *options)
{
    struct preparation *p = *out = calloc(1, sizeof *p);
    if (!p)
        return fail(ERR_MEMORY, "out of memory");
    p->news = options->news;
    p->news_self = options->news_self;
    p->path = strdup(options->path);
    p->take = strdup(options->take);
    p->runs = p->path && p->take && pthread_create(&p->thread, NULL, run, p) == 0;
    if (p->runs)
        return OK;
    preparation_close(out);
    return fail(ERR_MEMORY, "out of memory");
}

void preparation_close(struct preparation **out)
{
    struct preparation *p = *out;
    if (!p)
        return;
    atomic_store(&p->unwanted, true);
    if (p->runs)
        pthread_join(p->thread, NULL);
    likeness_free(&p->likeness);
    room_free(&p->room);
    free(p->path);
    free(p->take);
    free(p);
    *out = NULL;
}

double preparation_share(const struct preparation *p) { return (double)atomic_load(&p->done) / SHARES; }

bool preparation_ended(struct preparation *p, struct likeness *likeness, struct room *room, enum status *status)
{
    if (!atomic_load(&p->ended))
        return false;
    *status = p->status < 0 ? fail(p->status, "%s", p->sentence) : p->status;
    *likeness = p->likeness;
    *room = p->room;
    p->likeness = (struct likeness){0};
    p->room = (struct room){0};
    return true;
}
