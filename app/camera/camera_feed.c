#include "app/camera/camera_feed.h"

#include "app/camera/camera_localizer.h"
#include "app/camera/mailbox.h"
#include "app/camera/present_gap.h"
#include "app/state/frame_skip.h"
#include "base/clock.h"
#include "base/condition.h"
#include "platform/sensors/source.h"

#include <pthread.h>
#include <stdlib.h>
#include <string.h>

// One waits to be localised, one to be drawn; each of the three threads holds at most two, while it exchanges them.
enum { FEED_SLOTS = 8 };

static const int64_t RETRY_NS = 1000000000;

struct feed_slot {
    struct camera_frame frame;
    uint8_t *rgb;
    size_t bytes;
    int64_t time_ns;             // of the exposure, by the camera's clock
    struct dmabuf_image *dmabuf; // the same image in the camera's memory; NULL: none
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
    struct feed_slot *shown; // by the drawing thread
    pthread_t camera_thread, localizer_thread;
    bool camera_runs, localizer_runs;

    pthread_mutex_t lock; // protects the fields below
    pthread_cond_t changed;
    struct feed_slot *free_slots;
    struct camera_feed_state state;
    bool suspended, closing;
    struct lens lens; // by the localizer; width 0: no image has been localised since the camera was opened
};

static void notify_change(struct camera_feed *f)
{
    if (f->notify)
        f->notify(f->notify_self);
}

static struct feed_slot *acquire_slot(struct camera_feed *f)
{
    pthread_mutex_lock(&f->lock);
    struct feed_slot *p = f->free_slots;
    assert(p); // FEED_SLOTS suffices for all threads
    f->free_slots = p->next_free;
    pthread_mutex_unlock(&f->lock);
    return p;
}

static void release_slot(struct camera_feed *f, struct feed_slot *p)
{
    if (!p)
        return;
    dmabuf_image_release(&p->dmabuf);
    pthread_mutex_lock(&f->lock);
    p->next_free = f->free_slots;
    f->free_slots = p;
    pthread_mutex_unlock(&f->lock);
}

static void report_error(struct camera_feed *f, const char *sentence)
{
    pthread_mutex_lock(&f->lock);
    bool same = !strcmp(f->state.trouble, sentence);
    strncpy(f->state.trouble, sentence, sizeof f->state.trouble - 1);
    if (*sentence)
        f->state.seeing = false;
    pthread_mutex_unlock(&f->lock);
    if (!same)
        notify_change(f);
}

// ---------------------------------------------------------------- camera thread

static bool must_stop(struct camera_feed *f)
{
    pthread_mutex_lock(&f->lock);
    bool stop = f->closing || f->suspended;
    pthread_mutex_unlock(&f->lock);
    return stop;
}

// Blocks until that time, or until the feed is closed or suspended.
static void wait_until(struct camera_feed *f, int64_t when_ns)
{
    pthread_mutex_lock(&f->lock);
    while (!f->closing && !f->suspended && condition_wait_until_ns(&f->changed, &f->lock, when_ns))
        continue;
    pthread_mutex_unlock(&f->lock);
}

static bool fill_slot(struct feed_slot *p, const struct frame *frame, const struct lens *lens)
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

static void drop_frame(struct camera_feed *f, struct feed_slot *p)
{
    pthread_mutex_lock(&f->lock);
    f->state.dropped++;
    pthread_mutex_unlock(&f->lock);
    release_slot(f, p);
}

static void publish_captured(struct camera_feed *f, struct feed_slot *p)
{
    pthread_mutex_lock(&f->lock);
    p->frame.received_ns = f->state.received_ns = clock_now_ns();
    p->frame.number = ++f->state.received;
    f->state.seeing = true;
    f->state.trouble[0] = 0;
    pthread_mutex_unlock(&f->lock);
    struct feed_slot *late = mailbox_put(f->captured, p);
    if (late)
        drop_frame(f, late);
}

// Runs until the camera ends, fails or is suspended. *next_ns: when a folder that restarts delivers its first image:
// after the last one, at the interval of the last two.
static enum status capture_frames(struct camera_feed *f, struct source *camera, int64_t *next_ns)
{
    const bool live = source_is_live(camera);
    if (f->lend_dmabuf)
        source_enable_dmabuf(camera);
    int64_t began_ns = 0, first_ns = 0, due_ns = 0;
    while (!must_stop(f)) {
        struct frame frame;
        enum status status = source_next(camera, &frame);
        if (status == ERR_INPUT || (status == OK && !frame.color))
            continue; // one damaged image
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
            wait_until(f, due_ns);
        }
        struct feed_slot *p = acquire_slot(f);
        p->dmabuf = frame.dmabuf;
        if (!fill_slot(p, &frame, &source_calibration(camera)->color)) {
            release_slot(f, p);
            return fail(ERR_MEMORY, "no memory for the camera's image");
        }
        publish_captured(f, p);
    }
    return OK;
}

static void reset_lens(struct camera_feed *f)
{
    pthread_mutex_lock(&f->lock);
    f->lens = (struct lens){0};
    pthread_mutex_unlock(&f->lock);
}

static void save_lens(struct camera_feed *f, const struct source *camera)
{
    pthread_mutex_lock(&f->lock);
    const struct lens lens = f->lens;
    pthread_mutex_unlock(&f->lock);
    if (lens.width && source_save_lens(camera, &lens) < 0)
        report_error(f, status_message()); // it has to be estimated again
}

static void *camera_thread(void *self)
{
    struct camera_feed *f = self;
    int64_t next_ns = 0;
    for (;;) {
        pthread_mutex_lock(&f->lock);
        while (f->suspended && !f->closing)
            pthread_cond_wait(&f->changed, &f->lock);
        bool closing = f->closing;
        f->state.received_ns = clock_now_ns();
        pthread_mutex_unlock(&f->lock);
        if (closing)
            return NULL;
        struct source *camera;
        int64_t received_before = camera_feed_query(f).received;
        enum status status = source_open(&camera, f->camera, SOURCE_CAMERA);
        if (status == OK) {
            reset_lens(f); // of the previous camera
            status = capture_frames(f, camera, &next_ns);
            save_lens(f, camera);
            source_close(&camera);
        }
        bool empty = status == NOTHING && camera_feed_query(f).received == received_before;
        if (empty)
            status = fail(ERR_DEVICE, "%s holds no image", f->camera);
        if (status < 0) {
            report_error(f, status_message());
            wait_until(f, clock_now_ns() + RETRY_NS);
        }
    }
}

// ---------------------------------------------------------------- localizer thread

static enum status localize_frame(struct camera_feed *f, struct camera_localizer *localizer, struct feed_slot *p)
{
    enum status status = localizer_locate(localizer, p->rgb, p->time_ns, &p->frame.world_from_camera);
    p->frame.lens = *localizer_lens(localizer);
    p->frame.moved_tags = localizer_moved_tags(localizer, &p->frame.first_moved);
    pthread_mutex_lock(&f->lock);
    f->lens = p->frame.lens;
    pthread_mutex_unlock(&f->lock);
    return status;
}

static void *localizer_thread(void *self)
{
    struct camera_feed *f = self;
    struct camera_localizer *localizer = NULL;
    struct lens lens = {0};
    struct frame_skip skip = {0};
    for (struct feed_slot *p; (p = mailbox_take(f->captured, true));) {
        struct camera_frame *s = &p->frame;
        s->locating_ns = clock_now_ns();
        enum status status = OK;
        if (f->place && (!localizer || !lens_equal(&lens, &s->lens))) {
            localizer_close(&localizer);
            lens = s->lens;
            status = localizer_open(&localizer, f->place, &lens, f->gap);
        }
        if (localizer && status == OK)
            status = localize_frame(f, localizer, p);
        s->placed = localizer && (status == OK || status == AMBIGUOUS);
        s->located_ns = clock_now_ns();
        if (status < 0)
            report_error(f, status_message());
        if (frame_skip_update(&skip, (double)(s->located_ns - s->locating_ns) * 1e-6, s->placed,
                              mailbox_full(f->captured))) {
            drop_frame(f, p);
            continue;
        }
        release_slot(f, mailbox_put(f->located, p));
        notify_change(f);
    }
    localizer_close(&localizer);
    return NULL;
}

// ---------------------------------------------------------------- drawing thread

static enum status start_threads(struct camera_feed *f)
{
    enum status status = mailbox_open(&f->captured);
    if (status == OK)
        status = mailbox_open(&f->located);
    if (status == OK)
        status = present_gap_open(&f->gap);
    if (status != OK)
        return status;
    f->localizer_runs = !pthread_create(&f->localizer_thread, NULL, localizer_thread, f);
    f->camera_runs = f->localizer_runs && !pthread_create(&f->camera_thread, NULL, camera_thread, f);
    return f->camera_runs ? OK : fail(ERR_MEMORY, "no thread for the camera");
}

enum status camera_feed_open(struct camera_feed **out, const struct camera_feed_options *options)
{
    *out = NULL;
    struct camera_feed *f = calloc(1, sizeof *f);
    if (!f)
        return fail(ERR_MEMORY, "out of memory");
    pthread_mutex_init(&f->lock, NULL);
    condition_open(&f->changed);
    f->place = options->place;
    f->notify = options->notify;
    f->notify_self = options->notify_self;
    f->lend_dmabuf = options->lend_dmabuf;
    for (int i = 0; i < FEED_SLOTS; i++)
        release_slot(f, &f->slots[i]);
    f->camera = strdup(options->camera);
    enum status status = f->camera ? start_threads(f) : fail(ERR_MEMORY, "out of memory");
    if (status != OK) {
        camera_feed_close(&f);
        return status;
    }
    *out = f;
    return OK;
}

void camera_feed_close(struct camera_feed **out)
{
    struct camera_feed *f = *out;
    if (!f)
        return;
    pthread_mutex_lock(&f->lock);
    f->closing = true;
    pthread_cond_broadcast(&f->changed);
    pthread_mutex_unlock(&f->lock);
    if (f->camera_runs)
        pthread_join(f->camera_thread, NULL);
    if (f->captured)
        mailbox_stop(f->captured);
    if (f->localizer_runs)
        pthread_join(f->localizer_thread, NULL);
    mailbox_close(&f->captured);
    mailbox_close(&f->located);
    present_gap_close(&f->gap);
    for (int i = 0; i < FEED_SLOTS; i++) {
        dmabuf_image_release(&f->slots[i].dmabuf);
        free(f->slots[i].rgb);
    }
    pthread_cond_destroy(&f->changed);
    pthread_mutex_destroy(&f->lock);
    free(f->camera);
    free(f);
    *out = NULL;
}

const struct camera_frame *camera_feed_latest(struct camera_feed *f)
{
    struct feed_slot *newer = mailbox_take(f->located, false);
    if (newer) {
        release_slot(f, f->shown);
        f->shown = newer;
    }
    return f->shown ? &f->shown->frame : NULL;
}

struct dmabuf_image *camera_feed_take_dmabuf(struct camera_feed *f)
{
    struct dmabuf_image *dmabuf = f->shown ? f->shown->dmabuf : NULL;
    if (dmabuf)
        f->shown->dmabuf = NULL;
    return dmabuf;
}

void camera_feed_presented(struct camera_feed *f) { present_gap_begin(f->gap); }

struct camera_feed_state camera_feed_query(struct camera_feed *f)
{
    pthread_mutex_lock(&f->lock);
    struct camera_feed_state state = f->state;
    pthread_mutex_unlock(&f->lock);
    return state;
}

void camera_feed_suspend(struct camera_feed *f, bool suspend)
{
    pthread_mutex_lock(&f->lock);
    f->suspended = suspend;
    pthread_cond_broadcast(&f->changed);
    pthread_mutex_unlock(&f->lock);
}
