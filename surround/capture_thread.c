#include "surround/capture_thread.h"

#include "base/threads.h"
#include "surround/picture/surround_mesh.h"
#include "surround/surroundings.h"

#include <pthread.h>
#include <stdatomic.h>
#include <stdlib.h>

struct capture_thread {
    struct depth_alignment *alignment;
    struct photo_refinement *photo;
    struct depth_options depth;
    int64_t (*clock)(void);
    struct queue *fresh, *placed, *aligned, *done; // of struct capture_job *
    pthread_t align_thread, depth_thread;
    bool align_runs, depth_runs;
    atomic_bool closing; // what waits is left as it is
    int in_flight;       // the caller's thread alone
};

static void free_job(struct capture_job **job)
{
    struct capture_job *j = *job;
    if (!j)
        return;
    if (j->again) { // the rest is borrowed
        free(j->picture.inverse);
        free(j->picture.joined);
        surround_picture_free_mesh(&j->picture);
    } else
        surround_picture_free(&j->picture);
    depth_points_free(&j->points);
    if (j->surface)
        surface_points_free(j->surface);
    free(j->surface);
    free(j);
    *job = NULL;
}

static void align_capture(struct capture_thread *thread, struct capture_job *job)
{
    const int64_t before = thread->clock ? thread->clock() : 0;
    enum status status = photo_alignment_add(thread->photo, thread->alignment, &job->picture, &job->points,
                                             job->odometry, &job->world_from_body);
    job->align_ns = thread->clock ? thread->clock() - before : 0;
    job->fits = status == OK;
    depth_points_free(&job->points);
    surround_picture_place(&job->picture, pose_multiply(job->world_from_body, thread->photo->body_from_picture));
    if (status >= OK)
        status = (job->surface = calloc(1, sizeof *job->surface))
                     ? surface_points_gather(job->surface, &thread->alignment->surface)
                     : fail(ERR_MEMORY, "no memory for aligning captures");
    failure_keep(&job->failure, status);
}

// The queues hold more than CAPTURE_MAX items: a put never waits.
static void *align_all(void *self)
{
    struct capture_thread *t = self;
    struct capture_job *job;
    while ((job = queue_take(t->fresh))) {
        const bool align_it = !job->again && !t->closing;
        struct capture_job *pose = align_it ? malloc(sizeof *pose) : NULL;
        if (align_it)
            align_capture(t, job);
        if (pose) { // without memory for it the pose comes with the depth
            *pose = *job;
            pose->picture = (struct surround_picture){0};
            pose->surface = NULL;
            queue_put(t->aligned, pose);
        }
        queue_put(t->placed, job);
    }
    queue_stop(t->placed);
    return NULL;
}

static void *make_depths(void *self)
{
    struct capture_thread *t = self;
    struct surface_points *newest = NULL;
    struct capture_job *job;
    thread_lower_priority();
    while ((job = queue_take(t->placed))) {
        if (job->surface) {
            if (newest)
                surface_points_free(newest);
            free(newest);
            newest = job->surface;
            job->surface = NULL;
        }
        if (job->failure.status == OK && newest && !t->closing) {
            const struct world_points points = surface_points_world(newest);
            enum status status = dense_depth_make(&job->picture, &points, &t->depth);
            if (status == OK)
                status = surround_picture_make_mesh(&job->picture);
            failure_keep(&job->failure, status);
        }
        queue_put(t->done, job);
    }
    if (newest)
        surface_points_free(newest);
    free(newest);
    return NULL;
}

enum status capture_thread_open(struct capture_thread **out, struct depth_alignment *alignment,
                                struct photo_refinement *photo, const struct depth_options *depth,
                                int64_t (*clock)(void))
{
    struct capture_thread *t = calloc(1, sizeof *t);
    *out = t;
    if (!t)
        return fail(ERR_MEMORY, "no memory for aligning captures");
    t->alignment = alignment;
    t->photo = photo;
    t->depth = *depth;
    t->clock = clock;
    struct queue **const queues[] = {&t->fresh, &t->placed, &t->aligned, &t->done};
    enum status status = OK;
    for (size_t i = 0; i < COUNT_OF(queues) && status == OK; i++)
        status = queue_open(queues[i], 2 * CAPTURE_MAX);
    if (status == OK) {
        t->align_runs = !pthread_create(&t->align_thread, NULL, align_all, t);
        t->depth_runs = t->align_runs && !pthread_create(&t->depth_thread, NULL, make_depths, t);
        if (!t->depth_runs)
            status = fail(ERR_MEMORY, "the system gives no more threads");
    }
    if (status != OK)
        capture_thread_close(out);
    return status;
}

void capture_thread_close(struct capture_thread **out)
{
    struct capture_thread *t = *out;
    if (!t)
        return;
    struct queue **const queues[] = {&t->fresh, &t->placed, &t->aligned, &t->done};
    t->closing = true;
    if (t->align_runs) {
        queue_stop(t->fresh);
        pthread_join(t->align_thread, NULL); // it stops `placed`
    }
    if (t->depth_runs)
        pthread_join(t->depth_thread, NULL);
    for (size_t i = 0; i < COUNT_OF(queues); i++) {
        while (*queues[i] && queue_count(*queues[i])) {
            struct capture_job *job = queue_take(*queues[i]);
            free_job(&job);
        }
        queue_close(queues[i]);
    }
    free(t);
    *out = NULL;
}

int capture_thread_count(const struct capture_thread *thread) { return thread->in_flight; }

enum status capture_thread_put(struct capture_thread *t, const struct capture_job *job)
{
    if (t->in_flight == CAPTURE_MAX)
        return NOTHING;
    struct capture_job *own = malloc(sizeof *own);
    if (!own)
        return fail(ERR_MEMORY, "no memory for aligning captures");
    *own = *job;
    own->surface = NULL;
    own->failure = (struct failure){0};
    queue_put(t->fresh, own);
    t->in_flight++;
    return OK;
}

enum capture_stage capture_thread_take(struct capture_thread *t, struct capture_job *out)
{
    const bool aligned = queue_count(t->aligned) > 0;
    if (!aligned && !queue_count(t->done))
        return CAPTURE_NONE;
    struct capture_job *job = queue_take(aligned ? t->aligned : t->done);
    *out = *job;
    free(job); // what it held is the caller's
    t->in_flight -= !aligned;
    return aligned ? CAPTURE_ALIGNED : CAPTURE_WITH_DEPTH;
}
