#include "app/camera/camera_feed.h"

#include "app/camera/camera_localizer.h"
#include "app/camera/mailbox.h"
#include "app/camera/present_gap.h"
#include "app/state/frame_skip.h"
#include "base/clock.h"
#include "platform/source.h"

#include <errno.h>
#include <pthread.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

// One waits to be located, one to be looked at; each of the three threads holds at
// most two, while it changes one for another.
enum { PICTURES = 8 };

static const int64_t RETRY_NS = 1000000000;

struct picture {
    struct sight sight;
    uint8_t *rgb;
    size_t bytes;
    int64_t time_ns;   // the camera's
    struct loan *loan; // the same where it lies; NULL
    struct picture *next_free;
};

struct eyes {
    char *camera;
    const struct place *place;
    void (*news)(void *self);
    void *news_self;

    struct picture pictures[PICTURES];
    bool borrow;
    struct latest *seen, *located;
    struct lull *lull;
    struct picture *shown; // the looker's
    pthread_t camera_thread, finder_thread;
    bool camera_runs, finder_runs;

    pthread_mutex_t lock; // of what follows
    pthread_cond_t changed;
    struct picture *free_pictures;
    struct eyes_state state;
    bool resting, closing;
    struct lens lens; // as the finder knows it; width 0: nobody has looked through it since the camera was opened
};

static void tell(struct eyes *e)
{
    if (e->news)
        e->news(e->news_self);
}

static struct picture *get_free(struct eyes *e)
{
    pthread_mutex_lock(&e->lock);
    struct picture *p = e->free_pictures;
    assert(p); // there are enough for everybody
    e->free_pictures = p->next_free;
    pthread_mutex_unlock(&e->lock);
    return p;
}

static void give_back(struct eyes *e, struct picture *p)
{
    if (!p)
        return;
    loan_return(&p->loan);
    pthread_mutex_lock(&e->lock);
    p->next_free = e->free_pictures;
    e->free_pictures = p;
    pthread_mutex_unlock(&e->lock);
}

static void say_trouble(struct eyes *e, const char *sentence)
{
    pthread_mutex_lock(&e->lock);
    bool same = !strcmp(e->state.trouble, sentence);
    strncpy(e->state.trouble, sentence, sizeof e->state.trouble - 1);
    if (*sentence)
        e->state.seeing = false;
    pthread_mutex_unlock(&e->lock);
    if (!same)
        tell(e);
}

// ---------------------------------------------------------------- the camera's thread

static bool must_stop(struct eyes *e)
{
    pthread_mutex_lock(&e->lock);
    bool stop = e->closing || e->resting;
    pthread_mutex_unlock(&e->lock);
    return stop;
}

// Until then, or until there is something else to do.
static void wait_until(struct eyes *e, int64_t when_ns)
{
    pthread_mutex_lock(&e->lock);
    while (!e->closing && !e->resting) {
        const struct timespec until = {(time_t)(when_ns / 1000000000), (long)(when_ns % 1000000000)};
        if (pthread_cond_timedwait(&e->changed, &e->lock, &until) == ETIMEDOUT)
            break;
    }
    pthread_mutex_unlock(&e->lock);
}

static bool fill(struct picture *p, const struct frame *frame, const struct lens *lens)
{
    size_t bytes = 3 * (size_t)lens->width * (size_t)lens->height;
    if (bytes != p->bytes) {
        free(p->rgb);
        p->rgb = malloc(bytes);
        p->bytes = p->rgb ? bytes : 0;
    }
    if (!p->rgb)
        return false;
    memcpy(p->rgb, frame->color, bytes);
    p->time_ns = frame->time_ns;
    p->sight = (struct sight){.rgb = p->rgb, .lens = *lens};
    return true;
}

static void let_go(struct eyes *e, struct picture *p)
{
    pthread_mutex_lock(&e->lock);
    e->state.let_go++;
    pthread_mutex_unlock(&e->lock);
    give_back(e, p);
}

static void put_seen(struct eyes *e, struct picture *p)
{
    pthread_mutex_lock(&e->lock);
    p->sight.came_ns = e->state.came_ns = clock_now_ns();
    p->sight.number = ++e->state.came;
    e->state.seeing = true;
    e->state.trouble[0] = 0;
    pthread_mutex_unlock(&e->lock);
    struct picture *late = latest_put(e->seen, p);
    if (late)
        let_go(e, late);
}

// Until the camera ends, fails or is to rest. *next_ns: when a folder that begins anew is to give its first
// picture, which then comes after the last as that one after the one before.
static enum status watch_camera(struct eyes *e, struct source *camera, int64_t *next_ns)
{
    const bool live = source_is_live(camera);
    if (e->borrow)
        source_lend(camera);
    int64_t began_ns = 0, first_ns = 0, due_ns = 0;
    while (!must_stop(e)) {
        struct frame frame;
        enum status status = source_next(camera, &frame);
        if (status == ERR_INPUT || (status == OK && !frame.color))
            continue; // one damaged picture
        if (status != OK)
            return status;
        if (!live) {
            const int64_t now_ns = clock_now_ns(), before_ns = due_ns;
            if (!began_ns) {
                began_ns = now_ns > *next_ns ? now_ns : *next_ns;
                first_ns = frame.time_ns;
            }
            due_ns = began_ns + frame.time_ns - first_ns;
            *next_ns = before_ns ? 2 * due_ns - before_ns : due_ns;
            wait_until(e, due_ns);
        }
        struct picture *p = get_free(e);
        p->loan = frame.loan;
        if (!fill(p, &frame, &source_calibration(camera)->color)) {
            give_back(e, p);
            return fail(ERR_MEMORY, "no memory for the camera's picture");
        }
        put_seen(e, p);
    }
    return OK;
}

static void forget_lens(struct eyes *e)
{
    pthread_mutex_lock(&e->lock);
    e->lens = (struct lens){0};
    pthread_mutex_unlock(&e->lock);
}

static void keep_lens(struct eyes *e, const struct source *camera)
{
    pthread_mutex_lock(&e->lock);
    const struct lens lens = e->lens;
    pthread_mutex_unlock(&e->lock);
    if (lens.width && source_keep_lens(camera, &lens) < 0)
        say_trouble(e, status_sentence()); // it has to be learnt again
}

static void *camera_thread(void *self)
{
    struct eyes *e = self;
    int64_t next_ns = 0;
    for (;;) {
        pthread_mutex_lock(&e->lock);
        while (e->resting && !e->closing)
            pthread_cond_wait(&e->changed, &e->lock);
        bool closing = e->closing;
        e->state.came_ns = clock_now_ns();
        pthread_mutex_unlock(&e->lock);
        if (closing)
            return NULL;
        struct source *camera;
        int64_t came_before = eyes_state(e).came;
        enum status status = source_open(&camera, e->camera, SOURCE_CAMERA);
        if (status == OK) {
            forget_lens(e); // of the camera before
            status = watch_camera(e, camera, &next_ns);
            keep_lens(e, camera);
            source_close(&camera);
        }
        bool empty = status == NOTHING && eyes_state(e).came == came_before;
        if (empty)
            status = fail(ERR_DEVICE, "%s holds no picture", e->camera);
        if (status < 0) {
            say_trouble(e, status_sentence());
            wait_until(e, clock_now_ns() + RETRY_NS);
        }
    }
}

// ---------------------------------------------------------------- the finder's thread

static enum status find_in(struct eyes *e, struct finder *finder, struct picture *p)
{
    enum status status = finder_find(finder, p->rgb, p->time_ns, &p->sight.world_from_camera);
    p->sight.lens = *finder_lens(finder);
    p->sight.moved_tags = finder_moved_tags(finder, &p->sight.first_moved);
    pthread_mutex_lock(&e->lock);
    e->lens = p->sight.lens;
    pthread_mutex_unlock(&e->lock);
    return status;
}

static void *finder_thread(void *self)
{
    struct eyes *e = self;
    struct finder *finder = NULL;
    struct lens lens = {0};
    struct pace pace = {0};
    for (struct picture *p; (p = latest_take(e->seen, true));) {
        struct sight *s = &p->sight;
        s->locating_ns = clock_now_ns();
        enum status status = OK;
        if (e->place && (!finder || !lens_same(&lens, &s->lens))) {
            finder_close(&finder);
            lens = s->lens;
            status = finder_open(&finder, e->place, &lens, e->lull);
        }
        if (finder && status == OK)
            status = find_in(e, finder, p);
        s->placed = finder && (status == OK || status == AMBIGUOUS);
        s->located_ns = clock_now_ns();
        if (status < 0)
            say_trouble(e, status_sentence());
        if (pace_passes_over(&pace, (double)(s->located_ns - s->locating_ns) * 1e-6, s->placed,
                             latest_waits(e->seen))) {
            let_go(e, p);
            continue;
        }
        give_back(e, latest_put(e->located, p));
        tell(e);
    }
    finder_close(&finder);
    return NULL;
}

// ---------------------------------------------------------------- the looker's side

static enum status start(struct eyes *e)
{
    enum status status = latest_open(&e->seen);
    if (status == OK)
        status = latest_open(&e->located);
    if (status == OK)
        status = lull_open(&e->lull);
    if (status != OK)
        return status;
    e->finder_runs = !pthread_create(&e->finder_thread, NULL, finder_thread, e);
    e->camera_runs = e->finder_runs && !pthread_create(&e->camera_thread, NULL, camera_thread, e);
    return e->camera_runs ? OK : fail(ERR_MEMORY, "no thread for the camera");
}

enum status eyes_open(struct eyes **out, const struct eyes_options *options)
{
    *out = NULL;
    struct eyes *e = calloc(1, sizeof *e);
    if (!e)
        return fail(ERR_MEMORY, "out of memory");
    pthread_mutex_init(&e->lock, NULL);
    pthread_condattr_t clock;
    pthread_condattr_init(&clock);
    pthread_condattr_setclock(&clock, CLOCK_MONOTONIC); // clock_now_ns's
    pthread_cond_init(&e->changed, &clock);
    pthread_condattr_destroy(&clock);
    e->place = options->place;
    e->news = options->news;
    e->news_self = options->news_self;
    e->borrow = options->borrow;
    for (int i = 0; i < PICTURES; i++)
        give_back(e, &e->pictures[i]);
    e->camera = strdup(options->camera);
    enum status status = e->camera ? start(e) : fail(ERR_MEMORY, "out of memory");
    if (status != OK) {
        eyes_close(&e);
        return status;
    }
    *out = e;
    return OK;
}

void eyes_close(struct eyes **out)
{
    struct eyes *e = *out;
    if (!e)
        return;
    pthread_mutex_lock(&e->lock);
    e->closing = true;
    pthread_cond_broadcast(&e->changed);
    pthread_mutex_unlock(&e->lock);
    if (e->camera_runs)
        pthread_join(e->camera_thread, NULL);
    if (e->seen)
        latest_stop(e->seen);
    if (e->finder_runs)
        pthread_join(e->finder_thread, NULL);
    latest_close(&e->seen);
    latest_close(&e->located);
    lull_close(&e->lull);
    for (int i = 0; i < PICTURES; i++) {
        loan_return(&e->pictures[i].loan);
        free(e->pictures[i].rgb);
    }
    pthread_cond_destroy(&e->changed);
    pthread_mutex_destroy(&e->lock);
    free(e->camera);
    free(e);
    *out = NULL;
}

const struct sight *eyes_look(struct eyes *e)
{
    struct picture *newer = latest_take(e->located, false);
    if (newer) {
        give_back(e, e->shown);
        e->shown = newer;
    }
    return e->shown ? &e->shown->sight : NULL;
}

struct loan *eyes_take_loan(struct eyes *e)
{
    struct loan *loan = e->shown ? e->shown->loan : NULL;
    if (loan)
        e->shown->loan = NULL;
    return loan;
}

void eyes_shown(struct eyes *e) { lull_begins(e->lull); }

struct eyes_state eyes_state(struct eyes *e)
{
    pthread_mutex_lock(&e->lock);
    struct eyes_state state = e->state;
    pthread_mutex_unlock(&e->lock);
    return state;
}

void eyes_rest(struct eyes *e, bool rest)
{
    pthread_mutex_lock(&e->lock);
    e->resting = rest;
    pthread_cond_broadcast(&e->changed);
    pthread_mutex_unlock(&e->lock);
}
