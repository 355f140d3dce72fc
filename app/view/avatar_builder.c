#include "app/view/avatar_builder.h"

#include "base/clock.h"
#include "base/memory.h"
#include "base/threads.h"
#include "reenact/avatar/avatar.h"

#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>

enum { PROGRESS_STEPS = 100 }; // resolution at which progress is reported

// Of the simple avatar: enough to see a person from all sides who turns. Chosen by hand.
enum { SIMPLE_FRAMES = 8 };

struct avatar_builder {
    char *path;
    const struct take *take;
    void (*notify)(void *self);
    void *notify_self;
    struct worker_thread worker;
    atomic_int done; // of PROGRESS_STEPS
    atomic_bool ended;

    // Under the worker's lock:
    bool looked; // whether the recording keeps an avatar is known
    bool begun;  // avatar_builder_begin was called
    enum avatar_news news;
    struct avatar avatar;
    struct failure failure; // of AVATAR_FULL; OK and NOTHING included
    struct failure kept;    // of keeping the one that was made
    bool has_occluders;
    struct occluder_mesh occluders;
};

static void notify_change(const struct avatar_builder *p)
{
    if (p->notify)
        p->notify(p->notify_self);
}

static bool keep_going(void *self, double share)
{
    struct avatar_builder *p = self;
    (void)share;
    return !worker_thread_must_end(&p->worker);
}

static bool report_progress(void *self, double share)
{
    struct avatar_builder *p = self;
    int done = (int)(share * PROGRESS_STEPS);
    if (atomic_exchange(&p->done, done) != done)
        notify_change(p);
    return !worker_thread_must_end(&p->worker);
}

// Hands over an avatar, or, with AVATAR_FULL, why there is none. Takes over the contents of *avatar.
static void publish(struct avatar_builder *p, enum avatar_news news, struct avatar *avatar, enum status status)
{
    pthread_mutex_lock(&p->worker.lock);
    avatar_free(&p->avatar); // a simple one that was not taken
    p->avatar = *avatar;
    p->news = news;
    p->looked = true;
    failure_keep(&p->failure, status);
    pthread_cond_broadcast(&p->worker.changed);
    pthread_mutex_unlock(&p->worker.lock);
    *avatar = (struct avatar){0};
    notify_change(p);
}

static void set_looked(struct avatar_builder *p)
{
    pthread_mutex_lock(&p->worker.lock);
    p->looked = true;
    pthread_cond_broadcast(&p->worker.changed);
    pthread_mutex_unlock(&p->worker.lock);
}

// False: cancelled before it may begin.
static bool await_begin(struct avatar_builder *p)
{
    pthread_mutex_lock(&p->worker.lock);
    while (!p->begun && !p->worker.closing)
        pthread_cond_wait(&p->worker.changed, &p->worker.lock);
    const bool begins = !p->worker.closing;
    pthread_mutex_unlock(&p->worker.lock);
    return begins;
}

static enum status open_take(const struct avatar_builder *p, struct recording **recording, struct take **take)
{
    enum status status = recording_open(recording, p->path);
    return status == OK ? take_open_shared(take, *recording, p->take) : status;
}

// Occluders are optional: where they cannot be made there are none, and no error is reported.
static void build_occluders(struct avatar_builder *p)
{
    const struct progress_watch watch = {.on_progress = keep_going, .self = p};
    struct occluder_options options = occluder_default_options();
    struct occluder_mesh made = {0};
    struct recording *recording = NULL;
    struct take *take = NULL;
    struct place place = {0};
    options.watch = &watch;
    if (!await_begin(p) || open_take(p, &recording, &take) != OK || recording_read_place(recording, &place) != OK ||
        occluder_mesh_make(&made, &place, take, &options) != OK)
        made = (struct occluder_mesh){0};
    place_free(&place);
    take_close(&take);
    recording_free(&recording);
    pthread_mutex_lock(&p->worker.lock);
    p->occluders = made;
    p->has_occluders = true;
    pthread_mutex_unlock(&p->worker.lock);
    notify_change(p);
}

// A simple avatar, which stands in until the full one is there. Without one the cylinders do.
static void make_simple(struct avatar_builder *p, struct take *take, const struct source_rays *rays)
{
    const struct progress_watch watch = {.on_progress = keep_going, .self = p};
    struct avatar_options options = avatar_default_options();
    struct avatar avatar;
    options.simple = true;
    options.max_frames = SIMPLE_FRAMES;
    options.watch = &watch;
    if (avatar_make(&avatar, take, rays, &options) == OK)
        publish(p, AVATAR_SIMPLE, &avatar, OK);
}

// The full avatar is packed before it is handed over and written after that, when nothing waits for it any more.
static enum status make_full(struct avatar_builder *p, struct take *take, const struct source_rays *rays)
{
    const struct progress_watch watch = {.on_progress = report_progress, .self = p};
    struct avatar_options options = avatar_default_options();
    struct avatar avatar;
    uint8_t *bytes = NULL;
    size_t count = 0;
    options.watch = &watch;
    enum status status = avatar_make(&avatar, take, rays, &options);
    if (status != OK)
        return status;
    status = avatar_pack(&avatar, &bytes, &count);
    publish(p, AVATAR_FULL, &avatar, OK);
    if (status == OK) // also where it is not wanted any more: it took long to make
        status = avatar_save(bytes, count, p->path, p->take);
    if (status == NOTHING)
        status = fail(ERR_IO, "The recording cannot be written now: the actor is made again the next time");
    pthread_mutex_lock(&p->worker.lock);
    failure_keep(&p->kept, status);
    pthread_mutex_unlock(&p->worker.lock);
    free(bytes);
    return OK;
}

static enum status build_avatar(struct avatar_builder *p)
{
    struct recording *recording = NULL;
    struct take *take = NULL;
    struct source_rays *rays = NULL;
    struct avatar kept;
    enum status status = open_take(p, &recording, &take);
    if (status == OK && !(take_calibration(take)->depth.width > 0))
        status = NOTHING;
    const bool found = status == OK && avatar_load(&kept, take) == OK;
    if (found)
        publish(p, AVATAR_FULL, &kept, OK);
    set_looked(p);
    if (status == OK && !found && !await_begin(p))
        status = NOTHING;
    if (status == OK && !found)
        status = source_rays_open(&rays, take_calibration(take));
    if (status == OK && !found)
        make_simple(p, take, rays);
    if (status == OK && !found)
        status = make_full(p, take, rays);
    source_rays_close(&rays);
    take_close(&take);
    recording_free(&recording);
    return status;
}

enum { TASK_AVATAR, TASK_OCCLUDERS, TASK_COUNT };

// The two tasks run in parallel, each with its own handle on the recording.
static void do_task(void *self, int task)
{
    struct avatar_builder *p = self;
    struct avatar none = {0};
    if (task == TASK_OCCLUDERS) {
        build_occluders(p);
        return;
    }
    const enum status status = build_avatar(p);
    if (status != OK)
        publish(p, AVATAR_FULL, &none, status);
}

static void *run(void *self)
{
    struct avatar_builder *p = self;
    parallel_for(TASK_COUNT, TASK_COUNT, do_task, p);
    trim_heap();
    atomic_store(&p->ended, true);
    notify_change(p);
    return NULL;
}

enum status avatar_builder_start(struct avatar_builder **out, const struct avatar_builder_options *options)
{
    struct avatar_builder *p = *out = calloc(1, sizeof *p);
    if (!p)
        return fail(ERR_MEMORY, "no memory for the actor");
    worker_thread_open(&p->worker);
    p->notify = options->notify;
    p->notify_self = options->notify_self;
    p->path = strdup(options->path);
    p->take = options->take;
    enum status status = p->path ? worker_thread_start(&p->worker, run, p, "to make the actor")
                                 : fail(ERR_MEMORY, "no memory for the actor");
    if (status != OK)
        avatar_builder_close(out);
    return status;
}

void avatar_builder_close(struct avatar_builder **out)
{
    struct avatar_builder *p = *out;
    if (!p)
        return;
    worker_thread_close(&p->worker);
    avatar_free(&p->avatar);
    occluder_mesh_free(&p->occluders);
    free(p->path);
    free(p);
    *out = NULL;
}

void avatar_builder_begin(struct avatar_builder *p)
{
    pthread_mutex_lock(&p->worker.lock);
    p->begun = true;
    pthread_cond_broadcast(&p->worker.changed);
    pthread_mutex_unlock(&p->worker.lock);
}

double avatar_builder_progress(const struct avatar_builder *p)
{
    return (double)atomic_load(&p->done) / PROGRESS_STEPS;
}

void avatar_builder_await_kept(struct avatar_builder *p, int64_t most_ns)
{
    const int64_t until_ns = clock_now_ns() + most_ns;
    pthread_mutex_lock(&p->worker.lock);
    while (!p->looked && clock_now_ns() < until_ns)
        (void)condition_wait_until_ns(&p->worker.changed, &p->worker.lock, until_ns);
    pthread_mutex_unlock(&p->worker.lock);
}

enum avatar_news avatar_builder_take(struct avatar_builder *p, struct avatar *avatar, enum status *status)
{
    pthread_mutex_lock(&p->worker.lock);
    const enum avatar_news news = p->news;
    if (news != AVATAR_NO_NEWS) {
        *status = failure_restore(&p->failure);
        *avatar = p->avatar;
        p->avatar = (struct avatar){0};
        p->news = AVATAR_NO_NEWS;
    }
    pthread_mutex_unlock(&p->worker.lock);
    return news;
}

bool avatar_builder_take_occluders(struct avatar_builder *p, struct occluder_mesh *occluders)
{
    pthread_mutex_lock(&p->worker.lock);
    const bool there = p->has_occluders;
    if (there)
        *occluders = p->occluders;
    p->occluders = (struct occluder_mesh){0};
    p->has_occluders = false;
    pthread_mutex_unlock(&p->worker.lock);
    return there;
}

enum status avatar_builder_kept(struct avatar_builder *p)
{
    pthread_mutex_lock(&p->worker.lock);
    const struct failure kept = p->kept;
    pthread_mutex_unlock(&p->worker.lock);
    return failure_restore(&kept);
}

bool avatar_builder_ended(const struct avatar_builder *p) { return atomic_load(&p->ended); }
