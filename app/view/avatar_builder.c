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
    enum avatar_wanted wanted;
    enum avatar_news news;
    struct avatar avatar;
    struct failure failure; // of AVATAR_FULL; OK and NOTHING included
    struct failure kept;    // of keeping the one that was made
    bool has_occluders;
    struct occluder_mesh occluders;
};

static void notify_change(const struct avatar_builder *builder)
{
    if (builder->notify)
        builder->notify(builder->notify_self);
}

static bool keep_going(void *self, double share)
{
    struct avatar_builder *builder = self;
    (void)share;
    return !worker_thread_must_end(&builder->worker);
}

static bool report_progress(void *self, double share)
{
    struct avatar_builder *builder = self;
    int done = (int)(share * PROGRESS_STEPS);
    if (atomic_exchange(&builder->done, done) != done)
        notify_change(builder);
    return !worker_thread_must_end(&builder->worker);
}

// Hands over an avatar, or, with AVATAR_FULL, why there is none. Takes over the contents of *avatar.
static void publish_avatar(struct avatar_builder *builder, enum avatar_news news, struct avatar *avatar,
                           enum status status)
{
    pthread_mutex_lock(&builder->worker.lock);
    avatar_free(&builder->avatar); // a simple one that was not taken
    builder->avatar = *avatar;
    builder->news = news;
    builder->looked = true;
    failure_keep(&builder->failure, status);
    pthread_cond_broadcast(&builder->worker.changed);
    pthread_mutex_unlock(&builder->worker.lock);
    *avatar = (struct avatar){0};
    notify_change(builder);
}

static void set_looked(struct avatar_builder *builder)
{
    pthread_mutex_lock(&builder->worker.lock);
    builder->looked = true;
    pthread_cond_broadcast(&builder->worker.changed);
    pthread_mutex_unlock(&builder->worker.lock);
}

// Until it has begun and that avatar is wanted. False: cancelled before.
static bool await_begin(struct avatar_builder *builder, enum avatar_wanted avatar)
{
    pthread_mutex_lock(&builder->worker.lock);
    while (!(builder->begun && builder->wanted >= avatar) && !builder->worker.closing)
        pthread_cond_wait(&builder->worker.changed, &builder->worker.lock);
    const bool begins = !builder->worker.closing;
    pthread_mutex_unlock(&builder->worker.lock);
    return begins;
}

static enum status open_take(const struct avatar_builder *builder, struct recording **recording, struct take **take)
{
    enum status status = recording_open(recording, builder->path);
    return status == OK ? take_open_shared(take, *recording, builder->take) : status;
}

// Occluders are optional: where they cannot be made there are none, and no error is reported.
static void build_occluders(struct avatar_builder *builder)
{
    const struct progress_watch watch = {.on_progress = keep_going, .self = builder};
    struct occluder_options options = occluder_default_options();
    struct occluder_mesh made = {0};
    struct recording *recording = NULL;
    struct take *take = NULL;
    struct place place = {0};
    options.watch = &watch;
    if (!await_begin(builder, AVATAR_WANTED_NONE) || open_take(builder, &recording, &take) != OK ||
        recording_read_place(recording, &place) != OK || occluder_mesh_make(&made, &place, take, &options) != OK)
        made = (struct occluder_mesh){0};
    place_free(&place);
    take_close(&take);
    recording_free(&recording);
    pthread_mutex_lock(&builder->worker.lock);
    builder->occluders = made;
    builder->has_occluders = true;
    pthread_mutex_unlock(&builder->worker.lock);
    notify_change(builder);
}

// A simple avatar, which stands in until the full one is there. False: there is none.
static bool make_simple(struct avatar_builder *builder, struct take *take, const struct source_rays *rays)
{
    const struct progress_watch watch = {.on_progress = keep_going, .self = builder};
    struct avatar_options options = avatar_default_options();
    struct avatar avatar;
    options.simple = true;
    options.max_frames = SIMPLE_FRAMES;
    options.watch = &watch;
    if (avatar_make(&avatar, take, rays, &options) != OK)
        return false;
    publish_avatar(builder, AVATAR_SIMPLE, &avatar, OK);
    return true;
}

// The full avatar is packed before it is handed over and written after that, when nothing waits for it any more.
static enum status make_full(struct avatar_builder *builder, struct take *take, const struct source_rays *rays)
{
    const struct progress_watch watch = {.on_progress = report_progress, .self = builder};
    struct avatar_options options = avatar_default_options();
    struct avatar avatar;
    uint8_t *bytes = NULL;
    size_t count = 0;
    options.watch = &watch;
    enum status status = avatar_make(&avatar, take, rays, &options);
    if (status != OK)
        return status;
    status = avatar_pack(&avatar, &bytes, &count);
    publish_avatar(builder, AVATAR_FULL, &avatar, OK);
    if (status == OK) // also where it is not wanted any more: it took long to make
        status = avatar_save(bytes, count, builder->path, builder->take);
    if (status == NOTHING)
        status = fail(ERR_IO, "The recording cannot be written now: the actor is made again the next time");
    pthread_mutex_lock(&builder->worker.lock);
    failure_keep(&builder->kept, status);
    pthread_mutex_unlock(&builder->worker.lock);
    free(bytes);
    return OK;
}

static enum status build_avatar(struct avatar_builder *builder)
{
    struct recording *recording = NULL;
    struct take *take = NULL;
    struct source_rays *rays = NULL;
    struct avatar kept;
    enum status status = open_take(builder, &recording, &take);
    if (status == OK && !(take_calibration(take)->depth.width > 0))
        status = NOTHING;
    const bool found = status == OK && avatar_load(&kept, take) == OK;
    if (found)
        publish_avatar(builder, AVATAR_FULL, &kept, OK);
    set_looked(builder);
    if (status == OK && !found && !await_begin(builder, AVATAR_WANTED_SIMPLE))
        status = NOTHING;
    if (status == OK && !found)
        status = source_rays_open(&rays, take_calibration(take));
    if (status == OK && !found)
        status = make_simple(builder, take, rays) && !await_begin(builder, AVATAR_WANTED_FULL) ? NOTHING : OK;
    if (status == OK && !found)
        status = make_full(builder, take, rays);
    source_rays_close(&rays);
    take_close(&take);
    recording_free(&recording);
    return status;
}

enum { TASK_AVATAR, TASK_OCCLUDERS, TASK_COUNT };

// The two tasks run in parallel, each with its own handle on the recording.
static void do_task(void *self, int task)
{
    struct avatar_builder *builder = self;
    struct avatar none = {0};
    if (task == TASK_OCCLUDERS) {
        build_occluders(builder);
        return;
    }
    const enum status status = build_avatar(builder);
    if (status != OK)
        publish_avatar(builder, AVATAR_FULL, &none, status);
}

static void *run_builder(void *self)
{
    struct avatar_builder *builder = self;
    parallel_for(TASK_COUNT, TASK_COUNT, do_task, builder);
    trim_heap();
    atomic_store(&builder->ended, true);
    notify_change(builder);
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
    enum status status = p->path ? worker_thread_start(&p->worker, run_builder, p, "to make the actor")
                                 : fail(ERR_MEMORY, "no memory for the actor");
    if (status != OK)
        avatar_builder_close(out);
    return status;
}

void avatar_builder_close(struct avatar_builder **out)
{
    struct avatar_builder *builder = *out;
    if (!builder)
        return;
    worker_thread_close(&builder->worker);
    avatar_free(&builder->avatar);
    occluder_mesh_free(&builder->occluders);
    free(builder->path);
    free(builder);
    *out = NULL;
}

void avatar_builder_begin(struct avatar_builder *builder, enum avatar_wanted wanted)
{
    pthread_mutex_lock(&builder->worker.lock);
    builder->begun = true;
    builder->wanted = wanted > builder->wanted ? wanted : builder->wanted;
    pthread_cond_broadcast(&builder->worker.changed);
    pthread_mutex_unlock(&builder->worker.lock);
}

double avatar_builder_progress(const struct avatar_builder *builder)
{
    return (double)atomic_load(&builder->done) / PROGRESS_STEPS;
}

void avatar_builder_await_kept(struct avatar_builder *builder, int64_t max_ns)
{
    const int64_t until_ns = clock_now_ns() + max_ns;
    pthread_mutex_lock(&builder->worker.lock);
    while (!builder->looked && clock_now_ns() < until_ns)
        (void)condition_wait_until_ns(&builder->worker.changed, &builder->worker.lock, until_ns);
    pthread_mutex_unlock(&builder->worker.lock);
}

enum avatar_news avatar_builder_take(struct avatar_builder *builder, struct avatar *avatar, enum status *status)
{
    pthread_mutex_lock(&builder->worker.lock);
    const enum avatar_news news = builder->news;
    if (news != AVATAR_NO_NEWS) {
        *status = failure_restore(&builder->failure);
        *avatar = builder->avatar;
        builder->avatar = (struct avatar){0};
        builder->news = AVATAR_NO_NEWS;
    }
    pthread_mutex_unlock(&builder->worker.lock);
    return news;
}

bool avatar_builder_take_occluders(struct avatar_builder *builder, struct occluder_mesh *occluders)
{
    pthread_mutex_lock(&builder->worker.lock);
    const bool there = builder->has_occluders;
    if (there)
        *occluders = builder->occluders;
    builder->occluders = (struct occluder_mesh){0};
    builder->has_occluders = false;
    pthread_mutex_unlock(&builder->worker.lock);
    return there;
}

enum status avatar_builder_kept(struct avatar_builder *builder)
{
    pthread_mutex_lock(&builder->worker.lock);
    const struct failure kept = builder->kept;
    pthread_mutex_unlock(&builder->worker.lock);
    return failure_restore(&kept);
}

bool avatar_builder_ended(const struct avatar_builder *builder) { return atomic_load(&builder->ended); }
