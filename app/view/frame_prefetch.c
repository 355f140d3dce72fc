#include "app/view/frame_prefetch.h"

#include "base/thread_priority.h"
#include "base/clock.h"

#include <pthread.h>
#include <stdlib.h>
#include <string.h>

enum { NO_FRAME = -1 };

struct ahead {
    char *path, *take;
    const struct likeness *likeness;
    pthread_t thread;
    bool runs;

    pthread_mutex_t lock; // of what follows; never held while a frame is loaded
    pthread_cond_t changed;
    int64_t wanted[AHEAD_MOST];
    int wanted_count;
    struct loaded_frame ready[AHEAD_MOST];
    int ready_count;
    int64_t loading; // NO_FRAME
    int64_t takes_ns;
    bool closing;
};

static bool is_wanted(const struct ahead *a, int64_t frame)
{
    for (int i = 0; i < a->wanted_count; i++)
        if (a->wanted[i] == frame)
            return true;
    return false;
}

static int find_ready(const struct ahead *a, int64_t frame)
{
    int i = 0;
    while (i < a->ready_count && a->ready[i].frame != frame)
        i++;
    return i;
}

static void want_no_more(struct ahead *a, int64_t frame)
{
    int kept = 0;
    for (int i = 0; i < a->wanted_count; i++)
        if (a->wanted[i] != frame)
            a->wanted[kept++] = a->wanted[i];
    a->wanted_count = kept;
}

static void remove_ready(struct ahead *a, int i) { a->ready[i] = a->ready[--a->ready_count]; }

// The first that is wanted and not ready; NO_FRAME: there is none, or enough is ready.
static int64_t next_wanted(const struct ahead *a)
{
    size_t bytes = 0;
    for (int i = 0; i < a->ready_count; i++)
        bytes += loaded_frame_bytes(&a->ready[i]);
    if (a->ready_count == AHEAD_MOST || bytes >= AHEAD_BYTES)
        return NO_FRAME;
    for (int i = 0; i < a->wanted_count; i++)
        if (find_ready(a, a->wanted[i]) == a->ready_count)
            return a->wanted[i];
    return NO_FRAME;
}

// ---------------------------------------------------------------- the thread

static void load_one(struct ahead *a, struct frame_loader *loader)
{
    struct loaded_frame loaded;
    const int64_t frame = a->loading;
    pthread_mutex_unlock(&a->lock);
    const int64_t began_ns = clock_now_ns();
    enum status status = frame_loader_load(loader, frame, &loaded);
    const int64_t ended_ns = clock_now_ns();
    pthread_mutex_lock(&a->lock);
    a->takes_ns = ended_ns - began_ns;
    a->loading = NO_FRAME;
    if (status != OK)
        want_no_more(a, frame); // whoever shows it loads it, and says why it cannot be
    else if (is_wanted(a, frame) && a->ready_count < AHEAD_MOST)
        a->ready[a->ready_count++] = loaded;
    else
        loaded_frame_free(&loaded);
    pthread_cond_broadcast(&a->changed);
}

static void load_what_is_wanted(struct ahead *a, struct frame_loader *loader)
{
    pthread_mutex_lock(&a->lock);
    while (!a->closing) {
        a->loading = next_wanted(a);
        if (a->loading == NO_FRAME)
            pthread_cond_wait(&a->changed, &a->lock);
        else
            load_one(a, loader);
    }
    pthread_mutex_unlock(&a->lock);
}

// Where it fails there is nobody ahead; whoever shows a frame loads it.
static void *run(void *self)
{
    struct ahead *a = self;
    struct recording *recording = NULL;
    struct take *take = NULL;
    struct source_rays *rays = NULL;
    struct frame_loader *loader = NULL;
    background_begin();
    enum status status = recording_open(&recording, a->path);
    if (status == OK)
        status = take_open(&take, recording, a->take);
    if (status == OK)
        status = source_rays_open(&rays, take_calibration(take));
    if (status == OK)
        status = frame_loader_open(&loader, take, rays, a->likeness);
    if (status == OK)
        load_what_is_wanted(a, loader);
    frame_loader_close(&loader);
    source_rays_close(&rays);
    take_close(&take);
    recording_free(&recording);
    return NULL;
}

// ---------------------------------------------------------------- the other side

enum status ahead_start(struct ahead **out, const struct ahead_options *options)
{
    struct ahead *a = *out = calloc(1, sizeof *a);
    if (!a)
        return fail(ERR_MEMORY, "out of memory");
    pthread_mutex_init(&a->lock, NULL);
    pthread_cond_init(&a->changed, NULL);
    a->likeness = options->likeness;
    a->loading = NO_FRAME;
    a->path = strdup(options->path);
    a->take = strdup(options->take);
    a->runs = a->path && a->take && pthread_create(&a->thread, NULL, run, a) == 0;
    if (a->runs)
        return OK;
    ahead_close(out);
    return fail(ERR_MEMORY, "out of memory");
}

void ahead_close(struct ahead **out)
{
    struct ahead *a = *out;
    if (!a)
        return;
    pthread_mutex_lock(&a->lock);
    a->closing = true;
    pthread_cond_broadcast(&a->changed);
    pthread_mutex_unlock(&a->lock);
    if (a->runs)
        pthread_join(a->thread, NULL);
    for (int i = 0; i < a->ready_count; i++)
        loaded_frame_free(&a->ready[i]);
    pthread_cond_destroy(&a->changed);
    pthread_mutex_destroy(&a->lock);
    free(a->path);
    free(a->take);
    free(a);
    *out = NULL;
}

void ahead_want(struct ahead *a, const int64_t *frames, int count)
{
    assert(count <= AHEAD_MOST);
    pthread_mutex_lock(&a->lock);
    memcpy(a->wanted, frames, sizeof *frames * (size_t)count);
    a->wanted_count = count;
    for (int i = a->ready_count - 1; i >= 0; i--)
        if (!is_wanted(a, a->ready[i].frame)) {
            loaded_frame_free(&a->ready[i]);
            remove_ready(a, i);
        }
    pthread_cond_broadcast(&a->changed);
    pthread_mutex_unlock(&a->lock);
}

int64_t ahead_takes_ns(struct ahead *a)
{
    pthread_mutex_lock(&a->lock);
    int64_t takes_ns = a->takes_ns;
    pthread_mutex_unlock(&a->lock);
    return takes_ns;
}

bool ahead_has(struct ahead *a, int64_t frame)
{
    pthread_mutex_lock(&a->lock);
    const bool there = find_ready(a, frame) < a->ready_count;
    pthread_mutex_unlock(&a->lock);
    return there;
}

static bool take_ready(struct ahead *a, int i, struct loaded_frame *out)
{
    if (i >= a->ready_count)
        return false;
    *out = a->ready[i];
    remove_ready(a, i);
    return true;
}

bool ahead_take(struct ahead *a, int64_t frame, struct loaded_frame *out)
{
    pthread_mutex_lock(&a->lock);
    while (a->loading == frame)
        pthread_cond_wait(&a->changed, &a->lock);
    bool there = take_ready(a, find_ready(a, frame), out);
    pthread_mutex_unlock(&a->lock);
    return there;
}

bool ahead_take_any(struct ahead *a, struct loaded_frame *out)
{
    pthread_mutex_lock(&a->lock);
    bool there = take_ready(a, 0, out);
    pthread_mutex_unlock(&a->lock);
    return there;
}
