#include "app/camera/camera_feed.h"

#include "app/state/frame_times.h"
#include "base/clock.h"
#include "base/threads.h"
#include "locate/camera_tracker.h"
#include "platform/sensors/source.h"

#include <pthread.h>
#include <stdlib.h>
#include <string.h>

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

void present_gap_close(struct present_gap **gap)
{
    if (*gap) {
        pthread_cond_destroy(&(*gap)->changed);
        pthread_mutex_destroy(&(*gap)->lock);
        free(*gap);
    }
    *gap = NULL;
}

void present_gap_begin(struct present_gap *gap)
{
    pthread_mutex_lock(&gap->lock);
    gap->count++;
    pthread_cond_broadcast(&gap->changed);
    pthread_mutex_unlock(&gap->lock);
}

int64_t present_gap_count(struct present_gap *gap)
{
    pthread_mutex_lock(&gap->lock);
    const int64_t count = gap->count;
    pthread_mutex_unlock(&gap->lock);
    return count;
}

void present_gap_wait(struct present_gap *gap, int64_t count)
{
    const int64_t until_ns = clock_now_ns() + MAX_WAIT_NS;
    pthread_mutex_lock(&gap->lock);
    while (gap->count <= count && condition_wait_until_ns(&gap->changed, &gap->lock, until_ns))
        continue;
    pthread_mutex_unlock(&gap->lock);
}

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

// ---------------------------------------------------------------- camera localizer, calling thread

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

enum status localizer_locate(struct camera_localizer *localizer, const uint8_t *color, int64_t time_ns,
                             struct pose *world_from_camera)
{
    struct location location;
    enum status status = OK;
    localizer->restarted |= time_ns <= localizer->last_ns;
    localizer->last_ns = time_ns;
    if (localizer->relocalizing) {
        if (relocalizer_busy(localizer->relocalizer, color, time_ns))
            return NOTHING;
        localizer->relocalizing = false;
        int finds;
        status = relocalizer_finish(localizer->relocalizer, &finds);
        localizer->finds += finds;
    }
    if (localizer->restarted) // the camera was opened again
        camera_tracker_reset(localizer->tracker);
    localizer->restarted = false;
    if (status >= 0)
        status = track_or_find(localizer, color, time_ns, &location);
    if (status == ERR_SOLVER)
        return NOTHING; // only this image failed
    if (status == OK || status == AMBIGUOUS)
        *world_from_camera = location.world_from_camera;
    return status;
}

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

static enum status localize_slot(struct camera_feed *feed, struct camera_localizer *localizer, struct feed_slot *slot)
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
            status = localize_slot(f, localizer, slot);
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
