#include "app/camera/camera_feed.h"

#include "app/camera/camera_localizer.h"
#include "app/camera/mailbox.h"
#include "app/camera/present_gap.h"
#include "app/state/frame_skip.h"
#include "base/clock.h"
#include "base/condition.h"
#include "platform/source.h"

#include <pthread.h>
#include <stdlib.h>
#include <string.h>

// One waits to be located, one to be looked at; each of the three threads holds at
// most two, while it changes one for another.
enum { FEED_SLOTS = 8 };

static const int64_t RETRY_NS = 1000000000;

struct feed_slot {
    struct camera_frame frame;
    uint8_t *rgb;
    size_t bytes;
    int64_t time_ns;             // the camera's
    struct dmabuf_image *dmabuf; // the same where it lies; NULL
    struct feed_slot *next_free;
};

struct camera_feed {
    char *camera;
    const struct place *place;
    void (*notify)(void *self);
    void *notify_self;

    struct feed_slot slots[FEED_SLOTS];
    bool lend_dmabuf;
    struct mailbox *captured, *located;
    struct present_gap *gap;
    struct feed_slot *shown; // the looker's
    pthread_t camera_thread, localizer_thread;
    bool camera_runs, localizer_runs;

    pthread_mutex_t lock; // of what follows
    pthread_cond_t changed;
    struct feed_slot *free_slots;
    struct camera_feed_state state;
    bool suspended, closing;
    struct lens lens; // as the finder knows it; width 0: nobody has looked through it since the camera was opened
};

static void notify_change(struct camera_feed *e)
{
    if (e->notify)
        e->notify(e->notify_self);
}

static struct feed_slot *acquire_slot(struct camera_feed *e)
{
    pthread_mutex_lock(&e->lock);
    struct feed_slot *p = e->free_slots;
    assert(p); // there are enough for everybody
    e->free_slots = p->next_free;
    pthread_mutex_unlock(&e->lock);
    return p;
}

static void release_slot(struct camera_feed *e, struct feed_slot *p)
{
    if (!p)
        return;
    dmabuf_image_release(&p->dmabuf);
    pthread_mutex_lock(&e->lock);
    p->next_free = e->free_slots;
    e->free_slots = p;
    pthread_mutex_unlock(&e->lock);
}

static void report_error(struct camera_feed *e, const char *sentence)
{
    pthread_mutex_lock(&e->lock);
    bool same = !strcmp(e->state.trouble, sentence);
    strncpy(e->state.trouble, sentence, sizeof e->state.trouble - 1);
    if (*sentence)
        e->state.seeing = false;
    pthread_mutex_unlock(&e->lock);
    if (!same)
        notify_change(e);
}

// ---------------------------------------------------------------- the camera's thread

static bool must_stop(struct camera_feed *e)
{
    pthread_mutex_lock(&e->lock);
    bool stop = e->closing || e->suspended;
    pthread_mutex_unlock(&e->lock);
    return stop;
}

// Until then, or until there is something else to do.
static void wait_until(struct camera_feed *e, int64_t when_ns)
{
    pthread_mutex_lock(&e->lock);
    while (!e->closing && !e->suspended && condition_wait_until_ns(&e->changed, &e->lock, when_ns))
        continue;
    pthread_mutex_unlock(&e->lock);
}

static bool fill(struct feed_slot *p, const struct frame *frame, const struct lens *lens)
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
    p->frame = (struct camera_frame){.rgb = p->rgb, .lens = *lens};
    return true;
}

static void drop_frame(struct camera_feed *e, struct feed_slot *p)
{
    pthread_mutex_lock(&e->lock);
    e->state.dropped++;
    pthread_mutex_unlock(&e->lock);
    release_slot(e, p);
}

static void publish_captured(struct camera_feed *e, struct feed_slot *p)
{
    pthread_mutex_lock(&e->lock);
    p->frame.came_ns = e->state.came_ns = clock_now_ns();
    p->frame.number = ++e->state.came;
    e->state.seeing = true;
    e->state.trouble[0] = 0;
    pthread_mutex_unlock(&e->lock);
    struct feed_slot *late = mailbox_put(e->captured, p);
    if (late)
        drop_frame(e, late);
}

// Until the camera ends, fails or is to rest. *next_ns: when a folder that begins anew is to give its first
// picture, which then comes after the last as that one after the one before.
static enum status capture_frames(struct camera_feed *e, struct source *camera, int64_t *next_ns)
{
    const bool live = source_is_live(camera);
    if (e->lend_dmabuf)
        source_enable_dmabuf(camera);
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
        struct feed_slot *p = acquire_slot(e);
        p->dmabuf = frame.dmabuf;
        if (!fill(p, &frame, &source_calibration(camera)->color)) {
            release_slot(e, p);
            return fail(ERR_MEMORY, "no memory for the camera's picture");
        }
        publish_captured(e, p);
    }
    return OK;
}

static void forget_lens(struct camera_feed *e)
{
    pthread_mutex_lock(&e->lock);
    e->lens = (struct lens){0};
    pthread_mutex_unlock(&e->lock);
}

static void keep_lens(struct camera_feed *e, const struct source *camera)
{
    pthread_mutex_lock(&e->lock);
    const struct lens lens = e->lens;
    pthread_mutex_unlock(&e->lock);
    if (lens.width && source_save_lens(camera, &lens) < 0)
        report_error(e, status_message()); // it has to be learnt again
}

static void *camera_thread(void *self)
{
    struct camera_feed *e = self;
    int64_t next_ns = 0;
    for (;;) {
        pthread_mutex_lock(&e->lock);
        while (e->suspended && !e->closing)
            pthread_cond_wait(&e->changed, &e->lock);
        bool closing = e->closing;
        e->state.came_ns = clock_now_ns();
        pthread_mutex_unlock(&e->lock);
        if (closing)
            return NULL;
        struct source *camera;
        int64_t came_before = camera_feed_query(e).came;
        enum status status = source_open(&camera, e->camera, SOURCE_CAMERA);
        if (status == OK) {
            forget_lens(e); // of the camera before
            status = capture_frames(e, camera, &next_ns);
            keep_lens(e, camera);
            source_close(&camera);
        }
        bool empty = status == NOTHING && camera_feed_query(e).came == came_before;
        if (empty)
            status = fail(ERR_DEVICE, "%s holds no picture", e->camera);
        if (status < 0) {
            report_error(e, status_message());
            wait_until(e, clock_now_ns() + RETRY_NS);
        }
    }
}

// ---------------------------------------------------------------- the finder's thread

static enum status localize_frame(struct camera_feed *e, struct camera_localizer *localizer, struct feed_slot *p)
{
    enum status status = localizer_locate(localizer, p->rgb, p->time_ns, &p->frame.world_from_camera);
    p->frame.lens = *localizer_lens(localizer);
    p->frame.moved_tags = localizer_moved_tags(localizer, &p->frame.first_moved);
    pthread_mutex_lock(&e->lock);
    e->lens = p->frame.lens;
    pthread_mutex_unlock(&e->lock);
    return status;
}

static void *localizer_thread(void *self)
{
    struct camera_feed *e = self;
    struct camera_localizer *localizer = NULL;
    struct lens lens = {0};
    struct frame_skip skip = {0};
    for (struct feed_slot *p; (p = mailbox_take(e->captured, true));) {
        struct camera_frame *s = &p->frame;
        s->locating_ns = clock_now_ns();
        enum status status = OK;
        if (e->place && (!localizer || !lens_equal(&lens, &s->lens))) {
            localizer_close(&localizer);
            lens = s->lens;
            status = localizer_open(&localizer, e->place, &lens, e->gap);
        }
        if (localizer && status == OK)
            status = localize_frame(e, localizer, p);
        s->placed = localizer && (status == OK || status == AMBIGUOUS);
        s->located_ns = clock_now_ns();
        if (status < 0)
            report_error(e, status_message());
        if (frame_skip_update(&skip, (double)(s->located_ns - s->locating_ns) * 1e-6, s->placed,
                              mailbox_full(e->captured))) {
            drop_frame(e, p);
            continue;
        }
        release_slot(e, mailbox_put(e->located, p));
        notify_change(e);
    }
    localizer_close(&localizer);
    return NULL;
}

// ---------------------------------------------------------------- the looker's side

static enum status start(struct camera_feed *e)
{
    enum status status = mailbox_open(&e->captured);
    if (status == OK)
        status = mailbox_open(&e->located);
    if (status == OK)
        status = present_gap_open(&e->gap);
    if (status != OK)
        return status;
    e->localizer_runs = !pthread_create(&e->localizer_thread, NULL, localizer_thread, e);
    e->camera_runs = e->localizer_runs && !pthread_create(&e->camera_thread, NULL, camera_thread, e);
    return e->camera_runs ? OK : fail(ERR_MEMORY, "no thread for the camera");
}

enum status camera_feed_open(struct camera_feed **out, const struct camera_feed_options *options)
{
    *out = NULL;
    struct camera_feed *e = calloc(1, sizeof *e);
    if (!e)
        return fail(ERR_MEMORY, "out of memory");
    pthread_mutex_init(&e->lock, NULL);
    condition_open(&e->changed);
    e->place = options->place;
    e->notify = options->notify;
    e->notify_self = options->notify_self;
    e->lend_dmabuf = options->lend_dmabuf;
    for (int i = 0; i < FEED_SLOTS; i++)
        release_slot(e, &e->slots[i]);
    e->camera = strdup(options->camera);
    enum status status = e->camera ? start(e) : fail(ERR_MEMORY, "out of memory");
    if (status != OK) {
        camera_feed_close(&e);
        return status;
    }
    *out = e;
    return OK;
}

void camera_feed_close(struct camera_feed **out)
{
    struct camera_feed *e = *out;
    if (!e)
        return;
    pthread_mutex_lock(&e->lock);
    e->closing = true;
    pthread_cond_broadcast(&e->changed);
    pthread_mutex_unlock(&e->lock);
    if (e->camera_runs)
        pthread_join(e->camera_thread, NULL);
    if (e->captured)
        mailbox_stop(e->captured);
    if (e->localizer_runs)
        pthread_join(e->localizer_thread, NULL);
    mailbox_close(&e->captured);
    mailbox_close(&e->located);
    present_gap_close(&e->gap);
    for (int i = 0; i < FEED_SLOTS; i++) {
        dmabuf_image_release(&e->slots[i].dmabuf);
        free(e->slots[i].rgb);
    }
    pthread_cond_destroy(&e->changed);
    pthread_mutex_destroy(&e->lock);
    free(e->camera);
    free(e);
    *out = NULL;
}

const struct camera_frame *camera_feed_latest(struct camera_feed *e)
{
    struct feed_slot *newer = mailbox_take(e->located, false);
    if (newer) {
        release_slot(e, e->shown);
        e->shown = newer;
    }
    return e->shown ? &e->shown->frame : NULL;
}

struct dmabuf_image *camera_feed_take_dmabuf(struct camera_feed *e)
{
    struct dmabuf_image *dmabuf = e->shown ? e->shown->dmabuf : NULL;
    if (dmabuf)
        e->shown->dmabuf = NULL;
    return dmabuf;
}

void camera_feed_presented(struct camera_feed *e) { present_gap_begin(e->gap); }

struct camera_feed_state camera_feed_query(struct camera_feed *e)
{
    pthread_mutex_lock(&e->lock);
    struct camera_feed_state state = e->state;
    pthread_mutex_unlock(&e->lock);
    return state;
}

void camera_feed_suspend(struct camera_feed *e, bool suspend)
{
    pthread_mutex_lock(&e->lock);
    e->suspended = suspend;
    pthread_cond_broadcast(&e->changed);
    pthread_mutex_unlock(&e->lock);
}
