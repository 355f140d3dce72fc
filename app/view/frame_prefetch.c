#include "app/view/frame_prefetch.h"

#include "base/clock.h"
#include "base/threads.h"

#include <stdlib.h>
#include <string.h>

enum { NO_FRAME = -1 };

struct frame_prefetch {
    char *path;
    const struct take *take;
    const struct take_skeletons *skeletons;
    const struct avatar *avatar;
    struct worker_thread worker;

    // Under its lock, which is never held while a frame is loaded:
    int64_t wanted[PREFETCH_MAX];
    int wanted_count;
    struct frame_layer ready[PREFETCH_MAX];
    int ready_count;
    int64_t loading; // NO_FRAME
    int64_t load_ns;
};

static bool is_wanted(const struct frame_prefetch *prefetch, int64_t frame)
{
    for (int i = 0; i < prefetch->wanted_count; i++)
        if (prefetch->wanted[i] == frame)
            return true;
    return false;
}

static int find_ready(const struct frame_prefetch *prefetch, int64_t frame)
{
    int i = 0;
    while (i < prefetch->ready_count && prefetch->ready[i].frame != frame)
        i++;
    return i;
}

static void cancel_wanted(struct frame_prefetch *prefetch, int64_t frame)
{
    int kept = 0;
    for (int i = 0; i < prefetch->wanted_count; i++)
        if (prefetch->wanted[i] != frame)
            prefetch->wanted[kept++] = prefetch->wanted[i];
    prefetch->wanted_count = kept;
}

static void remove_ready(struct frame_prefetch *prefetch, int i)
{
    prefetch->ready[i] = prefetch->ready[--prefetch->ready_count];
}

// The first frame that is wanted and not ready; NO_FRAME: there is none, or enough is ready.
static int64_t next_wanted(const struct frame_prefetch *prefetch)
{
    size_t bytes = 0;
    for (int i = 0; i < prefetch->ready_count; i++)
        bytes += frame_layer_bytes(&prefetch->ready[i]);
    if (prefetch->ready_count == PREFETCH_MAX || bytes >= PREFETCH_BYTES)
        return NO_FRAME;
    for (int i = 0; i < prefetch->wanted_count; i++)
        if (find_ready(prefetch, prefetch->wanted[i]) == prefetch->ready_count)
            return prefetch->wanted[i];
    return NO_FRAME;
}

// ---------------------------------------------------------------- the thread

static void load_one(struct frame_prefetch *prefetch, struct frame_layer_loader *loader)
{
    struct frame_layer loaded;
    const int64_t frame = prefetch->loading;
    pthread_mutex_unlock(&prefetch->worker.lock);
    const int64_t began_ns = clock_now_ns();
    enum status status = frame_layer_loader_load(loader, frame, &loaded);
    const int64_t ended_ns = clock_now_ns();
    pthread_mutex_lock(&prefetch->worker.lock);
    prefetch->load_ns = ended_ns - began_ns;
    prefetch->loading = NO_FRAME;
    if (status != OK)
        cancel_wanted(prefetch, frame); // the renderer loads it when it is shown, and reports the error
    else if (is_wanted(prefetch, frame) && prefetch->ready_count < PREFETCH_MAX)
        prefetch->ready[prefetch->ready_count++] = loaded;
    else
        frame_layer_free(&loaded);
    pthread_cond_broadcast(&prefetch->worker.changed);
}

static void load_wanted(struct frame_prefetch *prefetch, struct frame_layer_loader *loader)
{
    pthread_mutex_lock(&prefetch->worker.lock);
    while (!prefetch->worker.closing) {
        prefetch->loading = next_wanted(prefetch);
        if (prefetch->loading == NO_FRAME)
            pthread_cond_wait(&prefetch->worker.changed, &prefetch->worker.lock);
        else
            load_one(prefetch, loader);
    }
    pthread_mutex_unlock(&prefetch->worker.lock);
}

// Where opening fails nothing is prefetched; the renderer then loads each frame when it is shown.
static void *run_prefetch(void *self)
{
    struct frame_prefetch *prefetch = self;
    struct recording *recording = NULL;
    struct take *take = NULL;
    struct source_rays *rays = NULL;
    struct frame_layer_loader *loader = NULL;
    thread_lower_priority();
    enum status status = recording_open(&recording, prefetch->path);
    if (status == OK)
        status = take_open_shared(&take, recording, prefetch->take);
    if (status == OK)
        status = source_rays_open(&rays, take_calibration(take));
    const struct frame_source source = {take, prefetch->skeletons, rays};
    if (status == OK)
        status = frame_layer_loader_open(&loader, &source, prefetch->avatar);
    if (status == OK)
        load_wanted(prefetch, loader);
    frame_layer_loader_close(&loader);
    source_rays_close(&rays);
    take_close(&take);
    recording_free(&recording);
    return NULL;
}

// ---------------------------------------------------------------- called from other threads

enum status prefetch_start(struct frame_prefetch **out, const struct frame_prefetch_options *options)
{
    struct frame_prefetch *a = *out = calloc(1, sizeof *a);
    if (!a)
        return fail(ERR_MEMORY, "no memory for loading frames ahead");
    worker_thread_open(&a->worker);
    a->take = options->take;
    a->skeletons = options->skeletons;
    a->avatar = options->avatar;
    a->loading = NO_FRAME;
    a->path = strdup(options->path);
    enum status status = a->path ? OK : fail(ERR_MEMORY, "no memory for loading frames ahead");
    if (status == OK)
        status = worker_thread_start(&a->worker, run_prefetch, a, "to load frames ahead");
    if (status != OK)
        prefetch_close(out);
    return status;
}

void prefetch_close(struct frame_prefetch **out)
{
    struct frame_prefetch *prefetch = *out;
    if (!prefetch)
        return;
    worker_thread_close(&prefetch->worker);
    for (int i = 0; i < prefetch->ready_count; i++)
        frame_layer_free(&prefetch->ready[i]);
    free(prefetch->path);
    free(prefetch);
    *out = NULL;
}

void prefetch_request(struct frame_prefetch *prefetch, const int64_t *frames, int count)
{
    assert(count <= PREFETCH_MAX);
    pthread_mutex_lock(&prefetch->worker.lock);
    memcpy(prefetch->wanted, frames, sizeof *frames * (size_t)count);
    prefetch->wanted_count = count;
    for (int i = prefetch->ready_count - 1; i >= 0; i--)
        if (!is_wanted(prefetch, prefetch->ready[i].frame)) {
            frame_layer_free(&prefetch->ready[i]);
            remove_ready(prefetch, i);
        }
    pthread_cond_broadcast(&prefetch->worker.changed);
    pthread_mutex_unlock(&prefetch->worker.lock);
}

int64_t prefetch_load_ns(struct frame_prefetch *prefetch)
{
    pthread_mutex_lock(&prefetch->worker.lock);
    int64_t load_ns = prefetch->load_ns;
    pthread_mutex_unlock(&prefetch->worker.lock);
    return load_ns;
}

bool prefetch_has(struct frame_prefetch *prefetch, int64_t frame)
{
    pthread_mutex_lock(&prefetch->worker.lock);
    const bool there = find_ready(prefetch, frame) < prefetch->ready_count;
    pthread_mutex_unlock(&prefetch->worker.lock);
    return there;
}

static bool take_ready(struct frame_prefetch *prefetch, int i, struct frame_layer *out)
{
    if (i >= prefetch->ready_count)
        return false;
    *out = prefetch->ready[i];
    remove_ready(prefetch, i);
    return true;
}

bool prefetch_take(struct frame_prefetch *prefetch, int64_t frame, struct frame_layer *out)
{
    pthread_mutex_lock(&prefetch->worker.lock);
    while (prefetch->loading == frame)
        pthread_cond_wait(&prefetch->worker.changed, &prefetch->worker.lock);
    bool there = take_ready(prefetch, find_ready(prefetch, frame), out);
    pthread_mutex_unlock(&prefetch->worker.lock);
    return there;
}

bool prefetch_take_any(struct frame_prefetch *prefetch, struct frame_layer *out)
{
    pthread_mutex_lock(&prefetch->worker.lock);
    bool there = take_ready(prefetch, 0, out);
    pthread_mutex_unlock(&prefetch->worker.lock);
    return there;
}
