#include "app/camera/relocalizer.h"

#include "base/thread_priority.h"

#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

// Each time it follows the newest picture. Where following takes longer than until the next one comes, as on a busy
// machine, it is always behind: then whoever lent the track goes on from there, over the gap.
enum { MOST_FOLLOWED = 3 };

struct search_picture {
    uint8_t *color;
    int64_t time_ns;
};

struct search {
    size_t bytes;
    struct lull *lull;
    pthread_t thread;
    bool runs;
    struct search_picture in_hand; // the thread's, while it searches

    pthread_mutex_t lock; // of what follows; never held while a picture is looked at
    pthread_cond_t changed;
    struct camera_track *track; // NULL: none is lent
    struct search_picture newer;
    bool newer_waits, closing;
    int most_finds, finds;
    int64_t lulls;      // when it was lent
    enum status status; // of the last search
    char sentence[512];
};

// A solver that gave up did so on this picture, no more.
static enum status answer(enum status status) { return status == ERR_SOLVER ? NOTHING : status; }

static bool is_found(enum status status) { return status == OK || status == AMBIGUOUS; }

static enum status find(struct camera_track *track, const struct search_picture *p)
{
    struct location location;
    struct camera_motion motion;
    return answer(camera_track_find(track, p->color, NULL, &location, &motion));
}

static enum status follow(struct camera_track *track, const struct search_picture *p)
{
    struct location location;
    struct camera_motion motion;
    return answer(camera_track_follow(track, p->color, NULL, p->time_ns, &location, &motion));
}

// Takes the newest picture in hand; wait: for one that is newer. False: there is none.
static bool take_newer(struct search *s, bool wait)
{
    pthread_mutex_lock(&s->lock);
    while (wait && !s->newer_waits && !s->closing)
        pthread_cond_wait(&s->changed, &s->lock);
    const bool newer = s->newer_waits && !s->closing;
    if (newer) {
        const struct search_picture before = s->in_hand;
        s->in_hand = s->newer;
        s->newer = before;
        s->newer_waits = false;
    }
    pthread_mutex_unlock(&s->lock);
    return newer;
}

static enum status search(struct search *s, struct camera_track *track, int most, int *finds)
{
    enum status status = find(track, &s->in_hand);
    int followed = 0; // since it was found
    *finds = is_found(status);
    while (status >= 0 && followed < MOST_FOLLOWED && take_newer(s, !is_found(status))) {
        status = follow(track, &s->in_hand);
        followed++;
        if (status == ERR_ORDER || (status == NOTHING && *finds == most))
            return NOTHING; // the camera's clock began anew, or to know its speed does not help
        if (status == NOTHING) {
            status = find(track, &s->in_hand);
            *finds += is_found(status);
            followed = 0;
        }
    }
    return status;
}

static void *run(void *self)
{
    struct search *s = self;
    background_begin();
    pthread_mutex_lock(&s->lock);
    while (!s->closing) {
        struct camera_track *track = s->track;
        if (!track) {
            pthread_cond_wait(&s->changed, &s->lock);
            continue;
        }
        const int most = s->most_finds;
        const int64_t lulls = s->lulls;
        pthread_mutex_unlock(&s->lock);
        if (s->lull)
            lull_wait(s->lull, lulls);
        int finds;
        enum status status = search(s, track, most, &finds);
        pthread_mutex_lock(&s->lock);
        s->finds = finds;
        s->status = status;
        snprintf(s->sentence, sizeof s->sentence, "%s", status < 0 ? status_sentence() : "");
        s->newer_waits = false;
        s->track = NULL;
    }
    pthread_mutex_unlock(&s->lock);
    return NULL;
}

// ---------------------------------------------------------------- the other side

enum status search_open(struct search **out, int width, int height, struct lull *lull)
{
    struct search *s = *out = calloc(1, sizeof *s);
    if (!s)
        return fail(ERR_MEMORY, "out of memory");
    pthread_mutex_init(&s->lock, NULL);
    pthread_cond_init(&s->changed, NULL);
    s->lull = lull;
    s->bytes = 3 * (size_t)width * (size_t)height;
    s->in_hand.color = malloc(s->bytes);
    s->newer.color = malloc(s->bytes);
    s->runs = s->in_hand.color && s->newer.color && !pthread_create(&s->thread, NULL, run, s);
    if (s->runs)
        return OK;
    search_close(out);
    return fail(ERR_MEMORY, "out of memory");
}

void search_close(struct search **out)
{
    struct search *s = *out;
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
    free(s->in_hand.color);
    free(s->newer.color);
    free(s);
    *out = NULL;
}

static void keep(struct search_picture *p, const struct search *s, const uint8_t *color, int64_t time_ns)
{
    memcpy(p->color, color, s->bytes);
    p->time_ns = time_ns;
}

void search_begin(struct search *s, struct camera_track *track, const uint8_t *color, int64_t time_ns, int finds)
{
    const int64_t lulls = s->lull ? lull_count(s->lull) : 0;
    pthread_mutex_lock(&s->lock);
    assert(!s->track);
    s->lulls = lulls;
    keep(&s->in_hand, s, color, time_ns);
    s->track = track;
    s->most_finds = finds;
    pthread_cond_broadcast(&s->changed);
    pthread_mutex_unlock(&s->lock);
}

bool search_goes_on(struct search *s, const uint8_t *color, int64_t time_ns)
{
    pthread_mutex_lock(&s->lock);
    const bool goes_on = s->track;
    if (goes_on) {
        keep(&s->newer, s, color, time_ns);
        s->newer_waits = true;
        pthread_cond_broadcast(&s->changed);
    }
    pthread_mutex_unlock(&s->lock);
    return goes_on;
}

enum status search_end(struct search *s, int *finds)
{
    pthread_mutex_lock(&s->lock);
    assert(!s->track);
    const enum status status = s->status;
    *finds = s->finds;
    pthread_mutex_unlock(&s->lock);
    return status < 0 ? fail(status, "%s", s->sentence) : status;
}
