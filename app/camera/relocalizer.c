#include "app/camera/relocalizer.h"

#include "base/thread_priority.h"
#include "base/worker_thread.h"

#include <stdlib.h>
#include <string.h>

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

static enum status localize_frame(struct camera_tracker *tracker, const struct relocalizer_frame *p)
{
    struct location location;
    struct camera_motion motion;
    return drop_solver_failure(camera_tracker_localize(tracker, p->color, NULL, &location, &motion));
}

static enum status track_frame(struct camera_tracker *tracker, const struct relocalizer_frame *p)
{
    struct location location;
    struct camera_motion motion;
    return drop_solver_failure(camera_tracker_track(tracker, p->color, NULL, p->time_ns, &location, &motion));
}

// Makes the newest image the current one; wait: blocks until there is a newer one. False: there is none.
static bool take_newer(struct relocalizer *r, bool wait)
{
    pthread_mutex_lock(&r->worker.lock);
    while (wait && !r->newer_pending && !r->worker.closing)
        pthread_cond_wait(&r->worker.changed, &r->worker.lock);
    const bool newer = r->newer_pending && !r->worker.closing;
    if (newer) {
        const struct relocalizer_frame swap = r->current;
        r->current = r->newer;
        r->newer = swap;
        r->newer_pending = false;
    }
    pthread_mutex_unlock(&r->worker.lock);
    return newer;
}

static enum status search(struct relocalizer *r, struct camera_tracker *tracker, int max_finds, int *finds)
{
    enum status status = localize_frame(tracker, &r->current);
    int tracked = 0; // since the camera was last found
    *finds = is_found(status);
    while (status >= 0 && tracked < MAX_TRACKED && take_newer(r, !is_found(status))) {
        status = track_frame(tracker, &r->current);
        tracked++;
        if (status == ERR_ORDER || (status == NOTHING && *finds == max_finds))
            return NOTHING; // the camera's clock restarted, or tracking fails even with a known velocity
        if (status == NOTHING) {
            status = localize_frame(tracker, &r->current);
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

enum status relocalizer_open(struct relocalizer **out, int width, int height, struct present_gap *gap)
{
    struct relocalizer *r = *out = calloc(1, sizeof *r);
    if (!r)
        return fail(ERR_MEMORY, "out of memory");
    worker_thread_open(&r->worker);
    r->gap = gap;
    r->bytes = 3 * (size_t)width * (size_t)height;
    r->current.color = malloc(r->bytes);
    r->newer.color = malloc(r->bytes);
    enum status status = r->current.color && r->newer.color ? OK : fail(ERR_MEMORY, "out of memory");
    if (status == OK)
        status = worker_thread_start(&r->worker, run, r, "to find the camera again");
    if (status != OK)
        relocalizer_close(out);
    return status;
}

void relocalizer_close(struct relocalizer **out)
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

static void store_frame(struct relocalizer_frame *p, const struct relocalizer *r, const uint8_t *color, int64_t time_ns)
{
    memcpy(p->color, color, r->bytes);
    p->time_ns = time_ns;
}

void relocalizer_begin(struct relocalizer *r, struct camera_tracker *tracker, const uint8_t *color, int64_t time_ns,
                       int finds)
{
    const int64_t gap_count = r->gap ? present_gap_count(r->gap) : 0;
    pthread_mutex_lock(&r->worker.lock);
    assert(!r->tracker);
    r->gap_count = gap_count;
    store_frame(&r->current, r, color, time_ns);
    r->tracker = tracker;
    r->max_finds = finds;
    pthread_cond_broadcast(&r->worker.changed);
    pthread_mutex_unlock(&r->worker.lock);
}

bool relocalizer_busy(struct relocalizer *r, const uint8_t *color, int64_t time_ns)
{
    pthread_mutex_lock(&r->worker.lock);
    const bool busy = r->tracker;
    if (busy) {
        store_frame(&r->newer, r, color, time_ns);
        r->newer_pending = true;
        pthread_cond_broadcast(&r->worker.changed);
    }
    pthread_mutex_unlock(&r->worker.lock);
    return busy;
}

enum status relocalizer_finish(struct relocalizer *r, int *finds)
{
    pthread_mutex_lock(&r->worker.lock);
    assert(!r->tracker);
    const enum status status = failure_restore(&r->failure);
    *finds = r->finds;
    pthread_mutex_unlock(&r->worker.lock);
    return status;
}
