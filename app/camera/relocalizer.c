#include "app/camera/relocalizer.h"

#include "base/thread_priority.h"

#include <pthread.h>
#include <stdlib.h>
#include <string.h>

// Each time it follows the newest picture. Where following takes longer than until the next one comes, as on a busy
// machine, it is always behind: then whoever lent the track goes on from there, over the gap.
enum { MAX_FOLLOWED = 3 };

struct relocalizer_frame {
    uint8_t *color;
    int64_t time_ns;
};

struct relocalizer {
    size_t bytes;
    struct present_gap *gap;
    pthread_t thread;
    bool runs;
    struct relocalizer_frame current; // the thread's, while it searches

    pthread_mutex_t lock; // of what follows; never held while a picture is looked at
    pthread_cond_t changed;
    struct camera_tracker *track; // NULL: none is lent
    struct relocalizer_frame newer;
    bool newer_pending, closing;
    int max_finds, finds;
    int64_t gap_count;      // when it was lent
    struct failure failure; // of the last search
};

// A solver that gave up did so on this picture, no more.
static enum status drop_solver_failure(enum status status) { return status == ERR_SOLVER ? NOTHING : status; }

static bool is_found(enum status status) { return status == OK || status == AMBIGUOUS; }

static enum status find(struct camera_tracker *track, const struct relocalizer_frame *p)
{
    struct location location;
    struct camera_motion motion;
    return drop_solver_failure(camera_tracker_localize(track, p->color, NULL, &location, &motion));
}

static enum status follow(struct camera_tracker *track, const struct relocalizer_frame *p)
{
    struct location location;
    struct camera_motion motion;
    return drop_solver_failure(camera_tracker_track(track, p->color, NULL, p->time_ns, &location, &motion));
}

// Takes the newest picture in hand; wait: for one that is newer. False: there is none.
static bool take_newer(struct relocalizer *s, bool wait)
{
    pthread_mutex_lock(&s->lock);
    while (wait && !s->newer_pending && !s->closing)
        pthread_cond_wait(&s->changed, &s->lock);
    const bool newer = s->newer_pending && !s->closing;
    if (newer) {
        const struct relocalizer_frame before = s->current;
        s->current = s->newer;
        s->newer = before;
        s->newer_pending = false;
    }
    pthread_mutex_unlock(&s->lock);
    return newer;
}

static enum status search(struct relocalizer *s, struct camera_tracker *track, int most, int *finds)
{
    enum status status = find(track, &s->current);
    int followed = 0; // since it was found
    *finds = is_found(status);
    while (status >= 0 && followed < MAX_FOLLOWED && take_newer(s, !is_found(status))) {
        status = follow(track, &s->current);
        followed++;
        if (status == ERR_ORDER || (status == NOTHING && *finds == most))
            return NOTHING; // the camera's clock began anew, or to know its speed does not help
        if (status == NOTHING) {
            status = find(track, &s->current);
            *finds += is_found(status);
            followed = 0;
        }
    }
    return status;
}

static void *run(void *self)
{
    struct relocalizer *s = self;
    thread_lower_priority();
    pthread_mutex_lock(&s->lock);
    while (!s->closing) {
        struct camera_tracker *track = s->track;
        if (!track) {
            pthread_cond_wait(&s->changed, &s->lock);
            continue;
        }
        const int most = s->max_finds;
        const int64_t gap_count = s->gap_count;
        pthread_mutex_unlock(&s->lock);
        if (s->gap)
            present_gap_wait(s->gap, gap_count);
        int finds;
        enum status status = search(s, track, most, &finds);
        pthread_mutex_lock(&s->lock);
        s->finds = finds;
        failure_keep(&s->failure, status);
        s->newer_pending = false;
        s->track = NULL;
    }
    pthread_mutex_unlock(&s->lock);
    return NULL;
}

// ---------------------------------------------------------------- the other side

enum status relocalizer_open(struct relocalizer **out, int width, int height, struct present_gap *gap)
{
    struct relocalizer *s = *out = calloc(1, sizeof *s);
    if (!s)
        return fail(ERR_MEMORY, "out of memory");
    pthread_mutex_init(&s->lock, NULL);
    pthread_cond_init(&s->changed, NULL);
    s->gap = gap;
    s->bytes = 3 * (size_t)width * (size_t)height;
    s->current.color = malloc(s->bytes);
    s->newer.color = malloc(s->bytes);
    s->runs = s->current.color && s->newer.color && !pthread_create(&s->thread, NULL, run, s);
    if (s->runs)
        return OK;
    relocalizer_close(out);
    return fail(ERR_MEMORY, "out of memory");
}

void relocalizer_close(struct relocalizer **out)
{
    struct relocalizer *s = *out;
    if (!s)
        return;
    pthread_mutex_lock(&s->lock);
    s->closing = true;
    pthread_cond_broadcast(&s->changed);
    pthread_mutex_unlock(&s->lock);
    if (s->runs)
        pthread_join(s->thread, NULL);
    pthread_cond_destroy(&s->changed);
    pthread_mutex_destroy(&s->lock);
    free(s->current.color);
    free(s->newer.color);
    free(s);
    *out = NULL;
}

static void store_frame(struct relocalizer_frame *p, const struct relocalizer *s, const uint8_t *color, int64_t time_ns)
{
    memcpy(p->color, color, s->bytes);
    p->time_ns = time_ns;
}

void relocalizer_begin(struct relocalizer *s, struct camera_tracker *track, const uint8_t *color, int64_t time_ns,
                       int finds)
{
    const int64_t gap_count = s->gap ? present_gap_count(s->gap) : 0;
    pthread_mutex_lock(&s->lock);
    assert(!s->track);
    s->gap_count = gap_count;
    store_frame(&s->current, s, color, time_ns);
    s->track = track;
    s->max_finds = finds;
    pthread_cond_broadcast(&s->changed);
    pthread_mutex_unlock(&s->lock);
}

bool relocalizer_busy(struct relocalizer *s, const uint8_t *color, int64_t time_ns)
{
    pthread_mutex_lock(&s->lock);
    const bool goes_on = s->track;
    if (goes_on) {
        store_frame(&s->newer, s, color, time_ns);
        s->newer_pending = true;
        pthread_cond_broadcast(&s->changed);
    }
    pthread_mutex_unlock(&s->lock);
    return goes_on;
}

enum status relocalizer_finish(struct relocalizer *s, int *finds)
{
    pthread_mutex_lock(&s->lock);
    assert(!s->track);
    const enum status status = failure_restore(&s->failure);
    *finds = s->finds;
    pthread_mutex_unlock(&s->lock);
    return status;
}
