#include "app/view/avatar_builder.h"

#include "base/memory.h"
#include "base/parallel.h"

#include <pthread.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>

enum { PROGRESS_STEPS = 100 }; // resolution at which progress is reported

struct avatar_builder {
    char *path;
    const struct take *take;
    void (*notify)(void *self);
    void *notify_self;
    pthread_t thread;
    bool runs;
    atomic_int done; // of PROGRESS_STEPS
    atomic_bool cancelled, ended;
    struct failure failure; // OK and NOTHING included; written by the threads, read when `ended` is set
    struct avatar avatar;
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
    return !atomic_load(&p->cancelled);
}

static bool report_progress(void *self, double share)
{
    struct avatar_builder *p = self;
    int done = (int)(share * PROGRESS_STEPS);
    if (atomic_exchange(&p->done, done) != done)
        notify_change(p);
    return !atomic_load(&p->cancelled);
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
    struct recording *recording = NULL;
    struct take *take = NULL;
    struct place place = {0};
    options.watch = &watch;
    if (open_take(p, &recording, &take) != OK || recording_read_place(recording, &place) != OK ||
        occluder_mesh_make(&p->occluders, &place, take, &options) != OK)
        p->occluders = (struct occluder_mesh){0};
    place_free(&place);
    take_close(&take);
    recording_free(&recording);
}

static enum status build_avatar(struct avatar_builder *p)
{
    const struct progress_watch watch = {.on_progress = report_progress, .self = p};
    struct avatar_options options = avatar_default_options();
    options.watch = &watch;
    struct recording *recording = NULL;
    struct take *take = NULL;
    struct source_rays *rays = NULL;
    enum status status = open_take(p, &recording, &take);
    if (status == OK && !(take_calibration(take)->depth.width > 0))
        status = NOTHING;
    if (status == OK)
        status = source_rays_open(&rays, take_calibration(take));
    if (status == OK)
        status = avatar_make(&p->avatar, take, rays, &options);
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
    if (task == TASK_OCCLUDERS) {
        build_occluders(p);
        return;
    }
    failure_keep(&p->failure, build_avatar(p));
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
        return fail(ERR_MEMORY, "out of memory");
    p->notify = options->notify;
    p->notify_self = options->notify_self;
    p->path = strdup(options->path);
    p->take = options->take;
    p->runs = p->path && pthread_create(&p->thread, NULL, run, p) == 0;
    if (p->runs)
        return OK;
    avatar_builder_close(out);
    return fail(ERR_MEMORY, "out of memory");
}

void avatar_builder_close(struct avatar_builder **out)
{
    struct avatar_builder *p = *out;
    if (!p)
        return;
    atomic_store(&p->cancelled, true);
    if (p->runs)
        pthread_join(p->thread, NULL);
    avatar_free(&p->avatar);
    occluder_mesh_free(&p->occluders);
    free(p->path);
    free(p);
    *out = NULL;
}

double avatar_builder_progress(const struct avatar_builder *p)
{
    return (double)atomic_load(&p->done) / PROGRESS_STEPS;
}

bool avatar_builder_finished(struct avatar_builder *p, struct avatar *avatar, struct occluder_mesh *occluders,
                             enum status *status)
{
    if (!atomic_load(&p->ended))
        return false;
    *status = failure_restore(&p->failure);
    *avatar = p->avatar;
    *occluders = p->occluders;
    p->avatar = (struct avatar){0};
    p->occluders = (struct occluder_mesh){0};
    return true;
}
