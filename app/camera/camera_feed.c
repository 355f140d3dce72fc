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

void mailbox_close(struct mailbox **mailbox)
{
    if (*mailbox) {
        pthread_cond_destroy(&(*mailbox)->put);
        pthread_mutex_destroy(&(*mailbox)->lock);
        free(*mailbox);
    }
    *mailbox = NULL;
}

void *mailbox_put(struct mailbox *mailbox, void *item)
{
    pthread_mutex_lock(&mailbox->lock);
    void *untaken = mailbox->item;
    mailbox->item = item;
    pthread_cond_signal(&mailbox->put);
    pthread_mutex_unlock(&mailbox->lock);
    return untaken;
}

void *mailbox_take(struct mailbox *mailbox, bool wait)
{
    pthread_mutex_lock(&mailbox->lock);
    while (wait && !mailbox->item && !mailbox->stopped)
        pthread_cond_wait(&mailbox->put, &mailbox->lock);
    void *item = mailbox->stopped ? NULL : mailbox->item;
    if (item)
        mailbox->item = NULL;
    pthread_mutex_unlock(&mailbox->lock);
    return item;
}

bool mailbox_full(struct mailbox *mailbox)
{
    pthread_mutex_lock(&mailbox->lock);
    bool waits = mailbox->item;
    pthread_mutex_unlock(&mailbox->lock);
    return waits;
}

void mailbox_stop(struct mailbox *mailbox)
{
    pthread_mutex_lock(&mailbox->lock);
    mailbox->stopped = true;
    pthread_cond_broadcast(&mailbox->put);
    pthread_mutex_unlock(&mailbox->lock);
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

static void notify_change(struct camera_feed *feed)
{
    if (feed->notify)
        feed->notify(feed->notify_self);
}

static struct feed_slot *acquire_slot(struct camera_feed *feed)
{
    pthread_mutex_lock(&feed->player.worker.lock);
    struct feed_slot *slot = feed->free_slots;
    assert(slot); // FEED_SLOTS suffices for all threads
    feed->free_slots = slot->next_free;
    pthread_mutex_unlock(&feed->player.worker.lock);
    return slot;
}

static void release_slot(struct camera_feed *feed, struct feed_slot *slot)
{
    if (!slot)
        return;
    dmabuf_image_release(&slot->dmabuf);
    pthread_mutex_lock(&feed->player.worker.lock);
    slot->next_free = feed->free_slots;
    feed->free_slots = slot;
    pthread_mutex_unlock(&feed->player.worker.lock);
}

static void report_error(struct camera_feed *feed, const char *sentence)
{
    pthread_mutex_lock(&feed->player.worker.lock);
    bool same = !strcmp(feed->state.trouble, sentence);
    strncpy(feed->state.trouble, sentence, sizeof feed->state.trouble - 1);
    if (*sentence)
        feed->state.seeing = false;
    pthread_mutex_unlock(&feed->player.worker.lock);
    if (!same)
        notify_change(feed);
}

// ---------------------------------------------------------------- camera thread

static bool fill_slot(struct feed_slot *slot, const struct frame *frame, const struct lens *lens)
{
    size_t bytes = 3 * (size_t)lens->width * (size_t)lens->height;
    if (bytes != slot->bytes) {
        free(slot->rgb);
        slot->rgb = malloc(bytes);
        slot->bytes = slot->rgb ? bytes : 0;
    }
    if (!slot->rgb)
        return false;
    memcpy(slot->rgb, frame->color, bytes);
    slot->time_ns = frame->time_ns;
    slot->frame = (struct camera_frame){.rgb = slot->rgb, .lens = *lens};
    return true;
}

static void drop_frame(struct camera_feed *feed, struct feed_slot *slot)
{
    pthread_mutex_lock(&feed->player.worker.lock);
    feed->state.dropped++;
    pthread_mutex_unlock(&feed->player.worker.lock);
    release_slot(feed, slot);
}

static void publish_captured(struct camera_feed *feed, struct feed_slot *slot)
{
    pthread_mutex_lock(&feed->player.worker.lock);
    slot->frame.received_ns = feed->state.received_ns = clock_now_ns();
    slot->frame.number = ++feed->state.received;
    feed->state.seeing = true;
    feed->state.trouble[0] = 0;
    pthread_mutex_unlock(&feed->player.worker.lock);
    struct feed_slot *late = mailbox_put(feed->captured, slot);
    if (late)
        drop_frame(feed, late);
}

// Runs until the camera ends, fails or is suspended.
static enum status capture_frames(struct camera_feed *feed)
{
    struct source_player *player = &feed->player;
    if (feed->lend_dmabuf)
        source_enable_dmabuf(player->source);
    while (!source_player_must_stop(player)) {
        struct frame frame;
        enum status status = source_player_next(player, &frame);
        if (status == ERR_INPUT || (status == OK && !frame.color))
            continue; // one damaged image
        if (status != OK)
            return status;
        source_player_wait_for_frame(player);
        struct feed_slot *slot = acquire_slot(feed);
        slot->dmabuf = frame.dmabuf;
        if (!fill_slot(slot, &frame, &source_calibration(player->source)->color)) {
            release_slot(feed, slot);
            return fail(ERR_MEMORY, "no memory for the camera's image");
        }
        publish_captured(feed, slot);
    }
    return OK;
}

static void reset_lens(struct camera_feed *feed)
{
    pthread_mutex_lock(&feed->player.worker.lock);
    feed->lens = (struct lens){0};
    pthread_mutex_unlock(&feed->player.worker.lock);
}

static void save_lens(struct camera_feed *feed, const struct source *camera)
{
    pthread_mutex_lock(&feed->player.worker.lock);
    const struct lens lens = feed->lens;
    pthread_mutex_unlock(&feed->player.worker.lock);
    if (lens.width && source_save_lens(camera, &lens) < 0)
        report_error(feed, status_message()); // it has to be estimated again
}

static enum status play(struct camera_feed *feed)
{
    pthread_mutex_lock(&feed->player.worker.lock);
    const int64_t received_before = feed->state.received;
    feed->state.received_ns = clock_now_ns();
    pthread_mutex_unlock(&feed->player.worker.lock);
    enum status status = source_player_open_source(&feed->player);
    if (status != OK)
        return status;
    reset_lens(feed); // of the previous camera
    status = capture_frames(feed);
    save_lens(feed, feed->player.source);
    return status == NOTHING && camera_feed_query(feed).received == received_before
               ? fail(ERR_DEVICE, "%s holds no image", feed->player.uri)
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

static enum status localize_frame(struct camera_feed *feed, struct camera_localizer *localizer, struct feed_slot *slot)
{
    enum status status = localizer_locate(localizer, slot->rgb, slot->time_ns, &slot->frame.world_from_camera);
    slot->frame.lens = *localizer_lens(localizer);
    slot->frame.moved_tags = localizer_moved_tags(localizer, &slot->frame.first_moved);
    pthread_mutex_lock(&feed->player.worker.lock);
    feed->lens = slot->frame.lens;
    pthread_mutex_unlock(&feed->player.worker.lock);
    return status;
}

static void *run_localizer(void *self)
{
    struct camera_feed *f = self;
    struct camera_localizer *localizer = NULL;
    struct lens lens = {0};
    struct frame_skip skip = {0};
    for (struct feed_slot *slot; (slot = mailbox_take(f->captured, true));) {
        struct camera_frame *frame = &slot->frame;
        frame->locating_ns = clock_now_ns();
        enum status status = OK;
        if (f->place && (!localizer || !lens_equal(&lens, &frame->lens))) {
            localizer_close(&localizer);
            lens = frame->lens;
            status = localizer_open(&localizer, f->place, &lens, f->gap);
        }
        if (localizer && status == OK)
            status = localize_frame(f, localizer, slot);
        frame->placed = localizer && (status == OK || status == AMBIGUOUS);
        frame->located_ns = clock_now_ns();
        if (status < 0)
            report_error(f, status_message());
        if (frame_skip_update(&skip, (double)(frame->located_ns - frame->locating_ns) * 1e-6, frame->placed,
                              mailbox_full(f->captured))) {
            drop_frame(f, slot);
            continue;
        }
        release_slot(f, mailbox_put(f->located, slot));
        notify_change(f);
    }
    localizer_close(&localizer);
    return NULL;
}

// ---------------------------------------------------------------- drawing thread

static enum status start_threads(struct camera_feed *feed)
{
    enum status status = mailbox_open(&feed->captured);
    if (status == OK)
        status = mailbox_open(&feed->located);
    if (status == OK)
        status = present_gap_open(&feed->gap);
    if (status != OK)
        return status;
    status = worker_thread_start(&feed->localizer, run_localizer, feed, "to localise the camera");
    return status == OK ? worker_thread_start(&feed->player.worker, run_camera, feed, "for the camera") : status;
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

const struct camera_frame *camera_feed_latest(struct camera_feed *feed)
{
    struct feed_slot *newer = mailbox_take(feed->located, false);
    if (newer) {
        release_slot(feed, feed->shown);
        feed->shown = newer;
    }
    return feed->shown ? &feed->shown->frame : NULL;
}

struct dmabuf_image *camera_feed_take_dmabuf(struct camera_feed *feed)
{
    struct dmabuf_image *dmabuf = feed->shown ? feed->shown->dmabuf : NULL;
    if (dmabuf)
        feed->shown->dmabuf = NULL;
    return dmabuf;
}

void camera_feed_presented(struct camera_feed *feed) { present_gap_begin(feed->gap); }

struct camera_feed_state camera_feed_query(struct camera_feed *feed)
{
    pthread_mutex_lock(&feed->player.worker.lock);
    struct camera_feed_state state = feed->state;
    pthread_mutex_unlock(&feed->player.worker.lock);
    return state;
}

void camera_feed_suspend(struct camera_feed *feed, bool suspend) { source_player_suspend(&feed->player, suspend); }
