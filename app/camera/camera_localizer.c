#include "app/camera/camera_localizer.h"

#include "base/threads.h"
#include "locate/camera_tracker.h"

#include <stdlib.h>
#include <string.h>

// ---------------------------------------------------------------- relocalizer, types

// Relocalises a lost camera on a thread of its own: in the image in which it was lost, then by tracking through the
// images that arrived since, until there is no newer one.
//
// The camera_tracker is lent from relocalizer_begin until relocalizer_busy returns false. One thread calls.

struct relocalizer;

static void relocalizer_close(struct relocalizer **r);

// ---------------------------------------------------------------- relocalizer

// At max_finds so many images are tracked after the camera was found, each time the newest. Where tracking takes longer
// than until the next image arrives, as on a busy machine, it never catches up: the caller then tracks on from there.
enum { MAX_TRACKED = 3 };

struct relocalizer_frame {
    uint8_t *color;
    int64_t time_ns;
};

struct relocalizer {
    size_t bytes;
    struct present_gap *gap;
    struct relocalizer_frame current; // used by the thread while it runs
    struct worker_thread worker;

    // Under its lock, which is never held while an image is processed:
    struct camera_tracker *tracker; // lent; NULL: none
    struct relocalizer_frame newer;
    bool newer_pending;
    int max_finds, finds;
    int64_t gap_count;      // when the tracker was lent
    struct failure failure; // of the last run
};

// A solver that failed did so on this image only.
static enum status drop_solver_failure(enum status status) { return status == ERR_SOLVER ? NOTHING : status; }

static bool is_found(enum status status) { return status == OK || status == AMBIGUOUS; }

static enum status localize_frame(struct camera_tracker *tracker, const struct relocalizer_frame *frame)
{
    struct location location;
    struct camera_motion motion;
    return drop_solver_failure(camera_tracker_localize(tracker, frame->color, NULL, &location, &motion));
}

static enum status track_frame(struct camera_tracker *tracker, const struct relocalizer_frame *frame)
{
    struct location location;
    struct camera_motion motion;
    return drop_solver_failure(camera_tracker_track(tracker, frame->color, NULL, frame->time_ns, &location, &motion));
}

// Makes the newest image the current one; wait: blocks until there is a newer one. False: there is none.
static bool take_newer(struct relocalizer *relocalizer, bool wait)
{
    pthread_mutex_lock(&relocalizer->worker.lock);
    while (wait && !relocalizer->newer_pending && !relocalizer->worker.closing)
        pthread_cond_wait(&relocalizer->worker.changed, &relocalizer->worker.lock);
    const bool newer = relocalizer->newer_pending && !relocalizer->worker.closing;
    if (newer) {
        const struct relocalizer_frame swap = relocalizer->current;
        relocalizer->current = relocalizer->newer;
        relocalizer->newer = swap;
        relocalizer->newer_pending = false;
    }
    pthread_mutex_unlock(&relocalizer->worker.lock);
    return newer;
}

static enum status search(struct relocalizer *relocalizer, struct camera_tracker *tracker, int max_finds, int *finds)
{
    enum status status = localize_frame(tracker, &relocalizer->current);
    int tracked = 0; // since the camera was last found
    *finds = is_found(status);
    while (status >= 0 && tracked < MAX_TRACKED && take_newer(relocalizer, !is_found(status))) {
        status = track_frame(tracker, &relocalizer->current);
        tracked++;
        if (status == ERR_ORDER || (status == NOTHING && *finds == max_finds))
            return NOTHING; // the camera's clock restarted, or tracking fails even with a known velocity
        if (status == NOTHING) {
            status = localize_frame(tracker, &relocalizer->current);
            *finds += is_found(status);
            tracked = 0;
        }
    }
    return status;
}

static void *run(void *self)
{
    struct relocalizer *r = self;
    thread_lower_priority();
    pthread_mutex_lock(&r->worker.lock);
    while (!r->worker.closing) {
        struct camera_tracker *tracker = r->tracker;
        if (!tracker) {
            pthread_cond_wait(&r->worker.changed, &r->worker.lock);
            continue;
        }
        const int max_finds = r->max_finds;
        const int64_t gap_count = r->gap_count;
        pthread_mutex_unlock(&r->worker.lock);
        if (r->gap)
            present_gap_wait(r->gap, gap_count);
        int finds;
        enum status status = search(r, tracker, max_finds, &finds);
        pthread_mutex_lock(&r->worker.lock);
        r->finds = finds;
        failure_keep(&r->failure, status);
        r->newer_pending = false;
        r->tracker = NULL;
    }
    pthread_mutex_unlock(&r->worker.lock);
    return NULL;
}

// ---------------------------------------------------------------- calling thread

// width, height: of the images. gap: when to start; NULL: immediately; must outlive the relocalizer. ERR_MEMORY: *out
// is NULL. Keeps two images.
static enum status relocalizer_open(struct relocalizer **out, int width, int height, struct present_gap *gap)
{
    struct relocalizer *r = *out = calloc(1, sizeof *r);
    if (!r)
        return fail(ERR_MEMORY, "no memory for finding the camera");
    worker_thread_open(&r->worker);
    r->gap = gap;
    r->bytes = 3 * (size_t)width * (size_t)height;
    r->current.color = malloc(r->bytes);
    r->newer.color = malloc(r->bytes);
    enum status status = r->current.color && r->newer.color ? OK : fail(ERR_MEMORY, "no memory for finding the camera");
    if (status == OK)
        status = worker_thread_start(&r->worker, run, r, "to find the camera again");
    if (status != OK)
        relocalizer_close(out);
    return status;
}

// NULL is fine; waits for the image in work, a part of a second
static void relocalizer_close(struct relocalizer **out)
{
    struct relocalizer *r = *out;
    if (!r)
        return;
    worker_thread_close(&r->worker);
    free(r->current.color);
    free(r->newer.color);
    free(r);
    *out = NULL;
}

static void store_frame(struct relocalizer_frame *frame, const struct relocalizer *relocalizer, const uint8_t *color,
                        int64_t time_ns)
{
    memcpy(frame->color, color, relocalizer->bytes);
    frame->time_ns = time_ns;
}

// tracker: one that lost the camera in the image of time_ns. color: RGB; copied. finds: in how many images the camera
// may be localised from scratch, at least 1, where it cannot be tracked from one to the next.
static void relocalizer_begin(struct relocalizer *relocalizer, struct camera_tracker *tracker, const uint8_t *color,
                              int64_t time_ns, int finds)
{
    const int64_t gap_count = relocalizer->gap ? present_gap_count(relocalizer->gap) : 0;
    pthread_mutex_lock(&relocalizer->worker.lock);
    assert(!relocalizer->tracker);
    relocalizer->gap_count = gap_count;
    store_frame(&relocalizer->current, relocalizer, color, time_ns);
    relocalizer->tracker = tracker;
    relocalizer->max_finds = finds;
    pthread_cond_broadcast(&relocalizer->worker.changed);
    pthread_mutex_unlock(&relocalizer->worker.lock);
}

// Whether it is still running. If so it takes this newer image, too; color: RGB; copied.
static bool relocalizer_busy(struct relocalizer *relocalizer, const uint8_t *color, int64_t time_ns)
{
    pthread_mutex_lock(&relocalizer->worker.lock);
    const bool busy = relocalizer->tracker;
    if (busy) {
        store_frame(&relocalizer->newer, relocalizer, color, time_ns);
        relocalizer->newer_pending = true;
        pthread_cond_broadcast(&relocalizer->worker.changed);
    }
    pthread_mutex_unlock(&relocalizer->worker.lock);
    return busy;
}

// Once relocalizer_busy has returned false. OK, AMBIGUOUS: the camera was found, and tracked to the newest image.
// NOTHING: it was not found, or lost again. Errors as camera_tracker_process. *finds: in how many images it was
// localised from scratch.
static enum status relocalizer_finish(struct relocalizer *relocalizer, int *finds)
{
    pthread_mutex_lock(&relocalizer->worker.lock);
    assert(!relocalizer->tracker);
    const enum status status = failure_restore(&relocalizer->failure);
    *finds = relocalizer->finds;
    pthread_mutex_unlock(&relocalizer->worker.lock);
    return status;
}

// ---------------------------------------------------------------- camera localizer

// Localised in two images, the camera's velocity is known; if it cannot be tracked then, it never will.
enum { MAX_FINDS = 2 };

struct camera_localizer {
    struct camera_tracker *tracker;
    struct relocalizer *relocalizer;
    struct lens lens; // the tracker's, which may be lent
    int64_t last_ns;
    bool relocalizing;               // the tracker is lent to the relocalizer
    int finds;                       // images localised from scratch since one was tracked
    bool restarted;                  // the camera's clock has restarted
    int32_t moved_tags, first_moved; // the tracker's, which may be lent
};

enum status localizer_open(struct camera_localizer **out, const struct place *place, const struct lens *lens,
                           struct present_gap *gap)
{
    *out = NULL;
    struct camera_localizer *l = calloc(1, sizeof *l);
    if (!l)
        return fail(ERR_MEMORY, "no memory for finding the camera");
    *l = (struct camera_localizer){.lens = *lens, .last_ns = INT64_MIN, .finds = MAX_FINDS, .first_moved = -1};
    enum status status = camera_tracker_open(&l->tracker, place, lens, NULL);
    if (status == OK)
        status = relocalizer_open(&l->relocalizer, lens->width, lens->height, gap);
    if (status != OK) {
        localizer_close(&l);
        return status;
    }
    *out = l;
    return OK;
}

const struct lens *localizer_lens(const struct camera_localizer *localizer) { return &localizer->lens; }

int32_t localizer_moved_tags(const struct camera_localizer *localizer, int32_t *first)
{
    *first = localizer->first_moved;
    return localizer->moved_tags;
}

void localizer_close(struct camera_localizer **localizer)
{
    if (*localizer) {
        relocalizer_close(&(*localizer)->relocalizer); // before the tracker, which may be lent to it
        camera_tracker_close(&(*localizer)->tracker);
        free(*localizer);
    }
    *localizer = NULL;
}

static enum status relocalize_in_background(struct camera_localizer *localizer, const uint8_t *color, int64_t time_ns)
{
    relocalizer_begin(localizer->relocalizer, localizer->tracker, color, time_ns, MAX_FINDS - localizer->finds);
    localizer->relocalizing = true;
    return NOTHING;
}

static enum status track_or_find(struct camera_localizer *localizer, const uint8_t *color, int64_t time_ns,
                                 struct location *location)
{
    struct camera_motion motion;
    enum status status = camera_tracker_track(localizer->tracker, color, NULL, time_ns, location, &motion);
    if (status == OK)
        localizer->finds = 0;
    if (status == NOTHING && localizer->finds >= MAX_FINDS)
        status = camera_tracker_localize(localizer->tracker, color, NULL, location, &motion);
    else if (status == NOTHING)
        return relocalize_in_background(localizer, color, time_ns);
    localizer->lens = *camera_tracker_lens(localizer->tracker);
    localizer->moved_tags = camera_tracker_moved_tags(localizer->tracker, &localizer->first_moved);
    return status;
}

enum status localizer_locate(struct camera_localizer *l, const uint8_t *color, int64_t time_ns,
                             struct pose *world_from_camera)
{
    struct location location;
    enum status status = OK;
    l->restarted |= time_ns <= l->last_ns;
    l->last_ns = time_ns;
    if (l->relocalizing) {
        if (relocalizer_busy(l->relocalizer, color, time_ns))
            return NOTHING;
        l->relocalizing = false;
        int finds;
        status = relocalizer_finish(l->relocalizer, &finds);
        l->finds += finds;
    }
    if (l->restarted) // the camera was opened again
        camera_tracker_reset(l->tracker);
    l->restarted = false;
    if (status >= 0)
        status = track_or_find(l, color, time_ns, &location);
    if (status == ERR_SOLVER)
        return NOTHING; // only this image failed
    if (status == OK || status == AMBIGUOUS)
        *world_from_camera = location.world_from_camera;
    return status;
}
