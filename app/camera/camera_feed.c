#include "app/camera/camera_feed.h"

#include "app/camera/camera_localizer.h"
#include "app/state/frame_times.h"
#include "base/clock.h"
#include "base/threads.h"
#include "platform/sensors/source_player.h"

#include <pthread.h>
#include <stdlib.h>
#include <string.h>

// ---------------------------------------------------------------- mailbox

struct mailbox {
    pthread_mutex_t lock;
    pthread_cond_t put;
    void *item;
    bool stopped;
};

enum status mailbox_open(struct mailbox **out)
{
    struct mailbox *m = *out = calloc(1, sizeof *m);
    if (!m)
        return fail(ERR_MEMORY, "no memory for images between threads");
    pthread_mutex_init(&m->lock, NULL);
    pthread_cond_init(&m->put, NULL);
    return OK;
}

void mailbox_close(struct mailbox **m)
{
    if (*m) {
        pthread_cond_destroy(&(*m)->put);
        pthread_mutex_destroy(&(*m)->lock);
        free(*m);
    }
    *m = NULL;
}

void *mailbox_put(struct mailbox *m, void *item)
{
    pthread_mutex_lock(&m->lock);
    void *untaken = m->item;
    m->item = item;
    pthread_cond_signal(&m->put);
    pthread_mutex_unlock(&m->lock);
    return untaken;
}

void *mailbox_take(struct mailbox *m, bool wait)
{
    pthread_mutex_lock(&m->lock);
    while (wait && !m->item && !m->stopped)
        pthread_cond_wait(&m->put, &m->lock);
    void *item = m->stopped ? NULL : m->item;
    if (item)
        m->item = NULL;
    pthread_mutex_unlock(&m->lock);
    return item;
}

bool mailbox_full(struct mailbox *m)
{
    pthread_mutex_lock(&m->lock);
    bool waits = m->item;
    pthread_mutex_unlock(&m->lock);
    return waits;
}

void mailbox_stop(struct mailbox *m)
{
    pthread_mutex_lock(&m->lock);
    m->stopped = true;
    pthread_cond_broadcast(&m->put);
    pthread_mutex_unlock(&m->lock);
}

// ---------------------------------------------------------------- present gap

static const int64_t MAX_WAIT_NS = 50000000;

struct present_gap {
    pthread_mutex_t lock; // protects the fields below
    pthread_cond_t changed;
    int64_t count;
};

enum status present_gap_open(struct present_gap **out)
{
    struct present_gap *g = *out = calloc(1, sizeof *g);
    if (!g)
        return fail(ERR_MEMORY, "no memory for the gap between pictures");
    pthread_mutex_init(&g->lock, NULL);
    condition_open(&g->changed);
    return OK;
}

void present_gap_close(struct present_gap **g)
{
    if (*g) {
        pthread_cond_destroy(&(*g)->changed);
        pthread_mutex_destroy(&(*g)->lock);
        free(*g);
    }
    *g = NULL;
}

void present_gap_begin(struct present_gap *g)
{
    pthread_mutex_lock(&g->lock);
    g->count++;
    pthread_cond_broadcast(&g->changed);
    pthread_mutex_unlock(&g->lock);
}

int64_t present_gap_count(struct present_gap *g)
{
    pthread_mutex_lock(&g->lock);
    const int64_t count = g->count;
    pthread_mutex_unlock(&g->lock);
    return count;
}

void present_gap_wait(struct present_gap *g, int64_t count)
{
    const int64_t until_ns = clock_now_ns() + MAX_WAIT_NS;
    pthread_mutex_lock(&g->lock);
    while (g->count <= count && condition_wait_until_ns(&g->changed, &g->lock, until_ns))
        continue;
    pthread_mutex_unlock(&g->lock);
}

// ---------------------------------------------------------------- camera feed

// One waits to be localised, one to be drawn; each of the three threads holds at most two, while it exchanges them.
enum { FEED_SLOTS = 8 };

struct feed_slot {
    struct camera_frame frame;
    uint8_t *rgb;
    size_t bytes;
    int64_t time_ns;             // of the exposure, by the camera's clock
    struct dmabuf_image *dmabuf; // the same image in the camera's memory; NULL: none
    struct feed_slot *next_free;
};

struct camera_feed {
    const struct place *place;
    void (*notify)(void *self);
    void *notify_self;

    struct feed_slot slots[FEED_SLOTS];
    bool lend_dmabuf;
    struct mailbox *captured, *located;
    struct present_gap *gap;
    struct feed_slot *shown;     // by the drawing thread
    struct source_player player; // on the camera's thread
    struct worker_thread localizer;

    // Under the player's lock:
    struct feed_slot *free_slots;
    struct camera_feed_state state;
    struct lens lens; // by the localizer; width 0: no image has been localised since the camera was opened
};

static void notify_change(struct camera_feed *f)
{
    if (f->notify)
        f->notify(f->notify_self);
}

static struct feed_slot *acquire_slot(struct camera_feed *f)
{
    pthread_mutex_lock(&f->player.worker.lock);
    struct feed_slot *p = f->free_slots;
    assert(p); // FEED_SLOTS suffices for all threads
    f->free_slots = p->next_free;
    pthread_mutex_unlock(&f->player.worker.lock);
    return p;
}

static void release_slot(struct camera_feed *f, struct feed_slot *p)
{
    if (!p)
        return;
    dmabuf_image_release(&p->dmabuf);
    pthread_mutex_lock(&f->player.worker.lock);
    p->next_free = f->free_slots;
    f->free_slots = p;
    pthread_mutex_unlock(&f->player.worker.lock);
}

static void report_error(struct camera_feed *f, const char *sentence)
{
    pthread_mutex_lock(&f->player.worker.lock);
    bool same = !strcmp(f->state.trouble, sentence);
    strncpy(f->state.trouble, sentence, sizeof f->state.trouble - 1);
    if (*sentence)
        f->state.seeing = false;
    pthread_mutex_unlock(&f->player.worker.lock);
    if (!same)
        notify_change(f);
}

// ---------------------------------------------------------------- camera thread

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
    pthread_mutex_lock(&f->player.worker.lock);
    f->state.dropped++;
    pthread_mutex_unlock(&f->player.worker.lock);
    release_slot(f, p);
}

static void publish_captured(struct camera_feed *f, struct feed_slot *p)
{
    pthread_mutex_lock(&f->player.worker.lock);
    p->frame.received_ns = f->state.received_ns = clock_now_ns();
    p->frame.number = ++f->state.received;
    f->state.seeing = true;
    f->state.trouble[0] = 0;
    pthread_mutex_unlock(&f->player.worker.lock);
    struct feed_slot *late = mailbox_put(f->captured, p);
    if (late)
        drop_frame(f, late);
}

// Runs until the camera ends, fails or is suspended.
static enum status capture_frames(struct camera_feed *f)
{
    struct source_player *player = &f->player;
    if (f->lend_dmabuf)
        source_enable_dmabuf(player->source);
    while (!source_player_must_stop(player)) {
        struct frame frame;
        enum status status = source_player_next(player, &frame);
        if (status == ERR_INPUT || (status == OK && !frame.color))
            continue; // one damaged image
        if (status != OK)
            return status;
        source_player_wait_for_frame(player);
        struct feed_slot *p = acquire_slot(f);
        p->dmabuf = frame.dmabuf;
        if (!fill_slot(p, &frame, &source_calibration(player->source)->color)) {
            release_slot(f, p);
            return fail(ERR_MEMORY, "no memory for the camera's image");
        }
        publish_captured(f, p);
    }
    return OK;
}

static void reset_lens(struct camera_feed *f)
{
    pthread_mutex_lock(&f->player.worker.lock);
    f->lens = (struct lens){0};
    pthread_mutex_unlock(&f->player.worker.lock);
}

static void save_lens(struct camera_feed *f, const struct source *camera)
{
    pthread_mutex_lock(&f->player.worker.lock);
    const struct lens lens = f->lens;
    pthread_mutex_unlock(&f->player.worker.lock);
    if (lens.width && source_save_lens(camera, &lens) < 0)
        report_error(f, status_message()); // it has to be estimated again
}

static enum status play(struct camera_feed *f)
{
    pthread_mutex_lock(&f->player.worker.lock);
    const int64_t received_before = f->state.received;
    f->state.received_ns = clock_now_ns();
    pthread_mutex_unlock(&f->player.worker.lock);
    enum status status = source_player_open_source(&f->player);
    if (status != OK)
        return status;
    reset_lens(f); // of the previous camera
    status = capture_frames(f);
    save_lens(f, f->player.source);
    return status == NOTHING && camera_feed_query(f).received == received_before
               ? fail(ERR_DEVICE, "%s holds no image", f->player.uri)
               : status;
}

static void *run_camera(void *self)
{
    struct camera_feed *f = self;
    while (source_player_wait_to_play(&f->player)) {
        enum status status = play(f);
        source_player_close_source(&f->player);
        if (status < 0) {
            report_error(f, status_message());
            source_player_wait_to_retry(&f->player);
        }
    }
    return NULL;
}

// ---------------------------------------------------------------- localizer thread

static enum status localize_frame(struct camera_feed *f, struct camera_localizer *localizer, struct feed_slot *p)
{
    enum status status = localizer_locate(localizer, p->rgb, p->time_ns, &p->frame.world_from_camera);
    p->frame.lens = *localizer_lens(localizer);
    p->frame.moved_tags = localizer_moved_tags(localizer, &p->frame.first_moved);
    pthread_mutex_lock(&f->player.worker.lock);
    f->lens = p->frame.lens;
    pthread_mutex_unlock(&f->player.worker.lock);
    return status;
}

static void *run_localizer(void *self)
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
    status = worker_thread_start(&f->localizer, run_localizer, f, "to localise the camera");
    return status == OK ? worker_thread_start(&f->player.worker, run_camera, f, "for the camera") : status;
}

enum status camera_feed_open(struct camera_feed **out, const struct camera_feed_options *options)
{
    *out = NULL;
    struct camera_feed *f = calloc(1, sizeof *f);
    if (!f)
        return fail(ERR_MEMORY, "no memory for the camera");
    worker_thread_open(&f->localizer);
    enum status status = source_player_open(&f->player, options->camera, SOURCE_CAMERA);
    f->place = options->place;
    f->notify = options->notify;
    f->notify_self = options->notify_self;
    f->lend_dmabuf = options->lend_dmabuf;
    for (int i = 0; i < FEED_SLOTS; i++)
        release_slot(f, &f->slots[i]);
    if (status == OK)
        status = start_threads(f);
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
    worker_thread_stop(&f->player.worker);
    if (f->captured)
        mailbox_stop(f->captured);
    worker_thread_close(&f->localizer);
    mailbox_close(&f->captured);
    mailbox_close(&f->located);
    present_gap_close(&f->gap);
    for (int i = 0; i < FEED_SLOTS; i++) {
        dmabuf_image_release(&f->slots[i].dmabuf);
        free(f->slots[i].rgb);
    }
    source_player_close(&f->player);
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
    pthread_mutex_lock(&f->player.worker.lock);
    struct camera_feed_state state = f->state;
    pthread_mutex_unlock(&f->player.worker.lock);
    return state;
}

void camera_feed_suspend(struct camera_feed *f, bool suspend) { source_player_suspend(&f->player, suspend); }
